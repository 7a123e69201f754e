"""Whether the commanded torque of a joint is reached in the time for it."""

import math

from wam_description.number_text import brief

TOLERANCE = 0.1  # of the commanded torque, within which it is reached
UNSURE = 2.0  # standard deviations of the measured torque, by which it may be off besides


class TorqueWatch:
    """Watches the commanded torque of one joint, as `wam_control.force_hold` does the force at a point.

    A joint that nothing stops turns on until its end; nothing of that is an error before.

    Parameters
    ----------
    name : of the joint.
    """

    def __init__(self, name: str) -> None:
        self._name, self._desired, self._missed = name, 0.0, 0.0

    def step(self, desired: float, measured: float, sd: float, settling_time: float, dt: float) -> str:
        """Why the torque counts as not reached, '' where it does not: it has been off on one side for too long.

        Parameters
        ----------
        desired, measured : of the arm on the world, N m.
        sd : standard deviation of the measured torque, N m.
        settling_time : s, for which it may be off.
        dt : outer period, s.
        """
        allowed = max(TOLERANCE * abs(desired), UNSURE * sd)
        error = desired - measured
        is_other, self._desired = abs(desired - self._desired) > allowed, desired  # that takes its time again
        if is_other or not desired or abs(error) <= allowed or error * self._missed < 0.0:
            self._missed = 0.0
        if not desired or abs(error) <= allowed:
            return ""
        self._missed += math.copysign(dt, error)
        if abs(self._missed) <= settling_time:
            return ""
        what = "small" if error * desired > 0.0 else "large"
        return (
            f"{self._name}: {brief(measured + 0.0)} N m are measured and {brief(desired)} N m commanded; the torque "
            f"has been too {what} for {brief(abs(self._missed))} s: command what something that is touched can take, "
            "or another posture"
        )
