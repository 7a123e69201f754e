"""One contact on one of several straight links: the posterior on a grid of its positions, the force integrated out.

A contact at position x pushes across the link, tau_ext = (A + x B) f, with f the two components of the force across the
link, N.  Friction adds a tangential force.  Around the link it gives the force a moment arm about the tube's axis, a
twist t; along the link it adds a force a, which acts at the surface and so has a moment, too.  Both are unknown and
proportional to force and friction.

Every hypothesis explains the torques r by some torques C of forces with normal priors:

    log p = -1/2 (r^T S'^-1 r + log |S'| / |S|),  S' = S + C C^T.

All that is needed of arm and torques are inner products, weighted with the inverse of the covariance S: the Gram matrix
of Z = (r, A_1, A_2, B_1, B_2, t, a), 7 by 7.  With S' it is G - U (1 + V)^-1 U^T, U = Z^T S^-1 C, V = C^T S^-1 C
(Woodbury).  That of (r, C) alone gives log p: with 1 added to the variance of each of C, its determinant is |1 + V|
times r^T S'^-1 r.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.contact.inference_parameters import InferenceParameters
from wam_control.contact.thresholds import CONTACT
from wam_description.small_matrices import inverse

Array = NDArray[np.float64]
Pair = tuple[float, float]
Triple = tuple[float, float, float]
Gram = list[list[float]]
TWIST, AXIAL = 5, 6  # among these columns


class Fit(NamedTuple):
    """The most likely contact on one link.

    Attributes
    ----------
    probability : of this link among all hypotheses.
    position : m, mean contact position, of the likelier ones of forces from the side and along the tube: a mean of both
        would be where neither is.
    position_sd : m, root mean square distance of the contact from there, by both.
    low, high : m, ends of the part of the link that is in the 90 % set, NaN where none is.
    along : probability that the force is along the tube, of a contact on this link.
    force : (2,), N, most likely components across the link at `position`.
    force_sd : N, standard deviation of the size of the force, the position unknown.
    direction_sd : rad, standard deviation of its direction about the link, the position unknown.
    torque_position_sd : m, standard deviation of the position by the torques alone, without priors of position
        and force; infinite where they do not determine it.
    force_at_end : (2,), N, the force if the position were the end of the link, the longest lever.
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
    force_at_end: Pair
    residual: float


def log_evidence(gram: Array) -> Array:
    """Log of the probability of torques r by torques C of unit variance, up to the constant -1/2 log |S|.

    `gram` (..., k, k) is that of (r, C).
    """
    wide = gram + np.diag([0.0] + [1.0] * (gram.shape[-1] - 1))
    whole, volume = (np.linalg.slogdet(part)[1] for part in (wide, wide[..., 1:, 1:]))
    found: Array = -0.5 * (np.exp(whole - volume) + volume)
    return found


