"""Which commands the force loop obeys: within the limits, and not stale."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from wam_control.force_loop_parameters import ForceLoopParameters
from wam_description.arm import Joints
from wam_description.signals import ForceCommand

NO_FORCE = ForceCommand("", (0.0, 0.0, 0.0))


class Commands(NamedTuple):
    """What the force loop has to do in one period.

    Attributes
    ----------
    force : commanded force; None where there is none or it is stale.
    torque : commanded joint torques of the arm on the world (n,), N m; None where there are none.
    posture : joint angles to hold (n,), rad.
    refusals : why a command of this period is not taken, by topic.
    """

    force: ForceCommand | None
    torque: Sequence[float] | None
    posture: list[float]
    refusals: dict[str, str]


class CommandAdmission:
    """Keeps the last good command in place of one beyond the limits, and drops a stale force command.

    Force and torque follow their commands no faster than their rate limits; a force in another frame begins at zero.

    Parameters
    ----------
    joints : of the arm, with their limits.

    Attributes
    ----------
    posture : joint angles to hold (n,), rad; empty before the first state.
    """

    def __init__(self, joints: Joints) -> None:
        self._joints = joints
        self.posture: list[float] = []
        self._present = NO_FORCE
        self._present_torque: Sequence[float] = [0.0] * len(joints.names)
        self._force: ForceCommand | None = None
        self._torque: Sequence[float] | None = None
        self._command_stale = False

    def hold(self, q: Sequence[float]) -> None:
        """Hold these joint angles (n,), rad, until another posture is commanded."""
        self.posture = list(q)

    def restart(self, q: Sequence[float]) -> None:
        """Hold these joint angles (n,), rad; force and torque begin at zero."""
        self.hold(q)
        self._rising_force(None, 0.0)
        self._rising_torque(None, 0.0)

    def step(
        self,
        parameters: ForceLoopParameters,
        q: Sequence[float],
        force: ForceCommand | None,
        age: float,
        posture: Sequence[float] | None,
        torque: Sequence[float] | None,
        dt: float,
    ) -> Commands:
        """Admit the commands of one outer period; arguments as those of `ForceLoop.step`."""
        refusals = {}
        commanded = math.hypot(*force.force) if force is not None else 0.0
        if commanded > parameters.force_limit:
            refusals["force_command"] = _refusal(commanded, "force_limit", parameters.force_limit, "N")
        else:
            self._force = force
        commanded = max(map(abs, torque)) if torque is not None else 0.0
        if commanded > parameters.torque_limit:
            refusals["joint_torque_command"] = _refusal(commanded, "torque_limit", parameters.torque_limit, "N m")
        else:
            self._torque = torque
        admitted = self._force
        is_stale = admitted is not None and any(admitted.force) and age > parameters.command_timeout
        if is_stale:
            admitted = None
            if not self._command_stale:  # the commanding node is gone: stop pressing and stay here
                self.hold(q)
        elif posture is not None:
            if beyond := self._beyond(posture):
                refusals["joint_posture_command"] = beyond
            else:
                self.hold(posture)
        self._command_stale = is_stale
        return Commands(
            self._rising_force(admitted, parameters.force_rate_limit * dt),
            self._rising_torque(self._torque, parameters.torque_rate_limit * dt),
            self.posture,
            refusals,
        )

    def _beyond(self, posture: Sequence[float]) -> str:
        """Why a posture is refused: the first joint beyond its limits; '' if there is none."""
        joints = self._joints
        for name, angle, low, high in zip(joints.names, posture, joints.lower, joints.upper, strict=True):
            if not low <= angle <= high:
                return (
                    f"{name} is to be at {angle:.4g} rad; allowed: {low:.4g} to {high:.4g} rad; "
                    "the last good posture remains in force"
                )
        return ""

    def _rising_force(self, wanted: ForceCommand | None, most: float) -> ForceCommand | None:
        if wanted is None:
            self._present = NO_FORCE
            return None
        present = self._present.force if self._present.frame == wanted.frame else (0.0, 0.0, 0.0)
        change = [a - b for a, b in zip(wanted.force, present, strict=True)]
        size = math.hypot(*change)
        if size > most:
            x, y, z = (b + most / size * step for b, step in zip(present, change, strict=True))
            wanted = ForceCommand(wanted.frame, (x, y, z))
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


def _refusal(commanded: float, name: str, limit: float, unit: str) -> str:
    return (
        f"{commanded:.4g} {unit} is commanded; allowed: up to {name}, {limit:g} {unit}; "
        "the last good command remains in force"
    )
