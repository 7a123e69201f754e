"""Which commands the force loop obeys: within the limits, and not stale."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from wam_control.force_loop_parameters import ForceLoopParameters
from wam_description.arm import Joints
from wam_description.signals import ForceCommand


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
    """Keeps the last good command in place of a refused one, for as long as a command may be old.

    Parameters
    ----------
    joints : with the range of each, which a posture has to be in.

    Attributes
    ----------
    posture : joint angles to hold (n,), rad; empty before the first state.
    """

    def __init__(self, joints: Joints) -> None:
        self._joints = joints
        self.posture: list[float] = []
        self.forget()

    def forget(self) -> None:
        """Forget the commands that were in force."""
        self._force: ForceCommand | None = None
        self._force_age = 0.0
        self._torque: Sequence[float] | None = None
        self._command_stale = False

    def hold(self, q: Sequence[float]) -> None:
        """Hold these joint angles (n,), rad, until another posture is commanded."""
        self.posture = list(q)

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
            self._force_age += dt  # a refused command does not keep the one before alive
        else:
            self._force, self._force_age = force, age
        commanded = max(map(abs, torque)) if torque is not None else 0.0
        if commanded > parameters.torque_limit:
            refusals["joint_torque_command"] = _refusal(commanded, "torque_limit", parameters.torque_limit, "N m")
        else:
            self._torque = torque
        self._drop_above(parameters)
        beyond = self._beyond(posture) if posture is not None else ""
        if beyond:
            refusals["joint_posture_command"] = beyond
        admitted = self._force
        is_stale = admitted is not None and any(admitted.force) and self._force_age > parameters.command_timeout
        if is_stale:
            admitted = None
            if not self._command_stale:  # the commanding node is gone: stop pressing and stay here
                self.hold(q)
        elif posture is not None and not beyond:
            self.hold(posture)
        self._command_stale = is_stale
        return Commands(admitted, self._torque, self.posture, refusals)

    def _drop_above(self, parameters: ForceLoopParameters) -> None:
        """Drop what was admitted under a higher limit."""
        if self._force is not None and math.hypot(*self._force.force) > parameters.force_limit:
            self._force = None
        if self._torque is not None and max(map(abs, self._torque)) > parameters.torque_limit:
            self._torque = None

    def _beyond(self, posture: Sequence[float]) -> str:
        """Why a posture is refused, '' if it is not."""
        joints = self._joints
        for name, low, angle, high in zip(joints.names, joints.lower, posture, joints.upper, strict=True):
            if not low <= angle <= high:
                return (
                    f"posture of {name} is {angle:.4g} rad; allowed: {low:.4g} to {high:.4g} rad; "
                    "the last good posture remains in force"
                )
        return ""


def _refusal(commanded: float, name: str, limit: float, unit: str) -> str:
    return (
        f"{commanded:.4g} {unit} is commanded; allowed: up to {name}, {limit:g} {unit}; "
        "the last good command remains in force"
    )
