"""What pushes an arm in all: it gives way, and no further than allowed."""

import math
from collections.abc import Sequence

import numpy as np

from wam_control.force.axes import CommandedAxis
from wam_control.force.force_axis import Angles
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.limits import certain_size, largest_lever, likeliest_link
from wam_control.force.problem import VelocityRow
from wam_control.force.thresholds import FORCE
from wam_description.event import Code, Event, Value, warning
from wam_description.rigid_body import Array, RigidBody
from wam_description.signals import Contact
from wam_description.small_matrices import length


class PushedArm:
    """A push above the limit: the arm does not move against it, and gives way to it.

    Parameters
    ----------
    body : kinematics of the arm.

    Attributes
    ----------
    event : while it is pushed, and for some time after.
    """

    def __init__(self, body: RigidBody) -> None:
        self._body = body
        self.restart()

    def restart(self) -> None:
        """Nothing pushes."""
        self.event: Event | None = None
        self._since = math.inf  # s, since the last time
        self._allowed = 0.0  # N
        self._from = np.zeros(3)  # m, of the tool, where the push began

    @property
    def is_yielding(self) -> bool:
        """Whether it is pushed or hit, or was a short time ago."""
        return self._since <= FORCE.lasting

    def step(
        self,
        q: Angles,
        axes: Sequence[CommandedAxis],
        torques: Array,
        torque_sd: Array,
        contact: Contact,
        chi2: float,
        bound: tuple[float, str],
        is_pressing: bool,
        is_bouncing: bool,
        gain: float,
        own: ForceLoopParameters,
        dt: float,
    ) -> list[VelocityRow]:
        """One-sided rows of one period.

        Parameters
        ----------
        q : joint angles (n,), rad.
        axes : of the commanded forces of points.
        torques, torque_sd : of the world on the joints (n,), N m, free of the arm's own motion, and of each its sd.
        contact : estimated.
        chi2 : of the torques that the commanded forces do not explain.
        bound : force, N, up to which nothing gives way, and what sets it.
        is_pressing : whether the commanded force presses on something.
        is_bouncing : whether it has only just touched it; this impact is no push up to `limits.contact_force`.
        gain : of the force law, m/s/N.
        own : parameters of the force loop.
        dt : s.
        """
        self._since += dt
        is_new = self._since > own.limits.settling_time
        certain = certain_size(torques, torque_sd)
        jacobians = [self._jacobian(q, axes, contact)] if certain else []
        if certain and chi2 > FORCE.unexplained:  # they may all be those of a push on the link that explains them best
            jacobians.append(likeliest_link(self._body, q, torques))
        levers = [largest_lever(jacobian) for jacobian in jacobians]
        hardest = certain / min(levers) if certain else 0.0  # the least force that explains what is certain
        # a commanded force that was allowed, and falls, is no push
        fade = dt / (FORCE.quarter * own.limits.settling_time + dt)
        allowed = max(bound[0], self._allowed * (1.0 - fade))
        self._allowed = allowed if is_pressing else 0.0
        if hardest > allowed:
            self._since = 0.0
            if not is_bouncing or hardest > own.limits.contact_force:
                values: dict[str, Value] = {"force": hardest, "allowed": bound[0], "limit": bound[1]}
                self.event = warning(Code.PUSHED, "pushed", **values)
        elif self._since > FORCE.lasting:
            self.event = None
        if not certain:
            return []
        tool = self._body.tool_pose(q).position
        if is_new:
            self._from = tool
        if length(tool - self._from) > own.limits.free_travel:
            return []
        along, fastest = torques / length(torques), own.joint_speed_limit
        # no faster against it than a force law allows up to this force, and above it away from it
        return [VelocityRow(along, min(gain * (certain / lever - allowed) / lever, fastest)) for lever in levers]

    def _jacobian(self, q: Angles, axes: Sequence[CommandedAxis], contact: Contact) -> Array:
        """Of where the arm is pushed (3, n): at the one known force, at the estimated contact, or at the tool."""
        places = {axis.place[:2] for axis in axes if axis.place and axis.place.is_known}
        if len(places) == 1:
            cover, position = places.pop()
        elif contact.cover and not math.isnan(contact.position):
            cover, position = contact.cover, contact.position
        else:
            return self._body.tool_jacobian(q)
        return self._body.point_jacobian(q, cover, (position, 0.0, 0.0))
