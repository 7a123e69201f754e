"""Several instants of one contact that explain it together.

While a contact lasts, a part of the errors of its torques changes: cogging, noise, friction of a motor that has moved
on.  A part stays: a wrong friction level, a shaft at rest.  The torques of some instants are taken as one measurement,
of 4 numbers per instant of an arm of 4 joints.  Its covariance has both parts:

    C_jk = H_j P H_k^T + L_j L_k^T + delta_jk R_j.

H are the effects of the model's errors, P is their covariance, the same at all instants.  L are the effects of shafts
at rest or just reversed.  These may stay or change: they count as both, in L and in R.

One contact position explains all instants.  The force on each link grows and shrinks as the torques do, over those of
the same force in each pose.  How else it may change is in the covariance, too, by the links' probabilities.  Its
direction changes by a fraction of its size.  Its position changes by the way that the arm has moved since, and by the
speed of a contact that slides along its link.  Few slide.  How probable that is follows from the same instants: by how
much better a speed explains them, whatever the force and the position.  All errors of this contact may be larger than
stated.  How much follows from what the fit leaves unexplained, and from `freedom` degrees of freedom of the statement.

The inner products of `ContactFit` are all that a fit needs, of any number of rows.  Those of the past instants are
computed when one joins them.  Those of the present one, Z_n of covariance C_nn, are added without what the past
predicts: Z_n - C_np C_pp^-1 Z_p, with C_nn - C_np C_pp^-1 C_pn (Rasmussen & Williams, 2006, A.6).
"""

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_control.contact.thresholds import CONTACT
from wam_control.thresholds import MOTION
from wam_description.rigid_body import Array
from wam_description.small_matrices import inverse, solution

UNMEASURED = 2e-5 * np.eye(3)  # m^2: a force of 30 N in a direction without a lever is as likely as errors of 0.14 N m


class Torques(NamedTuple):
    """External torques at one time, with what is known of their errors.

    Attributes
    ----------
    time : s.
    residual : (n,), N m.
    effects : (n, k), N m, of errors that stay, of the covariance `covariance`.
    covariance : (k, k).
    own : (n, n), N^2 m^2, covariance of the errors of this instant alone.
    pose : (n,), rad.
    """

    time: float
    residual: Array
    effects: Array
    covariance: Array
    own: Array
    pose: Array


class _Seen(NamedTuple):
    torques: Torques
    rows: Array


class _Past(NamedTuple):
    """What past instants contribute; their forces in units of `forces`, each of its link.

    `gram` (links, 7, 7) of them alone; `predicts` (links, k, 7) and `explains` (k, k): C_np C_pp^-1 Z_p and
    C_np C_pp^-1 C_pn without the effects of the present instant at their outer sides.
    """

    gram: Array
    predicts: Array
    explains: Array
    expected: float  # chi^2 of the errors alone, without what the force may have changed
    last: Torques  # of the last instant
    places: Array  # (links,), m
    forces: Array  # (links, 3), N, across and along, there, by the torques of the last instant
    slope: Array  # (links, n), N m per m of its contact position, by the square roots of the links' probabilities
    instants: int


