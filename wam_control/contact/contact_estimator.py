"""Contact estimation: momentum observer, detection and inference together."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from wam_control.contact.contact_inference import NO_HYPOTHESIS, ContactInference, Hypothesis, detection_statistic
from wam_control.contact.inference_parameters import InferenceParameters
from wam_control.contact.model_errors import TrackedError
from wam_control.contact.momentum_observer import MomentumObserver
from wam_control.contact.observer_parameters import ObserverParameters
from wam_control.contact.thresholds import CONTACT
from wam_control.thresholds import MOTION
from wam_description.arm import Arm, Timing
from wam_description.event import Event
from wam_description.model import ArmModel
from wam_description.parameters import parameter, require
from wam_description.reasons import NO_REASON, Reason
from wam_description.rigid_body import Array
from wam_description.signals import State
from wam_description.small_matrices import inverse


@dataclass(frozen=True)
class ContactEstimatorParameters:
    """Parameters of the contact estimator."""

    observer: ObserverParameters
    inference: InferenceParameters
    use_joint_sensors: bool = parameter("observe the joint sensors instead of the motors alone")
    detect: float = parameter(
        "value of r^T S^-1 r (see docs/estimator.md); a contact is detected above it in two outer periods, or above "
        "twice this value in one",
        high=1e6,
    )
    release: float = parameter("value of r^T S^-1 r below which the contact has ended", high=1e6)

    def __post_init__(self) -> None:
        require(
            self.release <= self.detect,
            f"parameter 'release' is {self.release:g}; it must not be above detect, {self.detect:g}",
        )


class ContactEstimate(NamedTuple):
    """External torques, and the contact that explains them.

    Attributes
    ----------
    external_torques : (n,), torques of the world on the joints, N m.
    torque_sd : (n,), their standard deviations, N m.
    statistic : r^T S^-1 r of the external torques, or, scaled, of a faster estimate of them where that is larger.
    hypotheses : every explanation, the most probable first, empty without contact.
    reasons : why the position is NaN, the estimate not reliable, or why there is none.
    warning : `Code.MODEL_OFF` with the part of the model that is off; None for none.
    """

    external_torques: tuple[float, ...]
    torque_sd: tuple[float, ...]
    statistic: float
    hypotheses: tuple[Hypothesis, ...] = ()
    reasons: Reason = NO_REASON
    warning: Event | None = None

    @property
    def in_contact(self) -> bool:
        """Whether a contact is detected."""
        return bool(self.hypotheses)

    @property
    def best(self) -> Hypothesis:
        """The most probable explanation; `NO_HYPOTHESIS` without contact."""
        return self.hypotheses[0] if self.hypotheses else NO_HYPOTHESIS


class ContactEstimator:
    """Observes at the inner rate, estimates contacts at the outer one.

    Parameters
    ----------
    arm : the arm as configured; the observer's model differs from it by its own factors.
    timing : periods of the loops; the observer's time constant must cover two inner periods.
    parameters : of observer, detection and inference.
    model : the identified model of the arm with its covariance, None for none.

    Raises
    ------
    ParameterError
        where joint sensors are to be used and the arm has none, or parameters do not fit each other.
    """

    def __init__(
        self, arm: Arm, timing: Timing, parameters: ContactEstimatorParameters, model: ArmModel | None = None
    ) -> None:
        require(
            arm.joint_sensors or not parameters.use_joint_sensors,
            "parameter 'use_joint_sensors' is true but arm.joint_sensors is false; set it to false",
        )
        require(
            parameters.observer.time_constant >= 2.0 * timing.period,
            f"parameter 'observer.time_constant' is {parameters.observer.time_constant:g} s; "
            f"it must be at least two periods, {2.0 * timing.period:g} s",
        )
        self._parameters = parameters
        cycle = 0 if parameters.use_joint_sensors else timing.dither_cycle
        self._observer = MomentumObserver(arm, parameters.observer, parameters.use_joint_sensors, cycle, model)
        self._delay = parameters.observer.time_constant + 0.5 * cycle * timing.period  # s, of the torques
        self._inference = ContactInference(arm, self._observer.body, parameters.inference)
        self._is_blind = False
        self._pressed_at: list[float] = []  # rad, where the arm presses or last pressed; empty once it has left
        self._forget()

    def brake(self, on: bool) -> None:
        """Set whether brakes hold the motors, whose torques then carry no information."""
        self._is_blind = on and not self._parameters.use_joint_sensors

    def zero(self) -> str:
        """Take the present torques of joint sensors as those of an arm at rest that nothing touches; '' or why not.

        The earlier torques of a contact are forgotten: they were measured with another zero.
        """
        reason = self._observer.zero(self._parameters.detect)
        if not reason:
            self._inference.fusion.reset()
        return reason

    def reset(self) -> None:
        """Forget all samples."""
        self._observer.reset()
        self._forget()

    def _forget(self) -> None:
        """Forget what was estimated."""
        self._in_contact = self._is_above = False
        self._ended = -math.inf  # by the age of the observer, s
        # of the estimates at the last two ages: age of the observer, s, and torques, N m
        none: tuple[float, Array | None] = 0.0, None
        self._before = self._last = none
        self._inference.fusion.reset()

    def observe(self, motor: State, sensors: State | None, dt: float) -> bool:
        """Take the signals of one inner period.

        Parameters
        ----------
        motor : theta, rad, thetad, rad/s, motor torque in the period that ends, N m, each (n,).
        sensors : q, rad, qd, rad/s, strain torque, N m, each (n,); ignored without
            `use_joint_sensors`, required with it.
        dt : time since the call before, s, from stamps.

        Returns
        -------
        bool
            False if the sample is refused.
        """
        if self._is_blind:
            self.reset()
            return True
        state = sensors if self._parameters.use_joint_sensors else motor
        return state is not None and self._observer.observe(state, dt)

    def estimate(self, is_pressing: bool = False) -> ContactEstimate:
        """Estimate the contact from the samples so far.

        Parameters
        ----------
        is_pressing : whether a force is commanded.  A contact then counts until the arm leaves it, also while it is
            not detected: if it was learned as an error of the model, the arm would press ever harder.
        """
        observer, parameters = self._observer, self._parameters
        torques, covariance = observer.torques()
        external = tuple(torques.tolist())
        sd = tuple(map(math.sqrt, covariance.diagonal().tolist()))
        if not observer.is_ready:
            self._forget()
            reason = Reason.BRAKED if self._is_blind else Reason.TOO_EARLY
            return ContactEstimate(external, sd, 0.0, reasons=reason)
        if observer.age != self._last[0]:
            self._before, self._last = self._last, (observer.age, torques)
        precision = inverse(covariance)
        statistic = size = detection_statistic(torques, precision)
        is_calm = self._in_contact or observer.age - self._ended > CONTACT.shaking_time
        fast = observer.fast_torques() if is_calm and statistic <= parameters.detect else None
        if fast is not None:
            quick = detection_statistic(fast[0], inverse(fast[1]))
            statistic = max(size, quick / CONTACT.sudden)
        was_in_contact, self._in_contact = self._in_contact, self._is_detected(statistic, is_calm)
        if was_in_contact and not self._in_contact:
            self._ended = observer.age
        observer.follow(statistic, self._is_touched(is_pressing))
        if not self._in_contact:
            if was_in_contact:
                self._inference.fusion.reset()
            return ContactEstimate(external, sd, statistic, warning=observer.warning)
        load = None if is_pressing else observer.load_torques  # what is pressed on is no payload
        now, late = observer.instant(torques), self._late(torques, precision, size)
        hypotheses = self._inference.infer(observer.seen.pose, torques, precision, load, now, late)
        return ContactEstimate(external, sd, statistic, hypotheses, hypotheses[0].reasons, observer.warning)

    def _late(self, torques: Array, precision: Array, statistic: float) -> float:
        """By which fraction the torques grow or fall, along themselves, within the delay of the observer."""
        then, before = self._before
        if before is None:
            return 0.0
        change = float(precision.dot(torques).dot(torques - before))
        passed = self._observer.age - then
        return self._delay / passed * abs(change) / max(statistic, CONTACT.negligible)

    def _is_touched(self, is_pressing: bool) -> bool:
        """Whether something is detected, or was while the arm pressed on it, and the arm has not left it since."""
        q, at = self._observer.q, self._pressed_at
        if is_pressing and (self._in_contact or at):
            self._pressed_at = q
        elif at and any(abs(a - b) > MOTION.left_angle for a, b in zip(at, q, strict=True)):
            self._pressed_at = []
        return self._in_contact or bool(self._pressed_at)

    def _is_detected(self, statistic: float, is_calm: bool) -> bool:
        detect, was_above = self._parameters.detect, self._is_above
        self._is_above = statistic > (detect if is_calm else CONTACT.alone * detect)
        if self._in_contact:
            return statistic > self._parameters.release
        return (is_calm and statistic > CONTACT.alone * detect) or (self._is_above and was_above)

    @property
    def model_errors(self) -> dict[str, TrackedError]:
        """Errors of the model that are tracked between contacts, by name; of joint sensors none."""
        return self._observer.model_errors
