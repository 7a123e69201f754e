"""Whether the commanded torque of a joint is measured well enough, and reached in the time for it."""

import math

from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.thresholds import FORCE
from wam_description.event import OBEYED, Code, Event, warning


class TorqueWatch:
    """Watches the commanded torque of one joint, as `wam_control.force.force_hold` does the force at a point.

    A joint that nothing stops turns on until its end; nothing of that is an error before.

    Parameters
    ----------
    name : of the joint.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._report: Event | None = None
        self._off = self._side = self._within = self._uncertain = 0.0  # s

    def step(
        self,
        desired: float,
        measured: float,
        sd: float,
        parameters: ForceLoopParameters,
        dt: float,
        unknown: float = 0.0,
        payload: float = 0.0,
    ) -> Event:
        """What to do instead of what is commanded.

        Parameters
        ----------
        desired, measured : of the arm on the world, N m.
        sd : standard deviation of the measured torque, N m.
        parameters : of the force loop.
        dt : outer period, s.
        unknown, payload : torque at rest before that no touched surface gives, N m, and the mass, kg, that explains it.
        """
        allowed = max(FORCE.tolerance * abs(desired), FORCE.certain * sd)
        if abs(unknown) > allowed:
            return warning(
                Code.NOT_SENSED,
                "loaded_torque",
                axis=self._name,
                torque=unknown,
                payload=payload,
                allowed=allowed,
                desired=desired,
            )
        lasting = parameters.limits.settling_time
        if missed := self._not_reached(desired, measured, allowed, lasting, dt):
            return missed
        known = parameters.sensing.reported_fraction
        self._uncertain = self._uncertain + dt if sd > known * abs(desired) > 0.0 else 0.0
        if self._uncertain > FORCE.left_after * lasting:
            part = sd / abs(desired)
            return warning(
                Code.UNCERTAIN,
                "torque_uncertain",
                axis=self._name,
                sd=sd,
                fraction=part,
                desired=desired,
                allowed=known,
            )
        return OBEYED

    def _not_reached(self, desired: float, measured: float, allowed: float, lasting: float, dt: float) -> Event | None:
        """Why the torque counts as not reached, until it has been right for a while; None where it does not.

        The time counts on where another torque is commanded: one that varies would never be late.
        """
        error = desired - measured
        if abs(error) <= allowed:
            self._within += dt
            if self._within >= FORCE.left_after * lasting:
                self._off, self._side, self._report = 0.0, 0.0, None
            return self._report
        self._within = 0.0
        self._off += dt
        self._side += math.copysign(dt, error)
        if self._off > lasting:
            self._report = warning(
                Code.NOT_REACHED,
                "torque_off",
                axis=self._name,
                measured=measured,
                desired=desired,
                allowed=allowed,
                swings=float(abs(self._side) <= FORCE.one_sided * self._off),
                time=self._off,
            )
        return self._report
