"""When the force loop holds its position instead of controlling the commanded force, and why."""

import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from wam_control.contact_position import ForcePoint
from wam_control.force_axis import ForceAxis
from wam_control.force_loop_parameters import ForceLoopParameters

Array = NDArray[np.float64]
TOLERANCE = 0.1  # of the commanded force, within which it is reached, and at least LEAST
LEAST = 0.3  # N
TOUCH = 0.2  # of the commanded force, from which something is touched
UNEXPLAINED = 16.0  # chi^2 of torques above which they are not those of the commanded force
CONFLICT = 0.1  # s, after which another contact counts
FADING = 0.2  # of the time without it, by which that with it is reduced: a link that bounces is touched
RESUME = 0.8  # of the largest standard deviation, below which a force is controlled again


class ForceReaction(IntEnum):
    """What the force loop does instead of what is commanded, as a number for a topic."""

    NONE = 0  # the command is obeyed
    NOT_SENSED = 1  # holds: the commanded force cannot be measured here
    OTHER_LINK = 2  # holds: another link is touched
    NOTHING_TOUCHED = 3  # holds: it has gone as far as allowed and nothing was touched
    CONTACT_FORCE = 4  # does not move against the world
    JOINT_END = 5  # a joint is at its end
    NOT_REACHED = 6  # goes on: the force is not reached within the time for it
    PLACE_ASSUMED = 7  # goes on: where the force acts is not known well, and not pinned

    @property
    def holds(self) -> bool:
        """Whether the arm holds its position instead of controlling the force."""
        return self in (ForceReaction.NOT_SENSED, ForceReaction.OTHER_LINK, ForceReaction.NOTHING_TOUCHED)


class ForceHold:
    """Watches one commanded force."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Another force is commanded."""
        self._is_sensed, self._is_touching = True, False
        self._travel = self._conflict = self._missed = self._assumed = 0.0

    def approach_speed(self, axis: ForceAxis, desired: float, parameters: ForceLoopParameters) -> float:
        """Largest speed along the force, m/s: until something is touched, v = F_max/sqrt(m k_c) after (3.1)."""
        if self._is_touching or not parameters.limits.impact:
            return math.inf
        largest = parameters.limits.impact * desired
        return largest / math.sqrt(axis.impact_mass * parameters.guard.contact_stiffness)

    def travel(self, distance: float) -> None:
        """Count a way along the force, m."""
        self._travel += distance

    def step(
        self,
        axis: ForceAxis,
        point: ForcePoint,
        external: Array,
        measured: float,
        desired: float,
        parameters: ForceLoopParameters,
        dt: float,
    ) -> tuple[ForceReaction, str]:
        """Whether to hold, and why.

        Parameters
        ----------
        axis : of the commanded force.
        point : where it acts.
        external : torques of the world on the joints (n,), N m.
        measured, desired : force along it, N.
        parameters : of the force loop.
        dt : outer period, s.
        """
        limit = parameters.sensing.sd_limit(desired)
        self._is_sensed = axis.force_sd <= (limit if self._is_sensed else RESUME * limit)
        self._is_touching = measured >= TOUCH * desired
        if self._is_touching:
            self._travel = 0.0
        # tangential forces grow with the force
        unexplained = axis.unexplained(external) / max(1.0, measured / desired) ** 2 if point.conflict else 0.0
        lasting = self._conflict + (dt if unexplained > UNEXPLAINED else -FADING * dt)
        self._conflict = min(max(lasting, 0.0), 2.0 * CONFLICT)
        if self._conflict > CONFLICT:
            other = point.conflict or "another link was touched"
            return ForceReaction.OTHER_LINK, f"{other}; the arm holds its position"
        if not self._is_sensed:
            return ForceReaction.NOT_SENSED, (
                f"the force is measured with a standard deviation of {axis.force_sd:.3g} N at {point.position:.3g} m "
                f"of {point.cover}; allowed: {limit:g} N (sensing.force_sd_limit, force_sd_fraction); the arm holds "
                "its position: bend the arm, or command another direction or place"
            )
        if self._travel > parameters.limits.free_travel:
            return ForceReaction.NOTHING_TOUCHED, (
                f"the arm has moved {self._travel:.3g} m along the force and nothing is touched; allowed: "
                f"limits.free_travel, {parameters.limits.free_travel:g} m; the arm holds its position: command no "
                "force, then again"
            )
        error = desired - measured
        # an error of either sign all the time; one that changes its sign follows a command or a surface that moves
        if abs(error) <= max(TOLERANCE * desired, LEAST) or error * self._missed < 0.0:
            self._missed = 0.0
        self._missed += math.copysign(dt, error)
        if abs(self._missed) > parameters.limits.settling_time:
            return ForceReaction.NOT_REACHED, (
                f"{measured:.3g} N are measured and {desired:.3g} N commanded, for {abs(self._missed):.2g} s; the arm "
                f"moves with {axis.speed_fraction:.2g} of the commanded speed here: command what can be reached, "
                "another direction, or bend the arm"
            )
        self._assumed = self._assumed + dt if self._is_touching and point.is_assumed else 0.0
        if self._assumed > parameters.limits.settling_time:
            return ForceReaction.PLACE_ASSUMED, (
                f"something is touched and it is not known where; {point.position:.3g} m of {point.cover} is assumed "
                "(contact_cover, contact_position), and the force is as wrong as that; pin it by the torque of the "
                "command, or set contact_source to pinned"
            )
        return ForceReaction.NONE, ""
