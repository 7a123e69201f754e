"""What touches the arm: momentum observer, detection and inference together, as one machine."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wam_control.contact_inference import (
    ContactInference,
    Hypothesis,
    InferenceParameters,
    detection_statistic,
)
from wam_control.momentum_observer import MomentumObserver, ObserverParameters
from wam_description.arm import Arm, Timing
from wam_description.parameters import parameter, require
from wam_description.rigid_body import RigidBody
from wam_description.signals import State


@dataclass(frozen=True)
class ContactEstimatorParameters:
    """Parameters of the contact estimator."""

    observer: ObserverParameters
    inference: InferenceParameters
    use_joint_sensors: bool = parameter("feel with the joint sensors instead of the motors alone")
    detect: float = parameter("r^T S^-1 r of the external torques above which something touches", low=0.0)
    release: float = parameter("the same, below which nothing touches any more", low=0.0)

    def __post_init__(self) -> None:
        require(
            self.release <= self.detect,
            f"parameter 'release' is {self.release:g}; it must not be above detect, {self.detect:g}",
        )


class ContactEstimate(NamedTuple):
    """What the world does to the arm.

    Attributes
    ----------
    external_torques : (n,), torques of the world on the joints, N m.
    torque_sd : (n,), their standard deviations, N m.
    statistic : r^T S^-1 r of the external torques.
    in_contact : whether something touches.
    link : name of the touched cover, '' without contact.
    place : m along the cover's x axis, NaN where it cannot be observed.
    place_sd : m, NaN with the place.
    probability : that this link is touched, NaN without contact.
    direction_sd : rad, of the angle of the force round the link, NaN without contact.
    force : (3,), N, of the world on the link, in the cover's frame; zeros without contact, the
        least possible force where the place is NaN.
    moment : (3,), N m, of that force about the origin of the cover's frame.
    hypotheses : every explanation, the most probable first, empty without contact.
    reason : why the place is NaN or the answer not to be trusted, '' where neither.
    """

    external_torques: tuple[float, ...]
    torque_sd: tuple[float, ...]
    statistic: float
    in_contact: bool
    link: str
    place: float
    place_sd: float
    probability: float
    direction_sd: float
    force: tuple[float, float, float]
    moment: tuple[float, float, float]
    hypotheses: tuple[Hypothesis, ...]
    reason: str


NOTHING = (0.0, 0.0, 0.0)
TOO_EARLY = "not enough has been observed"


class ContactEstimator:
    """Observes at the inner rate, says what touches at the outer one.

    Parameters
    ----------
    arm : the arm as configured; the observer's model differs from it by its own factors.
    timing : periods of the loops; the observer's time constant must cover two inner periods.
    parameters : of observer, detection and inference.

    Raises
    ------
    ParameterError
        where joint sensors are asked for and the arm has none, or the sets do not fit each other.
    """

    def __init__(self, arm: Arm, timing: Timing, parameters: ContactEstimatorParameters) -> None:
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
        self._observer = MomentumObserver(arm, parameters.observer, parameters.use_joint_sensors, timing.dither_cycle)
        body = RigidBody(arm, parameters.observer.mass_scale)
        self._inference = ContactInference(arm, body, parameters.inference)
        self._in_contact = self._is_blind = False
        self.refused = 0

    def brake(self, on: bool) -> None:
        """Say whether brakes hold the motors, which then tell nothing; joint sensors feel on."""
        self._is_blind = on and not self._parameters.use_joint_sensors

    def tare(self) -> str:
        """Take what is felt now as the payload, within what is declared; '' or why that cannot be."""
        return self._observer.weigh()

    def reset(self) -> None:
        """Forget everything seen."""
        self._observer.reset()
        self._in_contact = False

    def observe(self, motor: State, sensors: State | None, dt: float) -> bool:
        """Take the signals of one inner period.

        Parameters
        ----------
        motor : theta, rad, thetad, rad/s, motor torque in the period that ends, N m, each (n,).
        sensors : q, rad, qd, rad/s, strain torque, N m, each (n,); not looked at without
            `use_joint_sensors`, needed with it.
        dt : time since the call before, s, from stamps.

        Returns
        -------
        bool
            False where the sample is refused; `refused` counts these.
        """
        if self._is_blind:
            self.reset()
            return True
        state = sensors if self._parameters.use_joint_sensors else motor
        is_taken = state is not None and self._observer.observe(state, dt)
        if not is_taken:
            self.refused += 1
        return is_taken

    def estimate(self) -> ContactEstimate:
        """Say what touches, from everything observed."""
        observer, parameters = self._observer, self._parameters
        felt, covariance = observer.torques()
        torques = tuple(felt)
        sd = tuple(math.sqrt(variance) for variance in covariance.diagonal().tolist())
        if not observer.is_ready:
            self._in_contact = False
            return _nothing(torques, sd, 0.0, "brakes hold the motors" if self._is_blind else TOO_EARLY)
        precision = np.asarray(np.linalg.inv(covariance), np.float64)
        statistic = detection_statistic(torques, precision)
        self._in_contact = statistic > (parameters.release if self._in_contact else parameters.detect)
        if not self._in_contact:
            return _nothing(torques, sd, statistic, "nothing touches")
        hypotheses = self._inference.infer(observer.q, torques, precision)
        best = hypotheses[0]
        return ContactEstimate(
            external_torques=torques,
            torque_sd=sd,
            statistic=statistic,
            in_contact=True,
            link=best.cover,
            place=best.place,
            place_sd=best.place_sd,
            probability=best.probability,
            direction_sd=best.direction_sd,
            force=best.force,
            moment=best.moment,
            hypotheses=hypotheses,
            reason=best.reason,
        )


def _nothing(torques: tuple[float, ...], sd: tuple[float, ...], statistic: float, reason: str) -> ContactEstimate:
    return ContactEstimate(
        external_torques=torques,
        torque_sd=sd,
        statistic=statistic,
        in_contact=False,
        link="",
        place=math.nan,
        place_sd=math.nan,
        probability=math.nan,
        direction_sd=math.nan,
        force=NOTHING,
        moment=NOTHING,
        hypotheses=(),
        reason=reason,
    )
