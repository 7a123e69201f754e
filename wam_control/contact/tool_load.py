"""Joint torques of a mass at the tool."""

import dataclasses

import numpy as np

from wam_control.contact.thresholds import CONTACT
from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody


class ToolLoad:
    """Joint torques per kilogram at the tool, through the filter of the observer."""

    def __init__(self, arm: Arm) -> None:
        n = len(arm.links.names)
        centre = (*arm.links.centre[:-3], *arm.tool)
        masses, none = (CONTACT.smallest_mass,) * (n - 1) + (1.0,), (0.0,) * (3 * n)
        links = dataclasses.replace(arm.links, mass=masses, centre=centre, inertia=none, product=none)
        self._body = RigidBody(dataclasses.replace(arm, links=links, payload=0.0))
        self.torque: list[float] = [0.0] * n
        self.reset()

    def reset(self) -> None:
        """Forget the motion."""
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
