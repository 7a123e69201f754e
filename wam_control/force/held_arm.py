"""What pushes an arm in all: it gives way, and no further than allowed."""

import math
from collections.abc import Sequence

import numpy as np

from wam_control.force.axes import CommandedAxis
from wam_control.force.force_axis import Angles
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.limits import certain_size, largest_lever, lever_of, likeliest_link
from wam_control.force.problem import VelocityRow
from wam_control.force.thresholds import FORCE
from wam_description.event import Code, Event, warning
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
        levers = self._levers(q, axes, torques, contact, chi2) if certain else [math.inf]
        hardest = certain / min(levers)  # the least force that explains what is certain
        # a commanded force that was allowed, and falls, is no push
        fade = dt / (FORCE.quarter * own.limits.settling_time + dt)
        allowed = max(bound[0], self._allowed * (1.0 - fade))
        self._allowed = allowed if is_pressing else 0.0
        if hardest > allowed:
            self._since = 0.0
            if not is_bouncing or hardest > own.limits.contact_force:
                self.event = warning(Code.PUSHED, "pushed", force=hardest, allowed=bound[0], limit=bound[1])
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
        # no faster against it than a force law allows up to this force, and above it away from it; with the gain of the
        # longest lever, since what pushes may be anywhere
        away = gain * (certain - allowed * min(levers)) / max(levers) ** 2
        return [VelocityRow(along, min(away, fastest))]

    def _levers(
        self, q: Angles, axes: Sequence[CommandedAxis], torques: Array, contact: Contact, chi2: float
    ) -> list[float]:
        """Largest torque per force, m: at the one known force, at the estimated contact, or wherever else it may push.

        Without a position, that is at the tool, and at the end of a known link where it takes the least force.
        """
        body, places = self._body, {axis.place[:2] for axis in axes if axis.place and axis.place.is_known}
        cover, position = places.pop() if len(places) == 1 else contact[:2]
        if not math.isnan(position):
            levers = [largest_lever(body.point_jacobian(q, cover, (position, 0.0, 0.0)))]
        else:
            levers = [largest_lever(body.tool_jacobian(q))]
            if cover:
                ends = (body.point_jacobian(q, cover, (x, 0.0, 0.0)) for x in (0.0, body.arm.covers.length_of(cover)))
                levers.append(max(lever_of(jacobian, torques) for jacobian in ends))
        if chi2 > FORCE.unexplained:  # they may all be those of a push on the link that explains them best
            levers.append(largest_lever(likeliest_link(body, q, torques)))
        return levers