class ContactFusion:
    """Keeps the torques of one contact at several times, and their inner products.

    Parameters
    ----------
    duration : s, for which an instant counts; 0 for the present one alone.

    Attributes
    ----------
    count : number of instants that explain the present contact together.
    """

    def __init__(self, duration: float) -> None:
        self._duration = duration
        self.reset()

    def reset(self) -> None:
        """The contact has ended, or is another one."""
        # past ones, and the last one, whose errors are still those of the present
        self._instants: deque[_Seen] = deque(maxlen=CONTACT.instants + 1)
        self._past: _Past | None = None
        self._widening = 1.0
        self._speed = _speed(CONTACT.slide_probability)
        self.count = 1

    def gram(self, rows: Array, now: Torques) -> Array | None:
        """Inner products of all instants, (links, 7, 7); None for no past, another contact, or where rounding decides.

        Parameters
        ----------
        rows : (links, 7, n), those of `ContactFit` of the present instant; the last link may be a payload.
        now : its torques.
        """
        past = self._past
        self.count = 1
        if past is None:
            return None
        effects = now.effects
        covariance = effects.dot(now.covariance).dot(effects.T) + now.own
        slips = self._speed * (now.time - past.last.time) * past.slope
        sides, _ = _sides(rows[:, :, None], past.places)
        alike = past.forces[:, None] @ sides[:, :, 0]
        alike = np.concatenate((past.last.residual[None], alike[:, 0]))
        growth = _grown(now.residual, alike, covariance, slips)
        if not 1.0 / CONTACT.most_growth < growth[0] < CONTACT.most_growth:
            self.reset()
            return None
        scale = np.ones(rows.shape[:2])
        scale[:, 1:] /= growth[1:, None].clip(1.0 / CONTACT.most_growth, CONTACT.most_growth)
        rest = rows - (effects @ (past.predicts * scale[:, None])).transpose(0, 2, 1)
        precision = inverse(covariance - effects.dot(past.explains).dot(effects.T))
        found: Array = (
            past.gram * (scale[:, :, None] * scale[:, None]) + rest @ precision @ rest.transpose(0, 2, 1)
        ) / self._widening
        if (found - found.transpose(0, 2, 1)).max() > CONTACT.rounding:
            self.reset()
            return None
        self.count = 1 + past.instants
        return found

    def remember(self, rows: Array, now: Torques, guess: Sequence[tuple[float, float]], residual: float) -> None:
        """Take the present instant, with what was fitted to it.

        Parameters
        ----------
        guess : of each link position of the contact, m, and probability.
        residual : chi^2 of all instants that the fit does not explain.
        """
        if self._past is not None and self.count > 1:
            freedom = max(0.0, self._past.expected + len(now.residual) - CONTACT.unknowns)
            self._widening = (CONTACT.freedom + self._widening * residual) / (CONTACT.freedom + freedom)
            if self._widening > CONTACT.different:
                self.reset()
        instants = self._instants
        last = instants[-1].torques if instants else None
        is_early = last is not None and now.time - last.time < CONTACT.instant_interval - MOTION.rounding
        if is_early or now.own.diagonal().min() < CONTACT.finest_sd**2:
            return
        has_moved = last is None or np.abs(now.pose - last.pose).max() > CONTACT.pose_change
        if has_moved:
            instants.append(_Seen(now, rows))
        count = len(instants)
        while len(instants) > 1 and now.time - instants[0].torques.time > self._duration:
            instants.popleft()
        if has_moved or len(instants) < count:
            *past, _ = instants
            self._past = self._of(past, now, np.array(guess)) if past else None

    def _of(self, instants: list[_Seen], now: Torques, guess: Array) -> _Past:
        n, past, last = len(now.residual), [instant.torques for instant in instants], instants[-1].torques
        effects = np.concatenate([each.effects for each in past])
        shared = effects.dot(last.covariance)
        common = shared.dot(effects.T)
        rows = np.stack([instant.rows for instant in instants], axis=2)  # (links, 7, instants, n)
        # a payload has no place, and is not moved
        guess = np.concatenate((guess, np.zeros((len(rows) - len(guess), 2))))
        places, chances, count = guess[:, 0], np.sqrt(guess[:, 1]), len(past)
        sides, slopes = _sides(rows, places)
        present = sides[:, :, -1]
        levers = present @ present.transpose(0, 2, 1) + UNMEASURED
        wanted = np.linalg.solve(levers, (present @ last.residual)[..., None])
        forces: Array = np.asarray(wanted[..., 0], np.float64)  # (links, 3), N
        moved = CONTACT.slip * np.abs(np.array([each.pose for each in past]) - now.pose).max(axis=1)
        elapsed = np.array([now.time + CONTACT.instant_interval - each.time for each in past])
        slope = chances[:, None] * (forces[:, :2, None] * slopes[:, :, -1]).sum(axis=1)
        certain = common[-n:, -n:] + last.own
        # by how much the force of each link was larger than `forces`, whose torques would then have been `alike`
        alike = (forces[:, :, None, None] * sides).sum(axis=1)
        ways = moved + self._speed * elapsed
        sizes = np.transpose([_grown(past[j].residual, alike[:, j], certain, ways[j] * slope) for j in range(count)])
        rows[:, 1:] *= sizes[:, None, :, None]
        sides *= sizes[:, None, :, None]
        for j, each in enumerate(past):
            common[n * j : n * j + n, n * j : n * j + n] += each.own
        covariance = common.copy()
        turned = sides * (chances * CONTACT.force_turn * np.sqrt((forces**2).sum(axis=1)))[:, None, None, None]
        for j in range(count):
            of = slice(n * j, n * j + n)
            side = turned[:, :, j].reshape(-1, n)
            covariance[of, of] += side.T.dot(side)
        per_metre = (forces[:, :2, None, None] * slopes).sum(axis=1)  # (links, instants, n), N m per m
        link = int(chances.argmax())
        unknown = np.concatenate(
            (
                CONTACT.any_force * np.sqrt(forces[link].dot(forces[link])) * sides[link].reshape(3, -1),
                CONTACT.any_position * per_metre[link].reshape(1, -1),
                (per_metre[link] * (moved + CONTACT.drift * elapsed)[:, None]).reshape(1, -1),
            )
        )
        slides = probability_of_slide(
            np.concatenate([each.residual for each in past]),
            self._widening * (covariance + unknown.T.dot(unknown)),
            CONTACT.slide_speed * (per_metre[link] * elapsed[:, None]).reshape(-1),
        )
        self._speed = _speed(slides)
        far = np.multiply.outer(chances, moved + self._speed * elapsed)
        slips = (per_metre * far[:, :, None]).reshape(len(rows), -1)
        covariance += slips.T.dot(slips)
        rows = rows.reshape(len(rows), 7, count * n)
        precision = inverse(covariance)
        weighted_rows = precision @ rows.transpose(0, 2, 1)
        return _Past(
            gram=rows @ weighted_rows,
            predicts=shared.T @ weighted_rows,
            explains=shared.T.dot(precision).dot(shared),
            expected=float((precision * common).sum()),
            last=last,
            places=places,
            forces=forces,
            slope=slope,
            instants=count,
        )


