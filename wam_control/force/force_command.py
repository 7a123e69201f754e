"""Which commands the force loop obeys: within the limits; what it does where one ends."""

import math
from collections.abc import Sequence

from wam_control.force.contact_place import pinned_position, torque_of_position
from wam_control.force.force_input import ForceInput
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.task import AxisKind, TaskCommand
from wam_control.force.thresholds import FORCE
from wam_control.thresholds import MOTION
from wam_description.arm import Covers
from wam_description.event import Event, refused
from wam_description.parts import Joints
from wam_description.signals import ZERO, ForceCommand


class CommandAdmission:
    """Admits commands within the limits; instead of others the last good one is used, or the arm stays where it is.

    The last good force is used for a time, unless it is above the limit by now.

    Parameters
    ----------
    joints : of the arm, with their limits.
    covers : of the arm, with their lengths.
    command_age : time for which the last good command counts while others are refused, s.

    Attributes
    ----------
    force : that is used; None where there is none.
    posture : joint angles to hold (n,), rad; empty before the first state.
    refusals : why a command of this period is not taken, by topic.
    """

    def __init__(self, joints: Joints, covers: Covers, command_age: float) -> None:
        self._joints, self._covers = joints, covers
        self._command_age = command_age
        self.restart([])

    def restart(self, q: Sequence[float]) -> None:
        """Hold these joint angles (n,), rad, until another posture is commanded; forget every command."""
        self.force: ForceCommand | None = None
        self.refusals = dict[str, Event]()
        self._age = 0.0
        self._is_moved = self._has_lapsed = self._is_ignored = False
        self.posture = list(q)

    def step(self, own: ForceLoopParameters, given: ForceInput) -> None:
        """Admit the commands of one outer period."""
        before, self.refusals = self.force, {}
        force, posture, q = given.command, given.posture, given.joints.position
        if force is not None and 0.0 < _size(force) < MOTION.rounding:
            force = force._replace(force=ZERO)
        reason = _excess(_size(force), "force_limit", own.force_limit, "N") or self._unpinned(force)
        self._age = self._age + given.dt if reason else 0.0
        if not reason:
            self.force = force
        else:
            self._refuse("force_command", f"{reason}; the last good command remains in use for {self._command_age:g} s")
            if self._age > self._command_age or _size(self.force) > own.force_limit:
                self.force = None
            if self.force is None:
                force = None
        if posture is not None and (beyond := self._joints.beyond(posture)):
            self._refuse("joint_posture_command", f"{beyond}; the last good posture remains in use")
            posture = self.posture if self._is_moved else None  # the last good one, if it was commanded
        self._refuse_without_effect(own.mode, given, force, posture)
        posture = None if self._is_ignored else posture
        has_ended = force is None and bool(_size(before))  # the commanding node is gone: stop pressing and stay here
        self._has_lapsed = force is None and (self._has_lapsed or has_ended)
        if posture is not None and not self._has_lapsed:
            self.posture = list(posture)
        elif has_ended or self._is_moved:
            self.posture = list(q)
        self._is_moved = posture is not None and not self._has_lapsed

    def _refuse(self, topic: str, reason: str) -> None:
        self.refusals[topic] = refused(topic, reason)

    def _refuse_without_effect(
        self, mode: str, given: ForceInput, force: ForceCommand | None, posture: Sequence[float] | None
    ) -> None:
        """Refuse what has no effect in this mode, or with this task: a force, a posture that moves, a torque."""
        joints, task, q = len(self._joints.names), given.task, given.joints.position
        is_of_posture = mode == "hybrid" if task is None else len(task.axes) < joints
        self._is_ignored = not is_of_posture and posture is not None and (self._is_ignored or self._moves(posture, q))
        useless = (
            ("force_command", task is not None and bool(_size(force))),
            ("joint_posture_command", self._is_ignored),
            ("joint_torque_command", given.torque is not None),
        )
        for topic, is_useless in useless:
            if is_useless and topic not in self.refusals:
                reason = f"in the mode {mode}; set force_loop:mode to hybrid, or end the command"
                if task is not None:
                    reason = f"with a task of {len(task.axes)} axes on {joints} joints; end one of them"
                self._refuse(topic, f"{topic} has no effect {reason}")

    def _moves(self, posture: Sequence[float], q: Sequence[float]) -> bool:
        """Whether a posture is another one than before, and not where the arm is."""
        return list(posture) != self.posture and any(
            abs(a - b) > MOTION.arrived for a, b in zip(posture, q, strict=True)
        )

    def _unpinned(self, command: ForceCommand | None) -> str:
        """Why the torque of a command is refused: not that of its force at a position on a cover; '' if it is."""
        if command is None or not any(command.torque):
            return ""
        covers, pinned = self._covers, pinned_position(command)
        if pinned is None or command.frame not in covers.names:
            return (
                f"torque {command.torque} N m is commanded in frame '{command.frame}'; a torque pins the position of "
                f"a force across a cover: send both in its frame ({', '.join(covers.names)}), or zero torque"
            )
        cover, place = pinned
        length = covers.length_of(cover)
        own = torque_of_position(command.force, place)
        if math.dist(own, command.torque) > FORCE.least_lever * _size(command):
            return (
                f"torque {command.torque} N m is commanded with the force {command.force} N on {cover}; allowed: zero, "
                f"or (0, -x fz, x fy) for the contact position x; send joint torques on joint_torque_command"
            )
        if not 0.0 <= place <= length:
            where = f"{place:.3g} m along {cover}; allowed: 0 to {length:g} m"
            return f"torque {command.torque} N m pins the force at {where}"
        return ""


def beyond(task: TaskCommand, own: ForceLoopParameters) -> str:
    """Why a task is refused: the first axis beyond a limit; '' if there is none."""
    for axis in task.axes:
        name, limit, unit = "", math.inf, ""
        if axis.is_force:
            name, limit, unit = "force_limit", own.force_limit, "N"
            if axis.is_joint:
                name, limit, unit = "torque_limit", own.torque_limit, "N m"
        elif axis.kind is AxisKind.VELOCITY:
            (limit, name), unit = own.task.fastest(axis.is_joint), f"{axis.unit}/s"
        elif axis.kind is AxisKind.IMPEDANCE and (reason := own.task.too_stiff(axis)):
            return reason
        if reason := _excess(abs(axis.value or 0.0), name, limit, unit):
            return f"{axis.name}: {reason}"
    return ""


def _excess(commanded: float, name: str, limit: float, unit: str) -> str:
    """Why a command is beyond a limit, '' where it is not."""
    if commanded <= limit:
        return ""
    return f"{commanded:.4g} {unit} is commanded; allowed: up to {name}, {limit:g} {unit}"


def _size(command: ForceCommand | None) -> float:
    return math.hypot(*command.force) if command is not None else 0.0
