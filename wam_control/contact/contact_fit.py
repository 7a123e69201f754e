"""One contact on one of several straight links: the posterior on a grid of its positions, the force integrated out.

A contact at position x pushes across the link, tau_ext = (A + x B) f, with f the two components of the force across the
link, N.  Friction adds a tangential force.  Around the link it gives the force a moment arm about the tube's axis, a
twist t; along the link it adds a force a, which acts at the surface and so has a moment, too.  Both are unknown and
proportional to force and friction.

Every hypothesis explains the torques r by some torques C of forces with normal priors:

    log p = -1/2 (r^T S'^-1 r + log |S'| / |S|),  S' = S + C C^T.

All that is needed of arm and torques are inner products, weighted with the inverse of the covariance S: the Gram matrix
of Z = (r, A_1, A_2, B_1, B_2, t, a), 7 by 7.  With S' it is G - U (1 + V)^-1 U^T, U = Z^T S^-1 C, V = C^T S^-1 C
(Woodbury).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_control.contact.inference_parameters import InferenceParameters
from wam_control.contact.thresholds import CONTACT
from wam_description.rigid_body import Array
from wam_description.signals import ZERO, Triple
from wam_description.small_matrices import solution

Pair = tuple[float, float]
Gram = list[list[float]]
TWIST, AXIAL = 5, 6  # among the columns of Z
# a piece of a link: log of the probability density of a contact, per metre; position and width, m; link; whether it is
# that of a force along the tube
Piece = tuple[float, float, float, int, bool]


class Fit(NamedTuple):
    """The most likely contact on one link.

    Attributes
    ----------
    probability : of this link among all hypotheses.
    position : m, mean contact position, by a force from the side or along the tube, whichever is likelier: a mean of
        both would be where neither is.
    position_sd : m, root mean square distance of the contact from there, by both.
    low, high : m, ends of the part of the link that is in the 90 % set, NaN where none is.
    along : probability that the force is along the tube, of a contact on this link.
    force : (2,), N, most likely components across the link at `position`.
    force_sd : N, standard deviation of the size of the force, the position unknown, and whether it is along the tube if
        `along` is above 0.5.
    direction_sd : rad, standard deviation of its direction about the link, the position unknown.
    torque_position_sd : m, standard deviation of the position by the torques alone, without priors of position
        and force; infinite where they do not determine it.
    is_at_start : whether the smallest force that explains the torques is at the start of the link, as for one along it.
    smallest : (3,), N, across the link and along it: that force, at the end of the link, the longest lever, if not.
    residual : what the best contact does not explain, chi^2.
    """

    probability: float
    position: float
    position_sd: float
    low: float
    high: float
    along: float
    force: Pair
    force_sd: float
    direction_sd: float
    torque_position_sd: float
    is_at_start: bool
    smallest: Triple
    residual: float


def widened(gram: Gram, u: list[float], v: list[float], w11: float, w12: float, w22: float) -> tuple[Gram, float]:
    """Gram matrix, and log |S'| / |S|, if two torques of unit variance are in the covariance, too.

    Parameters
    ----------
    u, v : inner products of these torques with the columns of Z that are wanted, which are the first ones of `gram`.
    w11, w12, w22 : elements of 1 + V, of their own inner products.
    """
    determinant = max(w11 * w22 - w12 * w12, w11 + w22 - 1.0)  # at least this, but for rounding
    w11, w12, w22 = w11 / determinant, w12 / determinant, w22 / determinant
    found = []
    for row, a, b in zip(gram, u, v):  # noqa: B905
        p, q = w22 * a - w12 * b, w11 * b - w12 * a
        found.append([g - p * x - q * y for g, x, y in zip(row, u, v)])  # noqa: B905
    return found, math.log(determinant)


def log_evidence(rr: float, ra: float, aa: float, scale: float) -> float:
    """Log of the probability of torques r by a force of the torques a per newton, up to the constant -1/2 log |S|.

    Parameters
    ----------
    rr, ra, aa : their inner products.
    scale : prior standard deviation of the force, N.
    """
    wide = aa + scale**-2
    return -0.5 * (rr - ra * ra / wide + math.log(wide * scale * scale))


def log_evidence_of_weight(rr: float, ra: float, aa: float, scale: float) -> float:
    """The same for a force of one sign: twice the probability that it is positive."""
    positive = 0.5 * math.erfc(-ra / math.sqrt(2.0 * (aa + scale**-2)))
    return log_evidence(rr, ra, aa, scale) + math.log(2.0 * max(positive, CONTACT.negligible))


class _Link(NamedTuple):
    """A force across a link, by the Gram matrix of r, A_1, A_2, B_1, B_2.

    Attributes
    ----------
    gram : 5 by 5, or larger.
    precision : 1/N^2, of the prior of each component of the force.
    constant : log of the probability of the torques without a force across.
    terms : (13,), coefficients of 1, x, x^2 in G^T W G + precision, 11, 12, 22, with G = A + x B; of 1, x in G^T W r.
    """

    gram: Gram
    precision: float
    constant: float
    terms: tuple[float, ...]

    @classmethod
    def of(cls, gram: Gram, precision: float, volume: float) -> "_Link":
        """The link of the first five columns of Z."""
        r, a1, a2, b1, b2 = gram[:5]
        n11, n12 = (a1[1] + precision, 2.0 * a1[3], b1[3]), (a1[2], a1[4] + a2[3], b1[4])
        terms = (*n11, *n12, a2[2] + precision, 2.0 * a2[4], b2[4], r[1], r[3], r[2], r[4])
        return cls(gram, precision, math.log(precision) - 0.5 * (r[0] + volume), terms)

    def _equations(self, x: float) -> tuple[float, float, float, float, float, float]:
        """Elements 11, 12, 22 of G^T W G + precision at position x, 1, 2 of G^T W r, and the determinant."""
        p0, p1, p2, q0, q1, q2, s0, s1, s2, c0, c1, e0, e1 = self.terms
        n11, n12, n22 = p0 + x * (p1 + x * p2), q0 + x * (q1 + x * q2), s0 + x * (s1 + x * s2)
        return n11, n12, n22, c0 + x * c1, e0 + x * e1, n11 * n22 - n12 * n12

    def force(self, x: float) -> tuple[float, Pair, Triple]:
        """Of the most likely force at position x: the part of r^T W r it explains, it, its covariance 11, 12, 22."""
        n11, n12, n22, torque1, torque2, determinant = self._equations(x)
        f1, f2 = (n22 * torque1 - n12 * torque2) / determinant, (n11 * torque2 - n12 * torque1) / determinant
        return f1 * torque1 + f2 * torque2, (f1, f2), (n22 / determinant, -n12 / determinant, n11 / determinant)

    def log_density(self, x: float) -> float:
        """Log of the probability of the torques for a contact at x, up to a constant of the link."""
        n11, n12, n22, torque1, torque2, determinant = self._equations(x)
        explained = n22 * torque1 * torque1 - 2.0 * n12 * torque1 * torque2 + n11 * torque2 * torque2
        return 0.5 * (explained / determinant - math.log(determinant))

    def torque_position_sd(self, x: float, force: Pair) -> float:
        """Standard deviation of the position, m, by the torques alone, the force unknown: a Schur complement.

        Not by a pseudo-inverse of the whole information, which is small exactly where the position is undetermined.
        """
        n11, n12, n22, *_ = self._equations(x)
        _, a1, a2, b1, b2 = self.gram[:5]
        (f1, f2), less = force, self.precision * (1.0 - CONTACT.weak_prior)
        n11, n22 = n11 - less, n22 - less
        v1 = f1 * (a1[3] + x * b1[3]) + f2 * (a1[4] + x * b1[4])
        v2 = f1 * (a2[3] + x * b1[4]) + f2 * (a2[4] + x * b2[4])
        known = (v1 * v1 * n22 - 2.0 * v1 * v2 * n12 + v2 * v2 * n11) / (n11 * n22 - n12 * n12)
        information = f1 * f1 * b1[3] + 2.0 * f1 * f2 * b1[4] + f2 * f2 * b2[4] - known
        return information**-0.5 if information > 0.0 else math.inf


class _Part:
    """Pieces of a link: sums of their weights, these times position, m, and square, m^2; ends of the 90 % set, m."""

    def __init__(self, start: float, end: float) -> None:
        # of a link without any piece the position is unknown
        self.mass, self.first = CONTACT.negligible, 0.5 * CONTACT.negligible * (start + end)
        self.second = CONTACT.negligible * (start * start + start * end + end * end) / 3.0
        self.along = self.first_along = 0.0
        self.low = self.high = math.nan


class ContactFit:
    """Positions, forces and probabilities of one contact on straight links.

    A link is divided into pieces: those of the grid, its ends where another link follows, and, of the last link, those
    of a force along it: on its surface, and on its end.

    Parameters
    ----------
    start, end : (links,), m, ends of each link along x.
    radius : (links,), m, of the tubes.
    parameters : prior probabilities.
    """

    def __init__(
        self, start: Sequence[float], end: Sequence[float], radius: Sequence[float], parameters: InferenceParameters
    ) -> None:
        self._given, self._ends = parameters, list(zip(start, end, strict=True))
        self._precision = parameters.force_scale**-2
        # places where the size of the force is tried
        self._tried = [[a + (b - a) * part for part in (1 / 6, 1 / 2, 5 / 6)] for a, b in self._ends]
        # moment arms, m, of a force about the axis by its line and by its friction around the tube
        self._arms = [(parameters.moment_arm_offset * r, parameters.friction * r) for r in radius]
        # logs of the frequency of contacts per metre, along the links and where they meet
        self._frequency = [_log(w / (b - a)) for (a, b), w in zip(self._ends, parameters.weights, strict=True)]
        self._end_frequency, half = _log(parameters.end_weight / CONTACT.end_length), 0.5 * CONTACT.end_length
        last = len(self._ends) - 1
        self._meeting = [[a + half] * (i > 0) + [b - half] * (i < last) for i, (a, b) in enumerate(self._ends)]
        # of a force along the last link: the force across per force along, the moment arm, m, of the latter, position
        # and width, m, and the log of the frequency
        (a, b), slopes = self._ends[-1], CONTACT.end_slopes
        pieces = [(0.0, math.sqrt(0.5) * radius[-1], a + 0.5 * (b - a), b - a, 1)]
        pieces += [(slope, 0.0, b, CONTACT.end_length, len(slopes)) for slope in slopes]
        self._along_pieces = [
            (lean, arm, x, width, _log(parameters.along_weight / (count * width)))
            for lean, arm, x, width, count in pieces
        ]

    def __call__(self, gram: Array, other: float = -math.inf) -> list[Fit]:
        """Fit a contact to each link.

        Parameters
        ----------
        gram : (links, 7, 7), Z^T S^-1 Z for each link.
        other : log of the probability of the torques, with its weight, if no contact but something else explains them.
        """
        grams: list[Gram] = gram.tolist()
        links = [self._link(i, one) for i, one in enumerate(grams)]
        pieces, axial, left = self._along(grams[-1])
        for i, link in enumerate(links):
            pieces += self._grid(i, link)
        pieces.sort(reverse=True)
        floor = pieces[0][0] - CONTACT.search_depth
        pieces = [piece for piece in pieces if piece[0] > floor]
        parts, total = self._parts(pieces)
        total += math.exp(min(other - pieces[0][0], CONTACT.largest_exponent))
        each = zip(links, parts, self._ends, strict=True)
        return [self._fit(link, part, total, ends, axial, left, grams[-1]) for link, part, ends in each]

    def _link(self, i: int, gram: Gram) -> _Link:
        """A link with the tangential force in the covariance, of the size at the likeliest of some places.

        Twist: the line of the force has a moment arm about the axis.  Axial: a friction force along the surface, one
        radius off the axis.
        """
        link, (arm, turn) = _Link.of(gram, self._precision, 0.0), self._arms[i]
        largest = math.hypot(*max(map(link.force, self._tried[i]))[1])
        _, (f1, f2), _ = link.force(max(self._tried[i], key=link.log_density))
        size = math.hypot(f1, f2) + CONTACT.smallest_force
        twist, axial, turn1, turn2 = arm * size, self._given.friction * size, turn * f1, turn * f2
        u = [twist * g for g in gram[TWIST]]
        v = [axial * g + turn1 * a + turn2 * b for g, a, b in zip(gram[AXIAL], gram[3], gram[4])]  # noqa: B905
        w12 = axial * u[AXIAL] + turn1 * u[3] + turn2 * u[4]
        w22 = 1.0 + (axial * v[AXIAL] + turn1 * v[3] + turn2 * v[4])
        wide, volume = widened(gram, u[:5], v[:5], 1.0 + twist * u[TWIST], w12, w22)
        precision = min(self._precision, 1.0 / (largest * largest + CONTACT.smallest_force))
        return _Link.of(wide, precision, volume + 2.0 * self._log_rarity(largest))

    def _log_rarity(self, size: float) -> float:
        """Log of how much rarer a force of a size, N, is: above its scale in inverse proportion to the size."""
        return math.log(max(size / self._given.force_scale, 1.0))

    def _grid(self, i: int, link: _Link) -> list[Piece]:
        """Pieces with a contact from the side; a peak that is narrower than some is divided into pieces of its own.

        Where two links meet, a contact is more frequent than elsewhere along them.
        """
        low, high = start, end = self._ends[i]
        count = self._given.positions
        for refined in range(CONTACT.refinements + 1):
            width = (high - low) / count
            found = [(link.log_density(x), x) for x in [low + (k + 0.5) * width for k in range(count)]]
            floor = max(found)[0] - CONTACT.search_depth
            likely = [each for each in found if each[0] > floor]
            if 2 * len(likely) >= CONTACT.peak_positions or refined == CONTACT.refinements:
                break
            low, high = max(likely[0][1] - width, start), min(likely[-1][1] + width, end)
            count = CONTACT.peak_positions
        constant = link.constant + self._frequency[i]
        pieces = [(value + constant, place, width, i, False) for value, place in likely]
        constant, width = link.constant + self._end_frequency, CONTACT.end_length
        return pieces + [(link.log_density(x) + constant, x, width, i, False) for x in self._meeting[i]]

    def _along(self, gram: Gram) -> tuple[list[Piece], float, float]:
        """A force along the last link: on its surface, anywhere, or on its end, with little or much force across.

        A force along the tube equals the same force at its start: no joint torques distinguish them.  Returns its size,
        N, and what the best of them does not explain, chi^2, too.
        """
        scale, precision, (_, end) = self._given.force_scale, self._precision, self._ends[-1]
        r, a1, a2, b1, b2, _, axial = gram
        size = abs(r[AXIAL]) / (axial[AXIAL] + precision) + CONTACT.smallest_force
        rarity, inner = self._log_rarity(size), [[r[0], r[AXIAL]], [r[AXIAL], axial[AXIAL]]]
        found: list[Piece] = []
        left = math.inf
        for slope, arm, x, width, frequency in self._along_pieces:
            lean = slope * size
            far = lean * end + arm * size
            u = [lean * a + far * b for a, b in zip(a1, b1)]  # noqa: B905
            v = [lean * a + far * b for a, b in zip(a2, b2)]  # noqa: B905
            w11, w12, w22 = 1.0 + (lean * u[1] + far * u[3]), lean * u[2] + far * u[4], 1.0 + (lean * v[2] + far * v[4])
            ((rr, ra), (_, aa)), volume = widened(inner, [u[0], u[AXIAL]], [v[0], v[AXIAL]], w11, w12, w22)
            value = log_evidence(rr, ra, aa, max(scale, size)) - 0.5 * volume - rarity
            found.append((value + frequency, x, width, len(self._ends) - 1, True))
            left = min(left, rr - ra * ra / (aa + precision))
        return found, size, left

    def _at_start(self, gram: Gram) -> tuple[float, Triple]:
        """The part of r^T W r that the smallest force at the start of the last link explains, and it, see `Fit`."""
        at = (1, 2, AXIAL)
        matrix = np.array([[gram[i][j] for j in at] for i in at]) + self._precision * np.eye(3)
        right = np.array([gram[0][i] for i in at])
        force = solution(matrix, right)
        f1, f2, along = force.tolist()
        return float(force.dot(right)), (f1, f2, along)

    def _parts(self, pieces: list[Piece]) -> tuple[list[_Part], float]:
        """What the pieces, the most probable first, are of each link, and the sum of their weights."""
        top = pieces[0][0]
        weights = [math.exp(value - top) * width for value, _, width, _, _ in pieces]
        total, passed = sum(weights), 0.0
        enough, parts = CONTACT.reported_probability * total, [_Part(*ends) for ends in self._ends]
        for weight, (_, x, width, i, is_along) in zip(weights, pieces):  # noqa: B905
            part = parts[i]
            part.mass += weight
            part.first += weight * x
            part.second += weight * (x * x + width * width / 12.0)
            if is_along:
                part.along += weight
                part.first_along += weight * x
            if passed < enough:
                passed += weight
                low, high = x - 0.5 * width, x + 0.5 * width
                # of the last one what fills the set, on the side of the others; an end is not divided
                if passed > enough and width != CONTACT.end_length:
                    unused = width * (passed - enough) / weight
                    below = 0.5 if math.isnan(part.low) else float(x > part.low)
                    low, high = low + (1.0 - below) * unused, high - below * unused
                part.low, part.high = min(low, part.low), max(high, part.high)  # in this order never a NaN
        return parts, total

    def _fit(self, link: _Link, part: _Part, total: float, ends: Pair, axial: float, left: float, last: Gram) -> Fit:
        start, end = ends
        is_along, rest = part.along > 0.5 * part.mass, part.mass - part.along
        side = min(max((part.first - part.first_along) / max(rest, CONTACT.negligible), start), end)
        place = min(max(part.first_along / part.along, start), end) if is_along else side
        variance = max(0.0, (part.second - 2.0 * place * part.first) / part.mass + place * place)
        explained, force, (s11, s12, s22) = link.force(place)
        step = 0.5 * (end - start) / self._given.positions
        _, ahead, _ = link.force(place + step)
        d1, d2 = (ahead[0] - force[0]) / step, (ahead[1] - force[1]) / step
        size = math.hypot(*force) + CONTACT.smallest_force
        u1, u2 = force[0] / size, force[1] / size
        s11, s12, s22 = s11 + d1 * d1 * variance, s12 + d1 * d2 * variance, s22 + d2 * d2 * variance
        radial = u1 * (u1 * s11 + 2.0 * u2 * s12) + u2 * u2 * s22
        if is_along:  # or it is across, elsewhere: the force that is likeliest here is neither
            across = math.hypot(*link.force(side)[1])
            radial += (part.along * (axial - size) ** 2 + rest * (across - size) ** 2) / part.mass
        at_end, (e1, e2), _ = link.force(end)
        at_start, from_start = self._at_start(last) if is_along else (0.0, ZERO)
        about = u2 * (u2 * s11 - 2.0 * u1 * s12) + u1 * u1 * s22
        return Fit(
            probability=part.mass / total,
            position=place,
            position_sd=math.sqrt(variance),
            low=max(part.low, start),
            high=min(part.high, end),
            along=part.along / part.mass,
            force=force,
            force_sd=math.sqrt(radial),
            direction_sd=min(math.sqrt(about) / size, math.pi),
            torque_position_sd=link.torque_position_sd(place, force),
            is_at_start=at_start > at_end,
            smallest=from_start if at_start > at_end else (e1, e2, 0.0),
            residual=max(0.0, left if is_along else link.gram[0][0] - explained - link.precision * size * size),
        )


def _log(value: float) -> float:
    """Natural logarithm, of 0, too."""
    return math.log(value) if value else -math.inf