def _sides(rows: Array, places: Array) -> tuple[Array, Array]:
    """Torques of a force across a link and along it, (links, 3, instants, n), m, and those across per metre, (2)."""
    sides, slopes = rows[:, [1, 2, 6]], rows[:, 3:5]
    sides[:, :2] += places[:, None, None, None] * slopes
    return sides, slopes


def _grown(torques: Array, alike: Array, covariance: Array, slips: Array) -> Array:
    """By which factor g the force on each link has grown, (links,): torques = g alike + errors, with the prior 1 +- 1.

    g = (a' W t + 1)/(a' W a + 1) of the torques t and a, with the inverse W of the covariance of the errors.

    Parameters
    ----------
    torques : (n,), N m.
    alike : (links, n), N m, of the force before it has grown.
    covariance : (n, n), N^2 m^2, of the errors.
    slips : (k, n), N m, further independent errors of one sd.
    """
    weighted = alike.dot(inverse(covariance + slips.T.dot(slips)))
    found: Array = (weighted.dot(torques) + 1.0) / ((weighted * alike).sum(axis=1) + 1.0)
    return found


def probability_of_slide(torques: Array, covariance: Array, slide: Array) -> float:
    """Probability that a contact slides, by the ratio of the evidence with and without.

    Parameters
    ----------
    torques : (m,), N m, of all instants.
    covariance : (m, m), N^2 m^2, if it does not slide, whatever its force and position.
    slide : (m,), N m, torques of the standard deviation of its speed.
    """
    weighted = solution(covariance, slide)
    gain = float(slide.dot(weighted))
    evidence = 0.5 * (float(torques.dot(weighted)) ** 2 / (1.0 + gain) - math.log1p(gain))
    odds = (
        CONTACT.slide_probability
        / (1.0 - CONTACT.slide_probability)
        * math.exp(min(evidence, CONTACT.largest_exponent))
    )
    return odds / (1.0 + odds)


def _speed(slides: float) -> float:
    """Standard deviation of the speed along the link, m/s, of a contact that slides with a probability."""
    return math.sqrt(slides * CONTACT.slide_speed**2 + (1.0 - slides) * CONTACT.drift**2)
