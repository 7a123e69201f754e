"""Joint torques of a mass at the tool."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wam_control.contact.thresholds import CONTACT
from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody

Array = NDArray[np.float64]


class ToolLoad:
    """External torques of a mass of 1 kg at the tool, through the filters of the observer.

    They are computed when they are needed, so that they are as late as the residual.

    Parameters
    ----------
    arm : the arm as modelled.
    times : time constants of the filters, s.
    """

    def __init__(self, arm: Arm, times: Sequence[float]) -> None:
        n = len(arm.links.names)
        centre = (*arm.links.centre[:-3], *arm.tool)
        masses, none = (CONTACT.smallest_mass,) * (n - 1) + (1.0,), (0.0,) * (3 * n)
        links = dataclasses.replace(arm.links, mass=masses, centre=centre, inertia=none, product=none)
        self._body = RigidBody(dataclasses.replace(arm, links=links, payload=0.0))
        self._times, self._nothing = np.array(times)[:, None], np.zeros((len(times), n))
        self.reset()

    def reset(self) -> None:
        """Forget the motion."""
        self._torques, self._span = self._nothing, 0.0
        self._before: tuple[Array, Array] | None = None
        self._now: tuple[list[float], list[float]] = [], []

    def observe(self, q: list[float], qd: list[float], span: float) -> None:
        """Follow one sample of the joints, (n,) rad and rad/s, `span` seconds after the one before."""
        self._now, self._span = (q, qd), self._span + span
        if self._before is None or self._span > CONTACT.load_span * self._times[0, 0]:
            self.torques()

    def torques(self) -> Array:
        """The torques, (filters, n), N m."""
        if self._span > 0.0:
            q, qd = self._now
            momentum, bias = self._body.mass_matrix(q) @ np.array(qd), self._body.momentum_bias(q, qd)
            before, mean = self._before or (momentum, bias)
            keep = np.exp(-self._span / self._times) if self._before else 0.0
            # as an external torque: that of the motors on the load, with the opposite sign
            torque = 0.5 * (bias + mean) - (momentum - before) / self._span
            self._torques = keep * self._torques + (1.0 - keep) * torque
            self._before, self._span = (momentum, bias), 0.0
        return self._torques
