"""Whether the commanded torque of a joint is measured well enough, and reached in the time for it."""

import math

from wam_control.force.force_hold import UNLOAD, ForceReaction, Found
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.thresholds import FORCE
from wam_description.number_text import brief


class TorqueWatch:
    """Watches the commanded torque of one joint, as `wam_control.force.force_hold` does the force at a point.

    A joint that nothing stops turns on until its end; nothing of that is an error before.

    Parameters
    ----------
    name : of the joint.
    """

    def __init__(self, name: str) -> None:
        self._name, self._report = name, ""
        self._off = self._side = self._within = self._uncertain = 0.0  # s

    def step(
        self,
        desired: float,
        measured: float,
        sd: float,
        parameters: ForceLoopParameters,
        dt: float,
        unknown: float = 0.0,
        meaning: str = "",
    ) -> Found:
        """What to do instead of what is commanded, and why.

        Parameters
        ----------
        desired, measured : of the arm on the world, N m.
        sd : standard deviation of the measured torque, N m.
        parameters : of the force loop.
        dt : outer period, s.
        unknown, meaning : torque at rest before that no touched surface gives, N m, and what it means.
        """
        allowed = max(FORCE.tolerance * abs(desired), FORCE.certain * sd)
        if abs(unknown) > allowed:
            return ForceReaction.NOT_SENSED, (
                f"{self._name}: the arm at rest already measures {brief(unknown)} N m, {meaning}; allowed: "
                f"{brief(allowed)} N m for {brief(desired)} N m; {UNLOAD}"
            )
        lasting = parameters.limits.settling_time
        if missed := self._not_reached(desired, measured, allowed, lasting, dt):
            return ForceReaction.NOT_REACHED, missed
        known = parameters.sensing.reported_fraction
        self._uncertain = self._uncertain + dt if sd > known * abs(desired) > 0.0 else 0.0
        if self._uncertain > FORCE.left_after * lasting:
            return ForceReaction.UNCERTAIN, (
                f"{self._name}: the torque is known to +-{brief(sd)} N m, {sd / abs(desired):.0%} of the commanded "
                f"{brief(desired)} N m; sensing.reported_fraction, {known:.0%}, is to be known: use joint sensors, or "
                "command more torque"
            )
        return ForceReaction.NONE, ""

    def _not_reached(self, desired: float, measured: float, allowed: float, lasting: float, dt: float) -> str:
        """Why the torque counts as not reached, until it has been right for a while; '' where it does not.

        The time counts on where another torque is commanded: one that varies would never be late.
        """
        error = desired - measured
        if abs(error) <= allowed:
            self._within += dt
            if self._within >= FORCE.left_after * lasting:
                self._off, self._side, self._report = 0.0, 0.0, ""
            return self._report
        self._within = 0.0
        self._off += dt
        self._side += math.copysign(dt, error)
        if self._off > lasting:
            swings = "" if abs(self._side) > FORCE.one_sided * self._off else ", to both sides"
            self._report = (
                f"{self._name}: {brief(measured)} N m are measured and {brief(desired)} N m commanded; the "
                f"torque has been off by more than {brief(allowed)} N m{swings} for {brief(self._off)} s: command what "
                "something that is touched can take, or another posture, or, where it swings, lower torque_gain"
            )
        return self._report
