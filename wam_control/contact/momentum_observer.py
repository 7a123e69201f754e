"""External joint torques from the arm's generalized momentum, and their covariance.

De Luca & Mattone (2005), eq. 14-19; Haddadin, De Luca & Albu-Schaeffer (2017), section III-E.
"""

import math
from collections.abc import Sequence
from operator import add, sub
from typing import Final, NamedTuple

import numpy as np

from wam_control.contact.contact_fusion import Torques
from wam_control.contact.error_effects import ErrorEffects, FilteredMotion, GaugeEffects, LinkEffects
from wam_control.contact.model_errors import ModelErrors, Observation, TrackedError
from wam_control.contact.model_prior import model_prior
from wam_control.contact.motor_side import LinkMotion, MotorSide
from wam_control.contact.observer_parameters import ObserverParameters
from wam_control.contact.shaft_friction import LOG_DISTANCES
from wam_control.contact.thresholds import CONTACT
from wam_control.thresholds import MOTION
from wam_description.arm import Arm
from wam_description.event import Code, Event, warning
from wam_description.model import ArmModel
from wam_description.rigid_body import Array, RigidBody
from wam_description.signals import State

NO_SIGNALS: Final = np.zeros(0)


class MomentumObserver:
    """External joint torques from p = M(q) qd, without accelerations.

    dp/dt = tau + C(q, qd)^T qd - g(q) - friction + tau_ext; the residual r follows tau_ext as
    r' = (tau_ext - r) / T.  Solved exactly over a period in which the torques are constant:
    r_k = a r_(k-1) + (1 - a) ((p_k - p_(k-1)) / dt - known torques), a = exp(-dt / T).

    Motor side: q = M theta (A.5); the links move as the motors drive them through their cables (`LinkMotion`).  The
    momentum includes rotors, reflected through (A.5), and pulleys.  Coulomb friction has the sign of each motor's
    velocity, that of the joints the sign of the joint's.  Link side (joint sensors): links alone, tau is the strain
    torque, measured after the friction.  Motor torques are those that acted in the period that ends.

    The error of friction is a bias, not noise: a wrong level stays wrong in every sample, with the
    sign of the motion.  So the signed fraction of Coulomb friction, and the fraction of the time that
    a shaft is at rest, go through the same filter as the torques.  On the motor side these errors, those of
    masses and an unknown payload are tracked (`ModelErrors`).

    A dither of the motor torques (velocity loop) keeps the shafts moving: torques and fractions are
    averaged over the last `cycle` samples, one whole cycle, in which the sign of friction and
    the dither itself cancel.

    Parameters
    ----------
    arm : the arm as configured.
    parameters : the nominal model and its uncertainty.
    use_joint_sensors : whether samples are the joint sensors', else the motors'.
    cycle : samples in a cycle of the dither, 0 where there is none and with joint sensors.
    model : the identified model with its covariance, of which `arm` has the means; None for none.

    Attributes
    ----------
    body : links of the nominal model.
    age : s, since the first sample.
    seen : the instant of which torques were last given.
    """

    def __init__(
        self,
        arm: Arm,
        parameters: ObserverParameters,
        use_joint_sensors: bool,
        cycle: int = 0,
        model: ArmModel | None = None,
    ) -> None:
        parameters.require_fit(arm)
        n = self._n = arm.n
        self._parameters = parameters
        self.body = RigidBody(arm, parameters.mass_scale)
        self._side = side = MotorSide(arm, parameters, cycle > 0, model)
        self._is_link_side = use_joint_sensors
        fast, times = parameters.detection_time, [parameters.time_constant]
        if 0.0 < fast < parameters.time_constant and not use_joint_sensors and not cycle:
            times.append(fast)
        links = LinkEffects(arm, self.body, np.multiply(arm.links.mass, parameters.mass_scale))
        self._effects: GaugeEffects | ErrorEffects = (
            GaugeEffects(n, parameters, links) if use_joint_sensors else ErrorEffects(side, times, links)
        )
        prior = model_prior(arm, parameters, model, use_joint_sensors)
        self._may_carry = use_joint_sensors or prior.limit[-1] > 0.0 or parameters.payload[1] > 0.0
        noise = (parameters.motor_noise * side.friction.dynamic[:n]) ** 2
        self._errors = ModelErrors(
            prior, parameters.drift, side.map.motor_from_joint.T, noise, parameters.motor_torque_sd**2
        )
        self._filters = _Filters(n, 0 if use_joint_sensors else (9 + 2 * len(LOG_DISTANCES)) * n, times, cycle)
        self.reset()
        self.seen = self._observation()

    def reset(self) -> None:
        """Forget all samples."""
        n = self._n
        self._filters.reset()
        self._last = _Sample([0.0] * n, [0.0] * n, [], np.zeros((n, n)), [], [], None)
        self._side.reset()
        self._errors.reset()
        self.age = self._followed = 0.0
        self._span = 0.0  # s, since the last sample that was taken

    @property
    def is_ready(self) -> bool:
        """Whether enough samples came.

        Releasing the brakes gives a jolt that the model does not predict; half a cycle of a dither would look like a
        push.
        """
        settled = CONTACT.settled * self._parameters.time_constant
        return self.age > settled and self._filters.count >= max(2, 2 * self._filters.cycle)

    @property
    def q(self) -> list[float]:
        """Joint angles of the last sample, (n,), rad."""
        return self._last.q

    def observe(self, state: State, dt: float) -> bool:
        """Take one sample.

        Parameters
        ----------
        state : motors' angle, rad, velocity, rad/s, torque, N m; or joints' angle, velocity and
            strain torque with joint sensors; each (n,).
        dt : time since the sample before, s.

        Returns
        -------
        bool
            False if the sample is refused: a wrong length, a value that is not finite, dt <= 0.
            The observer stays as it was; the next good sample covers the gap.
        """
        n = self._n
        if not (0.0 < dt < math.inf):
            return False
        self._span += dt
        position, velocity, effort = state
        # of joint sensors, what follows from the sample is finite only if the sample is
        finite = self._is_link_side or math.isfinite(sum(position, 0.0) + sum(velocity, 0.0) + sum(effort, 0.0))
        if not len(position) == len(velocity) == len(effort) == n or not finite:
            return False
        if self._is_link_side:
            return self._update(position, velocity, effort, [], NO_SIGNALS, self._span)
        if self._side.carries_nothing(state):
            self.reset()
            return True
        sample = self._side.take(state, self._span)
        self._span = 0.0
        return sample is None or self._update(*sample)

    def _update(
        self, q: list[float], qd: list[float], tau: list[float], friction: list[float], signals: Array, span: float
    ) -> bool:
        """Take a sample of the joints, see `JointSample`."""
        body, at, speed, last = self.body, np.array(q), np.array(qd), self._last
        inertia, links = body.mass_matrix(at), None
        if self._is_link_side:
            momentum = inertia.dot(speed).tolist()
        else:
            rotors, driven = self._side.rotors, inertia + self._side.pulleys
            links = self._side.links(driven, speed, last.links, span)
            momentum = (links.momentum + rotors.dot(speed)).tolist()
            inertia, speed, qd = driven + rotors, links.velocity, links.velocity.tolist()
        bias = body.momentum_bias(at, speed).tolist()
        external, model, before = [0.0] * self._n, [-torque for torque in bias], qd
        if self._filters.count:
            before = last.qd
            changes, meant = map(sub, momentum, last.momentum), map(add, bias, last.bias)
            model = [change / span - 0.5 * twice for change, twice in zip(changes, meant)]  # noqa: B905
            external = list(map(sub, model, tau))
            if friction:
                resisted = map(add, friction, last.friction)
                external = [each + 0.5 * twice for each, twice in zip(external, resisted)]  # noqa: B905
        present = [*external, *model, *q, *qd, *(change / span for change in map(sub, qd, before))]
        if not math.isfinite(sum(momentum, sum(present))):
            self._span = span
            return False
        self._filters.take(present, signals, span)
        self._last, self._span = _Sample(q, qd, momentum, inertia, bias, friction, links), 0.0
        self.age += span
        return True

    def torques(self) -> tuple[Array, Array]:
        """External torques, (n,), N m, and their covariance, (n, n), N^2 m^2.

        See `ModelErrors`; from joint sensors its errors are those of masses, centres of mass and payload.
        """
        if not self._is_link_side:
            self._side.expect()
        self.seen = self._observation()
        return self._errors.external(self.seen)

    def instant(self, torques: Array) -> Torques:
        """The external torques last given, (n,), N m, with what is known of their errors."""
        return Torques(self.age, torques, *self._errors.parts(self.seen), self.seen.pose)

    def fast_torques(self) -> tuple[Array, Array] | None:
        """The same with `detection_time`, for a faster detection; None where there is none."""
        if len(self._filters.times) == 1:
            return None
        return self._errors.external(self._observation(1))

    def follow(self, statistic: float, in_contact: bool) -> None:
        """Track the errors of the model by the torques last given; `statistic` is theirs, for the detection."""
        if self.is_ready and not self._is_link_side:
            self._errors.follow(self.seen, statistic, in_contact, self.age - self._followed)
            self._followed = self.age

    @property
    def load_torques(self) -> Array | None:
        """External torques of a mass of 1 kg at the tool, (n,), N m, through the filter; None where not followed."""
        return self.seen.effects[:, -1] if self._may_carry else None

    @property
    def model_errors(self) -> dict[str, TrackedError]:
        """The errors of the model that are tracked, by name: per torque of the model, the payload in kg."""
        return {} if self._is_link_side else self._errors.by_name

    @property
    def warning(self) -> Event | None:
        """`Code.MODEL_OFF` with the part of the model that is off the most; None for none."""
        beyond = self._errors.beyond
        return warning(Code.MODEL_OFF, "model_off", part=beyond) if beyond else None

    def _observation(self, which: int = 0) -> Observation:
        """The present residual, the effects of the errors of the model on it, and the covariance of the rest."""
        return self._effects.observation(self._filters.motion(which), self._last.inertia, which, self._errors.errors)

    def zero(self, detect: float) -> str:
        """Take the torques of joint sensors at rest as those of an arm that nothing touches; '' or why not.

        Masses, centres of mass and payload are known better then, in other poses, too; worse where the torques had a
        statistic above `detect`.
        """
        if not self._is_link_side:
            error = self._errors.by_name["payload"]
            mass = self._parameters.payload[0] + error.value
            return (
                f"without joint sensors the payload is tracked while the arm moves; now {mass:.2f} +- {error.sd:.2f} kg"
            )
        if not self.is_ready:
            return "too few samples so far; try again"
        if max(map(abs, self._last.qd)) > MOTION.at_rest:
            return "the arm moves: let it come to rest"
        self.torques()
        self._errors.zero(self.seen, detect)
        return ""


