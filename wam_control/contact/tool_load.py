"""Joint torques of a mass at the tool, and the mass that the present torques mean."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from wam_control.contact.thresholds import CONTACT
from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody


class ToolLoad:
    """Joint torques per kilogram at the tool, through the filter of the observer; and the mass estimated there."""

    def __init__(self, arm: Arm, payload: tuple[float, ...]) -> None:
        n = len(arm.links.names)
        centre = (*arm.links.centre[:-3], *arm.tool)
        masses, none = (CONTACT.smallest_mass,) * (n - 1) + (1.0,), (0.0,) * (3 * n)
        links = dataclasses.replace(arm.links, mass=masses, centre=centre, inertia=none, product=none)
        self._body = RigidBody(dataclasses.replace(arm, links=links, payload=0.0))
        low, high = payload
        # the arm without payload is the rule; sd of a uniform distribution, about the smallest mass
        self.mass, self.sd = low, (high - low) / math.sqrt(3.0)
        self._payload = payload
        self.torque: list[float] = [0.0] * n
        self.reset()

    def reset(self) -> None:
        """Forget the motion, not the mass."""
        self._before: list[float] | None = None
        self._bias: list[float] = []
        self._span, self._keep, self._count = 0.0, 1.0, 0
        self.torque = [0.0] * len(self.torque)

    def observe(self, q: list[float], qd: list[float], span: float, keep: float) -> None:
        """Follow one sample of the joints, (n,) rad and rad/s."""
        self._span, self._keep, self._count = self._span + span, self._keep * keep, self._count + 1
        if self._before is not None and self._count < CONTACT.load_divisor:
            return
        span, keep, body = self._span, self._keep, self._body
        self._span, self._keep, self._count = 0.0, 1.0, 0
        momentum = (body.mass_matrix(q) @ np.array(qd)).tolist()
        bias = body.momentum_bias(q, qd).tolist()
        if self._before is None:
            self._bias, keep = bias, 0.0
        # as an external torque: that of the motors on the load, with the opposite sign
        terms = zip(self.torque, momentum, self._before or momentum, bias, self._bias, strict=True)
        self.torque = [keep * t + (1.0 - keep) * (0.5 * (b + a) - (p - o) / span) for t, p, o, b, a in terms]
        self._before, self._bias = momentum, bias

    def identify_payload(self, torques: list[float], covariance: NDArray[np.float64]) -> str:
        """Correct the mass to explain torques, (n,), N m, with covariance (n, n); '' or why that is not possible."""
        unit = np.array(self.torque)
        # the covariance includes the prior, one sd of the declared range
        gain = self.sd**2 * np.linalg.solve(covariance, unit)
        mass = self.mass + float(gain @ np.array(torques))
        low, high = self._payload
        margin = 0.1 * (high - low)
        if not low - margin <= mass <= high + margin:
            return f"the external torques mean a payload of {mass:.3g} kg; declared: {low:g} to {high:g} kg"
        self.mass = min(max(mass, low), high)
        self.sd *= math.sqrt(max(0.0, 1.0 - float(gain @ unit)))
        return ""
