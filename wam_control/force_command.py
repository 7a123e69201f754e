"""Which commands the force loop obeys: within the limits, and not stale."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from wam_control.force_loop_parameters import ForceLoopParameters
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
    """Keeps the last good command in place of one above the limits, and drops a stale force command.

    Attributes
    ----------
    posture : joint angles to hold (n,), rad; empty before the first state.
    """

    def __init__(self) -> None:
        self.posture: list[float] = []
        self._force: ForceCommand | None = None
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
    ) -> Commands:
        """Admit the commands of one outer period; arguments as those of `ForceLoop.step`."""
        refusals = {}
        commanded = math.hypot(*force.force) if force is not None else 0.0
        if commanded > parameters.force_limit:
            refusals["force_command"] = _refusal(commanded, "force_limit", parameters.force_limit, "N")
        elif force is not None and any(force.torque):
            refusals["force_command"] = (
                f"torque {force.torque} N m is commanded; send zero torque: the contact takes a force alone, joint "
                "torques are commanded on joint_torque_command; the last good command remains in force"
            )
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
            self.hold(posture)
        self._command_stale = is_stale
        return Commands(admitted, self._torque, self.posture, refusals)


def _refusal(commanded: float, name: str, limit: float, unit: str) -> str:
    return (
        f"{commanded:.4g} {unit} is commanded; allowed: up to {name}, {limit:g} {unit}; "
        "the last good command remains in force"
    )
