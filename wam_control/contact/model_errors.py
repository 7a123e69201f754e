"""Errors of the estimator's model, tracked by a Kalman filter in free motion.

The residual of the momentum observer is r = tau_ext + H x + e: H the torques of the model's errors of size one through
the observer's filter, x the errors, e the rest, of covariance R.  Without contact r measures x.  External torques are
r - H x with the covariance S = H P H^T + R; while a contact lasts, x is frozen and P grows.  In one pose e stays as it
is, also with a dither.  So many samples there determine x better for that pose; for other poses they count as one
sample of R.  What holds in that pose alone is forgotten where the arm is away from there without contact.

How large the errors are in free motion, over S, is followed, too: on an arm that is worse than stated, S is so much
larger.  Never smaller: on a better arm, links that are wrong by friction of the contact would seem certain.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from wam_control.contact.model_prior import ModelPrior
from wam_control.contact.thresholds import CONTACT
from wam_description.rigid_body import Array
from wam_description.small_matrices import solution


class Observation(NamedTuple):
    """What the observer knows at one time.

    Attributes
    ----------
    residual : (n,), N m.
    effects : (n, k), N m, H.
    rest : (n, n), N^2 m^2, R without the noise of the motors that is followed here.
    moving : (n,), fraction to which each motor moves; more for a filter that averages less of the noise.  Empty for
        joint sensors, which are without this noise.
    pose : (n,), joint angles, rad, as late as the residual.
    lasting : (n, m), N m, torques of those errors of the rest, of one sd, that may stay as they are in a pose.
    """

    residual: Array
    effects: Array
    rest: Array
    moving: Array
    pose: Array
    lasting: Array


class TrackedError(NamedTuple):
    """An error of the model and its standard deviation, in the unit of `ModelPrior`."""

    value: float
    sd: float


class _Pose(NamedTuple):
    """A pose in which the arm rests.

    Attributes
    ----------
    at : (n,), rad.
    samples : that were learned from there.
    rested : s, since `elsewhere`.
    elsewhere : errors and covariance as they are for other poses; None where they are the same there.
    """

    at: Array
    samples: int = 0
    rested: float = 0.0
    elsewhere: tuple[Array, Array] | None = None


class ModelErrors:
    """Kalman filter of the errors of the model.

    Parameters
    ----------
    prior : of the errors, before any motion.
    drift : sd of the errors' random walk per largest sd, 1/sqrt(s).
    through : (n, n), joint torques per motor torque.
    noise : (n,), N^2 m^2, variance of the motors' torque that is assumed at the start.
    least_noise : N^2 m^2, a variance that is as good as none.

    Attributes
    ----------
    size : squared errors of the torques in free motion, with a margin, over the variances that are stated for them;
        at least 1.
    beyond : name of the error that is certainly larger than tolerable, the most; '' for none.
    """

    def __init__(self, prior: ModelPrior, drift: float, through: Array, noise: Array, least_noise: float) -> None:
        self._prior = prior
        self._least_noise = least_noise
        self._walk = drift**2 * np.diag(prior.limit)
        self._through, self._to_motors = through, np.linalg.inv(through)
        # arrays are replaced, never changed: others may keep them
        self.errors, self.covariance, self.noise, self.size = prior.errors, prior.covariance, noise, 1.0
        self.beyond = self._beyond()
        self._waiting: deque[Observation] = deque()
        self._pose = _Pose(np.full(len(through), np.inf))
        self.reset()

    @property
    def by_name(self) -> dict[str, TrackedError]:
        """The errors by name."""
        sds = np.sqrt(self.covariance.diagonal()).tolist()
        return dict(zip(self._prior.names, map(TrackedError, self.errors.tolist(), sds), strict=True))

    def reset(self) -> None:
        """Forget the samples that wait, not the errors."""
        self._waiting.clear()
        self._since = self._contact = self._hold = 0.0

    def corrected(self, seen: Observation) -> tuple[Array, Array]:
        """External torques, (n,), N m, and their covariance, (n, n), N^2 m^2."""
        effects = seen.effects
        covariance = effects.dot(self.covariance).dot(effects.T) + seen.rest
        return seen.residual - effects.dot(self.errors), self._with_noise(covariance, seen)

    def external(self, seen: Observation) -> tuple[Array, Array]:
        """The same, with the covariance as large as the errors in free motion are."""
        torques, covariance = self.corrected(seen)
        return torques, self.size * covariance

    def zero(self, seen: Observation, detect: float) -> None:
        """Take an instant at rest as one of an arm that nothing touches.

        What would count as a contact, and is more than expected, shows larger errors of the model than was thought.

        Another one in the same pose has the same errors of the gauges: it takes the place of the one before.
        """
        elsewhere = self._pose.elsewhere
        if elsewhere is None or np.abs(seen.pose - self._pose.at).max() > CONTACT.pose_change:
            elsewhere = self.errors, self.covariance
        self.errors, self.covariance = elsewhere
        self._pose = _Pose(seen.pose, elsewhere=elsewhere)
        innovation, covariance = self.corrected(seen)
        statistic = float(innovation.dot(solution(covariance, innovation)))
        self.covariance = self.covariance * max(1.0, statistic / max(detect, len(innovation)))
        self._take(*self.corrected(seen), seen)

    def _take(self, innovation: Array, covariance: Array, seen: Observation) -> None:
        """Learn from an innovation, (n,), N m, by its covariance, (n, n)."""
        gain_torques = self.covariance.dot(seen.effects.T)
        gain = np.linalg.solve(covariance, gain_torques.T).T
        self.errors = self.errors + gain.dot(innovation)
        corrected = self.covariance - gain.dot(gain_torques.T)
        self.covariance = 0.5 * (corrected + corrected.T)
        self.beyond = self._beyond()

    def parts(self, seen: Observation) -> tuple[Array, Array, Array]:
        """Effects, (n, k), N m, of the errors that stay, their covariance, (k, k), and that of the others, (n, n)."""
        effects = np.concatenate((seen.effects, seen.lasting), axis=1)
        k, size = len(self.errors), len(effects[0])
        covariance = np.eye(size)
        covariance[:k, :k] = self.covariance
        return effects, self.size * covariance, self.size * self._with_noise(seen.rest, seen)

    def _with_noise(self, covariance: Array, seen: Observation) -> Array:
        """A covariance, (n, n), N^2 m^2, of the torques with that of the motors' noise."""
        if not seen.moving.size:
            return covariance
        # dot: of small arrays faster than @, the same bits
        return covariance + (self._through * (self.noise * seen.moving)).dot(self._through.T)

    def follow(self, seen: Observation, statistic: float, in_contact: bool, span: float) -> None:
        """Learn from what was observed, `span` seconds after the time before; not in contact, and with hindsight."""
        if in_contact:
            self._contact += span
            self._hold = min(CONTACT.hold_off * self._contact, CONTACT.longest_hold_off)
            self._waiting.clear()
        elif self._hold > 0.0:
            self._hold, self._contact = self._hold - span, 0.0
        self._since += span
        if self._since < CONTACT.learn_interval:
            return
        self._grow(self._since)
        pose = self._pose = self._pose._replace(rested=self._pose.rested + self._since)
        if not in_contact and np.abs(seen.pose - pose.at).max() > (
            CONTACT.rest_left if pose.elsewhere else CONTACT.pose_change
        ):
            self._leave(seen.pose)
        if not in_contact and self._hold <= 0.0:
            self._contact = 0.0
            self._waiting.append(seen)
            if len(self._waiting) > CONTACT.hindsight / CONTACT.learn_interval and statistic < CONTACT.gate:
                before = self._waiting.popleft()
                pose = self._pose = self._pose._replace(samples=self._pose.samples + 1)
                if pose.samples > CONTACT.correlated and pose.elsewhere is None:
                    self._pose = pose._replace(elsewhere=(self.errors, self.covariance), rested=0.0)
                self._learn(before, self._since)
        self._since = 0.0

    def _leave(self, pose: Array) -> None:
        """Forget what is true of one pose alone."""
        before, self._pose = self._pose, _Pose(pose, rested=self._pose.rested)
        if before.elsewhere is not None:
            self.errors, self.covariance = before.elsewhere
            self._grow(before.rested)
            self.beyond = self._beyond()
            self._waiting.clear()

    def _grow(self, span: float) -> None:
        covariance = self.covariance + span * self._walk
        scale = np.sqrt(np.minimum(1.0, self._prior.limit / np.maximum(covariance.diagonal(), CONTACT.negligible)))
        self.covariance = covariance * scale * scale[:, None]

    def _learn(self, seen: Observation, span: float) -> None:
        innovation, covariance = self.corrected(seen)
        # of a shaft at rest stiction hides the errors
        rate = span / CONTACT.trust_time * float(seen.moving.min())
        squared = float(innovation.dot(solution(covariance, innovation))) / len(innovation)
        self.size = min(max(self.size + rate * (CONTACT.margin * squared - self.size), 1.0), CONTACT.largest_size)
        rate = span / CONTACT.noise_time
        at_motors = self._to_motors.dot(innovation)
        stated = np.einsum("ij,jk,ik->i", self._to_motors, covariance, self._to_motors)
        # by Fisher's scoring: what is uncertain for another reason, as the friction of a slow shaft, shows no noise
        share = np.minimum(1.0, (self.noise + self._least_noise) / stated)
        excess = at_motors * at_motors - stated
        self.noise = np.maximum(0.0, self.noise + rate * seen.moving * share * share * excess)
        rest = covariance - seen.effects.dot(self.covariance.dot(seen.effects.T))
        self._take(innovation, covariance + (CONTACT.correlated - 1.0) * rest, seen)

    def _beyond(self) -> str:
        excess = np.abs(self.errors) - CONTACT.sure * np.sqrt(self.covariance.diagonal())
        ratio = excess / self._prior.tolerable
        worst = int(ratio.argmax())
        return self._prior.names[worst] if ratio[worst] > 1.0 else ""