class _Link(NamedTuple):
    """A force across a link, by the Gram matrix of r, A_1, A_2, B_1, B_2.

    Attributes
    ----------
    gram : 5 by 5, or larger.
    precision : 1/N^2, of the prior of each component of the force.
    constant : log of the probability of the torques without a force across.
    terms : (15,), coefficients of 1, x, x^2 in G^T W G + precision, 11, 12, 22, and in G^T W r, 1, 2, with G = A + x B.
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
        terms = (*n11, *n12, a2[2] + precision, 2.0 * a2[4], b2[4], r[1], r[3], 0.0, r[2], r[4], 0.0)
        return cls(gram, precision, math.log(precision) - 0.5 * (r[0] + volume), terms)

    def force(self, x: Any) -> Any:
        """Most likely force at x, the part of r^T W r that it explains, its covariance 11, 12, 22; for arrays, too."""
        p0, p1, p2, q0, q1, q2, s0, s1, s2, c0, c1, _, e0, e1, _ = self.terms
        n11, n12, n22 = p0 + x * (p1 + x * p2), q0 + x * (q1 + x * q2), s0 + x * (s1 + x * s2)
        torque1, torque2 = c0 + x * c1, e0 + x * e1
        determinant = n11 * n22 - n12 * n12
        f1, f2 = (n22 * torque1 - n12 * torque2) / determinant, (n11 * torque2 - n12 * torque1) / determinant
        return (f1, f2), f1 * torque1 + f2 * torque2, (n22 / determinant, -n12 / determinant, n11 / determinant)

    def log_density(self, x: Array) -> Array:
        """Log of the probability of the torques for a contact at positions x."""
        _, explained, (s11, s12, s22) = self.force(x)
        found: Array = 0.5 * (explained + np.log(s11 * s22 - s12 * s12)) + self.constant
        return found

    def torque_position_sd(self, x: float, force: Pair) -> float:
        """Standard deviation of the position, m, by the torques alone, the force unknown: a Schur complement.

        Not by a pseudo-inverse of the whole information, which is small exactly where the position is undetermined.
        """
        _, a1, a2, b1, b2 = self.gram[:5]
        f1, f2 = force
        _, _, (s11, s12, s22) = _Link.of(self.gram, self.precision * CONTACT.weak_prior, 0.0).force(x)
        v1 = f1 * (a1[3] + x * b1[3]) + f2 * (a1[4] + x * b1[4])
        v2 = f1 * (a2[3] + x * b1[4]) + f2 * (a2[4] + x * b2[4])
        known = v1 * v1 * s11 + 2.0 * v1 * v2 * s12 + v2 * v2 * s22
        information = f1 * f1 * b1[3] + 2.0 * f1 * f2 * b1[4] + f2 * f2 * b2[4] - known
        return float(information) ** -0.5 if information > 0.0 else math.inf


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
        given = self._given = parameters
        count, tip, slopes = given.positions, CONTACT.end_length, np.array(CONTACT.end_slopes)
        self._ends, self._radius = list(zip(start, end, strict=True)), list(radius)
        self._steps = (np.arange(count) + 0.5) / count  # the middle of each
        # of each piece: weight, then log of the frequency of contacts, per metre; position, width, m; link
        pieces = []
        for i, ((low, high), weight) in enumerate(zip(self._ends, given.weights, strict=True)):
            pieces += [(weight / count, low, (high - low) / count, i)] * count
            pieces.append((given.end_weight * (i > 0), low, tip, i))
            pieces.append((given.end_weight * (i + 1 < len(self._ends)), high, tip, i))
        pieces.append((given.along_weight, 0.5 * (low + high), high - low, i))
        pieces += [(given.along_weight / len(slopes), high, tip, i)] * len(slopes)
        self._pieces = np.array(pieces).T
        self._of = 1.0 * (np.arange(i + 1)[:, None] == self._pieces[3])  # (links, pieces): 1 for those of each link
        self._pieces[0] = np.log(np.maximum(self._pieces[0] / self._pieces[2], CONTACT.least_chance))
        # by force along the last link: r, torques if its line is not the axis, in both directions across it, its own
        self._is_along = np.arange(-len(pieces), 0) >= -1 - len(slopes)
        self._along = np.zeros((1 + len(slopes), 7, 4))
        self._along[:, 0, 0] = self._along[:, AXIAL, 3] = 1.0
        self._along[0, 3, 1] = self._along[0, 4, 2] = math.sqrt(0.5) * radius[-1]
        for i in (1, 2):
            self._along[1:, i, i], self._along[1:, i + 2, i] = slopes, slopes * high

    def __call__(self, gram: Array, other: float = -math.inf) -> list[Fit]:
        """Fit a contact to each link.

        Parameters
        ----------
        gram : (links, 7, 7), Z^T S^-1 Z for each link.
        other : log of the probability of the torques, with its weight, if no contact but something else explains them.
        """
        links = self._links(gram)
        value, place, width, _ = self._on_links(links, gram[-1])
        top = float(value.max())
        weight = np.exp(np.maximum(value - top, -CONTACT.largest_exponent)) * width
        # half of each piece that is in the set, the most probable first; of the last one only what fills it
        order, room = np.argsort(-value), np.empty_like(weight)
        room[order] = CONTACT.reported_probability * weight.sum() - weight[order].cumsum()
        half = 0.5 * width * np.clip(room / weight + 1.0, 0.0, 1.0)
        is_in = self._of * half > 0.0
        low, high = np.where(is_in, place - half, math.inf), np.where(is_in, place + half, -math.inf)
        along = weight * self._is_along
        sums = weight, weight * place, weight * (place * place + width * width / 12.0), along, along * place
        parts = self._of @ np.array(sums).T
        total = float(weight.sum()) + math.exp(min(other - top, CONTACT.largest_exponent))
        found = zip(links, parts.tolist(), low.min(axis=1).tolist(), high.max(axis=1).tolist(), self._ends, strict=True)
        return [self._fit(*each, total) for each in found]

    def _links(self, gram: Array) -> list[_Link]:
        """The links with the tangential force in the covariance, of the size at the likeliest of some places.

        Twist: the line of the force has a moment arm about the axis.  Axial: a friction force along the surface, one
        radius off the axis.
        """
        given, columns, precisions = self._given, np.zeros((len(gram), 7, 2)), []
        for i, (one, (start, end), radius) in enumerate(zip(gram.tolist(), self._ends, self._radius, strict=True)):
            link = _Link.of(one, given.force_scale**-2, 0.0)
            found = [link.force(start + (end - start) * part) for part in (1 / 6, 1 / 2, 5 / 6)]
            largest = max([(explained, math.hypot(*force)) for force, explained, _ in found])[1]
            _, (f1, f2) = max([(each + math.log(s[0] * s[2] - s[1] * s[1]), force) for force, each, s in found])
            size, turn = math.hypot(f1, f2) + CONTACT.smallest_force, given.friction * radius
            columns[i, TWIST, 0] = given.moment_arm_offset * radius * size
            columns[i, 3:, 1] = turn * f1, turn * f2, 0.0, given.friction * size
            precisions.append(min(link.precision, 1.0 / (largest * largest + CONTACT.smallest_force)))
        products = gram @ columns
        inner = np.eye(2) + columns.transpose(0, 2, 1) @ products
        wide = gram - products @ inverse(inner) @ products.transpose(0, 2, 1)
        volume = np.linalg.slogdet(inner)[1]
        return [_Link.of(*each) for each in zip(wide.tolist(), precisions, volume.tolist(), strict=True)]

    def _on_links(self, links: Sequence[_Link], gram: Array) -> Array:
        """The pieces, (4, pieces), with the log of the density; where a peak is narrow, those of the grid are in it."""
        pieces, count = self._pieces.copy(), len(self._steps)
        for i, link in enumerate(links):
            low, high = self._ends[i]
            value, x, width, _ = pieces[:, i * (count + 2) : (i + 1) * (count + 2)]
            for _ in range(1 + CONTACT.refinements):
                width[:count] = step = (high - low) / count
                x[:count] = low + (high - low) * self._steps
                density = link.log_density(x)
                likely = x[:count][density[:count] > density[:count].max() - CONTACT.search_depth]
                if len(likely) >= CONTACT.few_positions:
                    break
                low, high = max(likely[0] - step, low), min(likely[-1] + step, high)
            value += density
        # a force along the tube equals the same force at its start: no joint torques distinguish them
        scale = self._given.force_scale
        size = abs(float(gram[0, AXIAL])) / (float(gram[AXIAL, AXIAL]) + scale**-2) + CONTACT.smallest_force
        basis = self._along * (1.0, size, size, max(scale, size))
        pieces[0, -len(basis) :] += log_evidence(basis.transpose(0, 2, 1) @ gram @ basis)
        return pieces

    def _fit(self, link: _Link, part: list[float], low: float, high: float, ends: Pair, total: float) -> Fit:
        (mass, first, second, along, first_along), (start, end) = part, ends
        place = first_along / along if along > 0.5 * mass else (first - first_along) / (mass - along)
        place = min(max(place, start), end)
        variance = max(0.0, (second - 2.0 * place * first) / mass + place * place)
        force, explained, (s11, s12, s22) = link.force(place)
        step = 0.5 * (end - start) / len(self._steps)
        ahead, _, _ = link.force(place + step)
        d1, d2 = (ahead[0] - force[0]) / step, (ahead[1] - force[1]) / step
        size = math.hypot(*force) + CONTACT.smallest_force
        u1, u2 = force[0] / size, force[1] / size
        s11, s12, s22 = s11 + d1 * d1 * variance, s12 + d1 * d2 * variance, s22 + d2 * d2 * variance
        radial = u1 * (u1 * s11 + 2.0 * u2 * s12) + u2 * u2 * s22
        about = u2 * (u2 * s11 - 2.0 * u1 * s12) + u1 * u1 * s22
        return Fit(
            probability=mass / total,
            position=place,
            position_sd=math.sqrt(variance),
            low=max(low, start) if low < high else math.nan,
            high=min(high, end) if low < high else math.nan,
            along=along / mass,
            force=force,
            force_sd=math.sqrt(radial),
            direction_sd=min(math.sqrt(about) / size, math.pi),
            torque_position_sd=link.torque_position_sd(place, force),
            force_at_end=link.force(end)[0],
            residual=max(0.0, link.gram[0][0] - explained - link.precision * size * size),
        )
