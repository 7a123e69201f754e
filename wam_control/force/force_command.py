"""Which commands the force loop obeys: within the limits; what it does where one ends."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from wam_control.force.contact_place import pinned_position, torque_of_position
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.task import AxisKind, TaskCommand
from wam_control.force.thresholds import FORCE
from wam_control.thresholds import MOTION
from wam_description.arm import Covers
from wam_description.event import Event, Value, refused
from wam_description.parts import Joints
from wam_description.signals import ZERO, ForceCommand

NO_FORCE = ForceCommand("", (0.0, 0.0, 0.0))


class Commands(NamedTuple):
    """What the force loop has to do in one period.

    Attributes
    ----------
    force : commanded force; None where there is none.
    torque : commanded joint torques of the arm on the world (n,), N m; None where there are none.
    posture : joint angles to hold (n,), rad.
    refusals : why a command of this period is not taken, by topic.
    rising : how far force or torque are on the way to their command, limited in rate; nothing where they are there.
    risen : for how long, s.
    """

    force: ForceCommand | None
    torque: Sequence[float] | None
    posture: list[float]
    refusals: dict[str, Event]
    rising: Mapping[str, Value] = {}
    risen: float = 0.0


class CommandAdmission:
    """Keeps the last good command in place of one beyond the limits; where a command ends, the arm stays where it is.

    Force and torque follow their commands no faster than their rate limits; a force in another frame begins at zero.

    Parameters
    ----------
    joints : of the arm, with their limits.
    covers : of the arm, with their lengths.
    command_age : time for which the last good command counts while others are refused, s.

    Attributes
    ----------
    posture : joint angles to hold (n,), rad; empty before the first state.
    """

    def __init__(self, joints: Joints, covers: Covers, command_age: float) -> None:
        self._joints, self._covers, self._command_age = joints, covers, command_age
        self._last = f"the last good command remains in force for {command_age:g} s"
        self._force_age = self._torque_age = self._risen = 0.0
        self.posture: list[float] = []
        self._present = NO_FORCE
        self._present_torque: Sequence[float] = [0.0] * len(joints.names)
        self._force: ForceCommand | None = None
        self._torque: Sequence[float] | None = None
        self._is_moved = self._has_lapsed = self._is_ignored = False

    def restart(self, q: Sequence[float]) -> None:
        """Hold these joint angles (n,), rad, until another posture is commanded; forget every command."""
        self._force = self._torque = None
        self._is_moved = self._has_lapsed = self._is_ignored = False
        self._risen = 0.0
        self._rising_force(None, 0.0)
        self._rising_torque(None, 0.0)
        self.posture = list(q)

    def step(
        self,
        parameters: ForceLoopParameters,
        q: Sequence[float],
        force: ForceCommand | None,
        posture: Sequence[float] | None,
        torque: Sequence[float] | None,
        dt: float,
        task: TaskCommand | None = None,
    ) -> Commands:
        """Admit the commands of one outer period; arguments as those of `ForceLoop.step`."""
        refusals: dict[str, str] = {}
        pressed = self._force is not None and any(self._force.force)
        commanded = _size(force)
        if force is not None and commanded < FORCE.smallest_force and force.force != ZERO:
            force = force._replace(force=ZERO)
        if commanded > parameters.force_limit:
            refusals["force_command"] = self._refusal(commanded, "force_limit", parameters.force_limit, "N")
        elif force is not None and (unpinned := self._unpinned(force)):
            refusals["force_command"] = unpinned
        if "force_command" in refusals:
            self._force_age += dt
            if self._force_age > self._command_age or _size(self._force) > parameters.force_limit:
                self._force = force = None
        else:
            self._force, self._force_age = force, 0.0
        commanded = _largest(torque)
        if commanded > parameters.torque_limit:
            refusals["joint_torque_command"] = self._refusal(commanded, "torque_limit", parameters.torque_limit, "N m")
            self._torque_age += dt
            if self._torque_age > self._command_age or _largest(self._torque) > parameters.torque_limit:
                self._torque = None
        else:
            self._torque, self._torque_age = torque, 0.0
        if posture is not None and (beyond := self._joints.beyond(posture)):
            refusals["joint_posture_command"] = beyond
            posture = self.posture if self._is_moved else None  # the last good one, if it was commanded
        self._add_without_effect(refusals, parameters.mode, q, force, posture, torque, task)
        posture = None if self._is_ignored else posture
        has_ended = force is None and pressed  # the commanding node is gone: stop pressing and stay here
        self._has_lapsed = force is None and (self._has_lapsed or has_ended)
        if posture is not None and not self._has_lapsed:
            self.posture = list(posture)
        elif has_ended or self._is_moved:
            self.posture = list(q)
        self._is_moved = posture is not None and not self._has_lapsed
        risen_force = self._rising_force(self._force, parameters.force_rate_limit * dt)
        risen_torque = self._rising_torque(self._torque, parameters.torque_rate_limit * dt)
        rising = self._rising(parameters)
        self._risen = self._risen + dt if rising else 0.0
        events = {topic: refused(topic, reason) for topic, reason in refusals.items()}
        return Commands(risen_force, risen_torque, self.posture, events, rising, self._risen)

    def _rising(self, parameters: ForceLoopParameters) -> dict[str, Value]:
        """How far force or torque are on the way to their command, nothing where they are there."""
        force, torque = self._force, self._torque
        is_of_torque = parameters.mode == "joint_torque"
        if force is not None and not is_of_torque and self._present.force != force.force:
            present, wanted, name, unit = _size(self._present), _size(force), "force_rate_limit", "N"
        elif torque is not None and is_of_torque and list(self._present_torque) != list(torque):
            present, wanted, name, unit = _largest(self._present_torque), _largest(torque), "torque_rate_limit", "N m"
        else:
            return {}
        rate = float(getattr(parameters, name))
        return {"rising": present, "rising_to": wanted, "rising_unit": unit, "rising_limit": name, "rising_rate": rate}

    def _add_without_effect(
        self,
        refusals: dict[str, str],
        mode: str,
        q: Sequence[float],
        force: ForceCommand | None,
        posture: Sequence[float] | None,
        torque: Sequence[float] | None,
        task: TaskCommand | None,
    ) -> None:
        """Refuse what is not controlled in this mode, or with this task: a force, a posture that moves, a torque."""
        joints = len(self._joints.names)
        is_of_force, is_of_torque, is_of_posture = mode != "joint_torque", mode == "joint_torque", mode == "hybrid"
        if task is not None:
            is_of_force = is_of_torque = False
            is_of_posture = len(task.axes) < joints
        self._is_ignored = not is_of_posture and posture is not None and (self._is_ignored or self._moves(posture, q))
        useless = {
            "force_command": not is_of_force and bool(_size(force)),
            "joint_posture_command": self._is_ignored,
            "joint_torque_command": not is_of_torque and bool(_largest(torque)),
        }
        for topic, is_useless in useless.items():
            if is_useless and topic not in refusals:
                other = "joint_torque" if topic == "joint_torque_command" else "hybrid"
                refusals[topic] = (
                    f"{topic} has no effect in the mode {mode}; set force_loop:mode to {other}, or end the command"
                    if task is None
                    else f"{topic} has no effect with a task of {len(task.axes)} axes on {joints} joints; end one of "
                    "them"
                )

    def _moves(self, posture: Sequence[float], q: Sequence[float]) -> bool:
        """Whether a posture is another one than before, and not where the arm is."""
        return list(posture) != self.posture and any(
            abs(a - b) > MOTION.arrived for a, b in zip(posture, q, strict=True)
        )

    def _refusal(self, commanded: float, name: str, limit: float, unit: str) -> str:
        return f"{commanded:.4g} {unit} is commanded; allowed: up to {name}, {limit:g} {unit}; {self._last}"

    def _unpinned(self, command: ForceCommand) -> str:
        """Why the torque of a command is refused: not that of its force at a position on a cover; '' if it is."""
        if not any(command.torque):
            return ""
        covers, pinned = self._covers, pinned_position(command)
        last = f"; {self._last}"
        if pinned is None or command.frame not in covers.names:
            return (
                f"torque {command.torque} N m is commanded in frame '{command.frame}'; a torque pins the position of a "
                f"force across a cover, in the frame of that cover ({', '.join(covers.names)}); send zero torque, "
                f"or such a force{last}"
            )
        cover, place = pinned
        length = covers.length_of(cover)
        own = torque_of_position(command.force, place)
        if math.dist(own, command.torque) > FORCE.cross_lever * _size(command):
            return (
                f"torque {command.torque} N m is commanded; that of the force {command.force} N about the origin of "
                f"{cover} is (0, -x fz, x fy), at the position x: send zero torque, or such a one; joint torques are "
                f"commanded on joint_torque_command{last}"
            )
        if not 0.0 <= place <= length:
            return (
                f"torque {command.torque} N m pins the force at {place:.3g} m of {cover}; allowed: 0 to {length:g} m"
                f"{last}"
            )
        return ""

    def _rising_force(self, wanted: ForceCommand | None, most: float) -> ForceCommand | None:
        if wanted is None:
            self._present = NO_FORCE
            return None
        present = self._present.force if self._present.frame == wanted.frame else ZERO
        size = math.dist(wanted.force, present)
        if size > most:
            x, y, z = (b + most / size * (a - b) for a, b in zip(wanted.force, present, strict=True))
            pinned = pinned_position(wanted)
            torque = torque_of_position((x, y, z), pinned[1]) if pinned else ZERO
            wanted = ForceCommand(wanted.frame, (x, y, z), torque)
        self._present = wanted
        return wanted

    def _rising_torque(self, wanted: Sequence[float] | None, most: float) -> Sequence[float] | None:
        if wanted is None:
            self._present_torque = [0.0] * len(self._joints.names)
            return None
        present = self._present_torque
        if any(abs(a - b) > most for a, b in zip(wanted, present, strict=True)):
            wanted = [b + min(max(a - b, -most), most) for a, b in zip(wanted, present, strict=True)]
        self._present_torque = wanted
        return wanted


def beyond(task: TaskCommand, own: ForceLoopParameters) -> str:
    """Why a task is refused: the first axis beyond a limit; '' if there is none."""
    for axis in task.axes:
        name, limit, unit = "", math.inf, ""
        if axis.kind is AxisKind.FORCE:
            name, limit, unit = "force_limit", own.force_limit, "N"
            if axis.joint >= 0:
                name, limit, unit = "torque_limit", own.torque_limit, "N m"
        elif axis.kind is AxisKind.VELOCITY:
            (limit, name), unit = own.task.fastest(axis.joint >= 0), f"{axis.unit}/s"
        elif axis.kind is AxisKind.IMPEDANCE and (reason := own.task.too_stiff(axis)):
            return reason
        if abs(axis.value or 0.0) > limit:
            size = f"{abs(axis.value or 0.0):.4g} {unit}"
            return f"{axis.name}: {size} is commanded; allowed: up to {name}, {limit:g} {unit}"
    return ""


def _size(command: ForceCommand | None) -> float:
    return math.hypot(*command.force) if command is not None else 0.0


def _largest(torque: Sequence[float] | None) -> float:
    return max(map(abs, torque)) if torque is not None else 0.0