class _Sample(NamedTuple):
    """The last sample that was taken.

    Attributes
    ----------
    q, qd : of the joints, (n,), rad, rad/s.
    momentum : (n,), N m s; before the first sample it is empty, as what follows but the inertia.
    inertia : (n, n), kg m^2.
    bias, friction : torques of the model, (n,), N m; friction is empty with joint sensors.
    links : as the motors drive them; None with joint sensors, and before the first sample.
    """

    q: list[float]
    qd: list[float]
    momentum: list[float]
    inertia: Array
    bias: list[float]
    friction: list[float]
    links: LinkMotion | None


class _Filters:
    """First-order filters of what a sample shows, and its mean over a cycle of a dither.

    Each number is filtered with every time constant: torques and motion in the order of `FilteredMotion`, then the
    signals of the shafts.

    Parameters
    ----------
    n : number of joints.
    signals : number of signals.
    times : time constants, s.
    cycle : samples in a cycle of the dither, 0 where there is none.

    Attributes
    ----------
    count : number of samples.
    """

    def __init__(self, n: int, signals: int, times: Sequence[float], cycle: int) -> None:
        self.times, self.cycle, self._n = times, cycle, n
        self._ring = np.zeros((cycle, 5 * n + signals))
        self._empty = [np.zeros(5 * n + signals)] * len(times)
        self.reset()

    def reset(self) -> None:
        """Forget all samples."""
        self._filtered, self.count = self._empty, 0

    def take(self, present: list[float], signals: Array, span: float) -> None:
        """Take a sample, `span` seconds after the one before; if that is long, the torques in it are unknown."""
        now, before = np.concatenate((present, signals)), self._filtered
        keeps = [math.exp(-span / time) if self.count else 0.0 for time in self.times]
        self._filtered = [keep * old + (1.0 - keep) * now for old, keep in zip(before, keeps, strict=True)]
        if self.count and span > self.times[0]:
            for filtered, old in zip(self._filtered, before, strict=True):
                filtered[: len(present)] = old[: len(present)]
        if self.cycle:
            self._ring[self.count % self.cycle] = self._filtered[0]
        self.count += 1

    def motion(self, which: int) -> FilteredMotion:
        """What was filtered with one time constant; the torque of the model without the mean over a cycle."""
        n, filtered = self._n, self._filtered[which]
        mean = self._ring[: self.count].mean(axis=0) if self.cycle and self.count else filtered
        pose, velocity, acceleration = mean[2 * n : 3 * n], mean[3 * n : 4 * n], mean[4 * n : 5 * n]
        return FilteredMotion(mean[:n], filtered[n : 2 * n], pose, velocity, acceleration, mean[5 * n :])
