"""Bumpless transfer: the commanded velocity does not jump where the control law changes."""

import math
from collections.abc import Sequence


class BumplessTransfer:
    """Adds the jump of the law's velocity as an offset that decays exponentially."""

    def __init__(self, joints: int) -> None:
        self._zero = [0.0] * joints
        self.reset()

    def reset(self) -> None:
        """Start again from rest."""
        self._offset = self._commanded = self._zero
        self._is_due = True

    def restart(self) -> None:
        """Transfer from the commanded velocity to whatever the law gives in the next step."""
        self._is_due = True

    def step(self, velocity: list[float], measured: Sequence[float], time_constant: float, dt: float) -> list[float]:
        """Velocity to command.

        Parameters
        ----------
        velocity : of the law (n,), rad/s; empty for torque only.
        measured : joint velocities (n,), rad/s, from which the transfer starts after torque only.
        time_constant : of the decay, s; 0 for no transfer.
        dt : outer period, s.
        """
        if not velocity or not time_constant:
            self._offset = self._zero
        elif self._is_due:
            self._offset = [a - b for a, b in zip(self._commanded or measured, velocity, strict=True)]
        elif any(self._offset):
            decay = math.exp(-dt / time_constant)
            self._offset = [decay * offset for offset in self._offset]
        self._is_due = False
        if any(self._offset):
            velocity = [a + b for a, b in zip(velocity, self._offset, strict=True)]
        self._commanded = velocity
        return velocity
