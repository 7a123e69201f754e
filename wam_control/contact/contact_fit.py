"""One contact on one of several straight links: probability of its position, the force integrated out.

A contact at position x pushes across the link, tau_ext = (A + x B) f, with f the two components of
the force across the link, N.  Friction adds a tangential force.  Around the link it gives the force
a moment arm about the tube's axis, a twist t; along the link it adds a force a, which acts at the
surface and so has a moment, too.  Both are unknown and proportional to force and friction.  All that
is needed of arm and torques are inner products, weighted with the inverse of the covariance: the
Gram matrix of Z = (r, A_1, A_2, B_1, B_2, t, a), 7 by 7.

Small operations are scalar Python; only the row of positions is a numpy array.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.contact.thresholds import CONTACT

Array = NDArray[np.float64]
Pair = tuple[float, float]
Triple = tuple[float, float, float]


class Fit(NamedTuple):
    """The most likely contact on one link.

    Attributes
    ----------
    position : m, mean contact position, of the likelier ones of forces from the side and along the tube: a mean of both
        would be where neither is.
    position_sd : m, root mean square distance of the contact from there, by both.
    force : (2,), N, most likely components across the link at `position`.
    force_sd : N, standard deviation of the size of the force, the position unknown.
    direction_sd : rad, standard deviation of its direction about the link, the position unknown.
    torque_position_sd : m, standard deviation of the position by the torques alone, without priors of position
        and force; infinite where they do not determine it.
    force_at_end : (2,), N, the force if the position were the end of the link, the longest lever.
    residual : what the best contact does not explain, chi^2.
    probability : of this link among all.
    low, high : m, ends of the part of the link that is in the 90 % set, NaN where none is.
    along : probability that the force is along the tube, of a contact on this link.
    """

    position: float
    position_sd: float
    force: Pair
    force_sd: float
    direction_sd: float
    torque_position_sd: float
    force_at_end: Pair
    residual: float
    probability: float
    low: float
    high: float
    along: float


Terms = tuple[Triple, Triple, Triple, Triple, Triple]
Quartic = tuple[float, float, float, float, float]  # coefficients of 1, x, .., x^4
Triangle = tuple[float, ...]  # 15: the rows of the upper triangle of a matrix 5 by 5, one after the other
# a piece of a link: log of the probability density of a contact, per metre; position and width, m; link; whether it is
# that of a force along the tube
Cell = tuple[float, float, float, int, bool]


class ContactFit:
    """Positions, forces and probabilities of one contact on straight links.

    Parameters
    ----------
    start, end : (links,), m, ends of each link along x.
    radius : (links,), m, of the tubes.
    weights : (links,), relative frequency of contacts on each.
    force_scale : N, prior sd of each component of the force.
    moment_arm_offset : sd of the distance between the line of the force and the axis of the tube, per radius.
    friction : sd of the friction force along the link, per force.
    positions : number of positions tried on each link, at least 3.
    end_weight : weight of a contact where two links meet, on each.
    along_weight : weight of a force along the last link on its surface, and of one on its end.
    """

    def __init__(
        self,
        start: Sequence[float],
        end: Sequence[float],
        radius: Sequence[float],
        weights: Sequence[float],
        *,
        force_scale: float,
        moment_arm_offset: float,
        friction: float,
        positions: int,
        end_weight: float,
        along_weight: float,
    ) -> None:
        self._ends = list(zip(start, end, strict=True))
        self._radius = list(radius)
        self._offset = [moment_arm_offset * r for r in radius]
        # logs of the metres over which a contact is distributed
        self._log_length = [math.log((b - a) / weight) for (a, b), weight in zip(self._ends, weights, strict=True)]
        self._precision, self._friction = force_scale**-2, friction
        self._end_weight, self._along_weight = end_weight, along_weight
        self._thirds = [[a + (b - a) * part for part in (1 / 6, 1 / 2, 5 / 6)] for a, b in self._ends]
        self._widths = [(b - a) / positions for a, b in self._ends]
        steps = (np.arange(positions) + 0.5) / positions  # the middle of each
        row = np.array([a + (b - a) * steps for a, b in self._ends])
        self._row = row.tolist()
        self._powers = np.stack([row**k for k in range(5)], axis=1)

    def __call__(self, gram: Array, other: float = -math.inf) -> list[Fit]:
        """Fit a contact to each link.

        Parameters
        ----------
        gram : (links, 7, 7), Z^T S^-1 Z for each link.
        other : log of the probability of the torques, with its weight, if no contact but something else explains them.
        """
        full = gram.tolist()
        links = [
            _Link(*_with_tangential_force(one, self._precision, places, offset, self._friction, radius))
            for one, places, offset, radius in zip(full, self._thirds, self._offset, self._radius, strict=True)
        ]
        log_density = self._log_density(links)
        top = max(map(max, log_density))
        cells: list[Cell] = []
        for i, link in enumerate(links):
            cells += self._cells(i, link, log_density[i], top)
            cells += self._at_ends(i, link, top - CONTACT.search_depth) + self._along(
                i, full[i], top - CONTACT.search_depth
            )
        parts = self._parts(sorted(cells, reverse=True), other)
        return [self._fit(i, link, *part) for i, (link, part) in enumerate(zip(links, parts, strict=True))]

    def _log_density(self, links: "list[_Link]") -> list[list[float]]:
        """Log of the probability of the torques for a contact at each position, up to a constant.

        -1/2 (r^T (S + s^2 G G^T)^-1 r + log abs(1 + s^2 G^T W G)), G = A + x B, s the scale of the force;
        all positions on a link are equally likely a priori.
        """
        explained, determinant = (np.array([link.ratio for link in links]) @ self._powers).transpose(1, 0, 2)
        constant = [
            [2.0 * (link.constant + log_length)] for link, log_length in zip(links, self._log_length, strict=True)
        ]
        log_density = 0.5 * (explained / determinant - np.log(determinant) - constant)
        result: list[list[float]] = log_density.tolist()
        return result

    def _cells(self, i: int, link: "_Link", values: list[float], top: float) -> list[Cell]:
        """The positions of a link that matter; a narrow peak is refined.

        Such a peak is the exponential of a parabola, found by parabolas through three positions, ever closer.
        """
        row, width, floor = self._row[i], self._widths[i], top - CONTACT.search_depth
        top_value = max(values)
        if top_value <= floor:
            return []
        cells = [(value, x, width, i, False) for value, x in zip(values, row, strict=True) if value > floor]
        if len(cells) >= CONTACT.few_positions:
            return cells
        peak = values.index(top_value)
        (start, end), x, near, last = self._ends[i], row[peak], width, len(values) - 1
        inside = 0 < peak < last
        before, at, after = (values[peak - 1], top_value, values[peak + 1]) if inside else self._three(link, x, near)
        for again in (True, True, False):
            slope, bend = 0.5 * (after - before) / near, (0.5 * (after + before) - at) / (near * near)
            if bend >= 0.0:
                return cells
            step = -0.5 * slope / bend
            x, near = x + min(max(step, -width), width), 0.25 * near
            if again:
                x = min(max(x, start), end)
                before, at, after = self._three(link, x, near)
        at, sd = link.log_density(x) - link.constant - self._log_length[i], math.sqrt(-0.5 / bend)
        left, right = max(start, x - 4.0 * sd), min(end, x + 4.0 * sd)
        if left >= right:  # the peak lies beyond the end of the link, which gets all of it
            left, right = (end - sd, end) if x > end else (start, start + sd)
        part = (right - left) / CONTACT.peak_positions
        positions = [left + (k + 0.5) * part for k in range(CONTACT.peak_positions)]
        return [(at + bend * (position - x) ** 2, position, part, i, False) for position in positions]

    @staticmethod
    def _three(link: "_Link", x: float, near: float) -> tuple[float, float, float]:
        return link.log_density(x - near), link.log_density(x), link.log_density(x + near)

    def _parts(self, cells: list[Cell], other: float) -> list[tuple[float, float, float, float, float, float]]:
        """Of each link: probability, place and variance, ends of the 90 % set, fraction of forces along; see `Fit`.

        The set takes the most probable positions first: `cells` are in this order.
        """
        top = cells[0][0]
        sums = [[0.0, 0.0, 0.0, 0.0, 0.0] for _ in self._ends]
        weights = []
        for value, x, width, i, is_along in cells:
            weight = math.exp(value - top) * width
            weights.append(weight)
            mine = sums[i]
            mine[0] += weight
            mine[1] += weight * x
            mine[2] += weight * (x * x + width * width / 12.0)
            if is_along:
                mine[3] += weight
                mine[4] += weight * x
        total, passed = sum(weights), 0.0
        enough = CONTACT.reported_probability * total
        total += math.exp(min(other - top, CONTACT.largest_exponent))
        inside = [[math.inf, -math.inf] for _ in self._ends]
        for weight, (_, x, width, i, _) in zip(weights, cells, strict=True):
            if passed >= enough:
                break
            # of the last piece only the part that fills the set, on the side of the others; an end is not divided
            passed += weight
            unused = width * (passed - enough) / weight if passed > enough and width != CONTACT.end_length else 0.0
            part, half = inside[i], 0.5 * width
            low, high = x - half, x + half
            if part[0] > part[1]:
                part[0], part[1] = low + 0.5 * unused, high - 0.5 * unused
            elif low + unused < part[0]:
                part[0] = low + unused
            elif high - unused > part[1]:
                part[1] = high - unused
        result = []
        for (mass, first, second, *along), (low, high), (start, end) in zip(sums, inside, self._ends, strict=True):
            if mass == 0.0:
                result.append((0.0, 0.5 * (start + end), (end - start) ** 2 / 12.0, math.nan, math.nan, 0.0))
                continue
            own, where = along if along[0] > 0.5 * mass else (mass - along[0], first - along[1])
            place = min(max(where / own, start), end)
            variance = max(0.0, (second - 2.0 * place * first) / mass + place * place)
            ends = (max(low, start), min(high, end)) if low < high else (math.nan, math.nan)
            result.append((mass / total, place, variance, *ends, along[0] / mass))
        return result

    def _at_ends(self, i: int, link: "_Link", floor: float) -> list[Cell]:
        """A contact where two links meet, which is more frequent there than elsewhere along them."""
        if not self._end_weight:
            return []
        start, end = self._ends[i]
        places = [start + 0.5 * CONTACT.end_length] * (i > 0) + [end - 0.5 * CONTACT.end_length] * (
            i + 1 < len(self._ends)
        )
        offset = math.log(self._end_weight / CONTACT.end_length) - link.constant
        values = [link.log_density(x) + offset for x in places]
        return [
            (value, x, CONTACT.end_length, i, False) for value, x in zip(values, places, strict=True) if value > floor
        ]

    def _along(self, i: int, gram: list[list[float]], floor: float) -> list[Cell]:
        """A force along the last link: on its surface, anywhere, or on its end, with little or much force across.

        A force along the tube equals the same force at its start: no joint torques distinguish them.
        """
        (rr, ra1, ra2, rb1, rb2, _, ra), g1, g2, g3, g4, _, axial = gram
        aa, precision, weight = axial[6], self._precision, self._along_weight
        if not weight or aa < CONTACT.weak_prior * precision or i + 1 < len(self._ends):
            return []
        start, end = self._ends[i]
        size = abs(ra) / (aa + precision) + CONTACT.smallest_force
        base, precision = math.log(weight), min(precision, size**-2)
        surface = (g3[3], g3[4], g4[4], rb1, rb2, g3[6], g4[6])
        value = base + _log_evidence(rr, ra, aa, precision, surface, 0.5 * (self._radius[i] * size) ** 2)
        value, width = value - math.log(end - start), self._widths[i]
        across = (
            g1[1] + end * (2.0 * g1[3] + end * g3[3]),
            g1[2] + end * (g1[4] + g2[3] + end * g3[4]),
            g2[2] + end * (2.0 * g2[4] + end * g4[4]),
            ra1 + end * rb1,
            ra2 + end * rb2,
            g1[6] + end * g3[6],
            g2[6] + end * g4[6],
        )
        caps = [base + _log_evidence(rr, ra, aa, precision, across, (lean * size) ** 2) for lean in CONTACT.end_slopes]
        cells: list[Cell] = [(value, x, width, i, True) for x in self._row[i]] if value > floor else []
        caps = [cap - math.log(len(CONTACT.end_slopes) * CONTACT.end_length) for cap in caps]
        return cells + [(cap, end, CONTACT.end_length, i, True) for cap in caps if cap > floor]

    def _fit(
        self,
        i: int,
        link: "_Link",
        probability: float,
        place: float,
        variance: float,
        low: float,
        high: float,
        along_tube: float,
    ) -> Fit:
        force, explained, (s11, s12, s22) = link.force(place)
        step = 0.5 * self._widths[i]
        ahead, _, _ = link.force(place + step)
        d1, d2 = (ahead[0] - force[0]) / step, (ahead[1] - force[1]) / step
        size = math.hypot(*force) + CONTACT.smallest_force
        u1, u2 = force[0] / size, force[1] / size
        along = u1 * (u1 * s11 + 2.0 * u2 * s12) + u2 * u2 * s22 + (u1 * d1 + u2 * d2) ** 2 * variance
        about = u2 * (u2 * s11 - 2.0 * u1 * s12) + u1 * u1 * s22 + (u1 * d2 - u2 * d1) ** 2 * variance
        return Fit(
            position=place,
            position_sd=math.sqrt(variance),
            force=force,
            force_sd=math.sqrt(along),
            direction_sd=min(math.sqrt(about) / size, math.pi),
            torque_position_sd=link.torque_position_sd(place, force),
            force_at_end=link.force(self._ends[i][1])[0],
            residual=max(0.0, link.rr - explained - link.precision * size * size),
            probability=probability,
            low=low,
            high=high,
            along=along_tube,
        )


class _Link:
    """The weighted least squares problem of one link, by the Gram matrix of r, A_1, A_2, B_1, B_2."""

    def __init__(self, triangle: Triangle, precision: float, log_widening: float) -> None:
        self.rr, *_ = triangle
        self._slopes = triangle[7:9] + triangle[10:]
        self.precision = precision
        self.constant = 0.5 * (self.rr + log_widening)  # subtracted from the log of the probability at every position
        self.terms = _terms(triangle, precision)
        self.ratio = _explained(self.terms)

    def force(self, x: float) -> tuple[Pair, float, Triple]:
        """See `_force`."""
        return _force(self.terms, x)

    def log_density(self, x: float) -> float:
        """Log of the probability of the torques for a contact at x, up to a constant of the link; see `ContactFit`."""
        (m0, m1, m2, m3, m4), (d0, d1, d2, d3, d4) = self.ratio
        determinant = d0 + x * (d1 + x * (d2 + x * (d3 + x * d4)))
        return 0.5 * ((m0 + x * (m1 + x * (m2 + x * (m3 + x * m4)))) / determinant - math.log(determinant))

    def torque_position_sd(self, x: float, force: Pair) -> float:
        """Standard deviation of the position, m, by the torques alone, the force unknown: a Schur complement.

        Not by a pseudo-inverse of the whole information, which is small exactly where the position is undetermined.
        """
        (p0, p1, p2), (q0, q1, q2), (s0, s1, s2) = self.terms[:3]
        a1b1, a1b2, a2b1, a2b2, b11, b12, b22 = self._slopes
        f1, f2 = force
        less = self.precision * (1.0 - CONTACT.weak_prior)
        n11, n12, n22 = p0 + x * (p1 + x * p2) - less, q0 + x * (q1 + x * q2), s0 + x * (s1 + x * s2) - less
        v1 = f1 * (a1b1 + x * b11) + f2 * (a1b2 + x * b12)
        v2 = f1 * (a2b1 + x * b12) + f2 * (a2b2 + x * b22)
        known = (v1 * v1 * n22 - 2.0 * v1 * v2 * n12 + v2 * v2 * n11) / (n11 * n22 - n12 * n12)
        information = f1 * f1 * b11 + 2.0 * f1 * f2 * b12 + f2 * f2 * b22 - known
        return 1.0 / math.sqrt(information) if information > 0.0 else math.inf


def log_evidence_of_weight(gram: Array, least: float) -> float:
    """Log of the probability of external torques, if a force of one direction and sign explains them.

    As that of contacts in `ContactFit`: -1/2 (r^T S'^-1 r + log abs(S')/abs(S)), S' = S + a a^T / least, and twice the
    probability that the force is positive.

    Parameters
    ----------
    gram : (7, 7), of the torques r and, first of the others, the torques a of the force 1.
    least : inverse of the prior variance of the force.
    """
    rr, ra, aa = float(gram[0, 0]), float(gram[0, 1]), float(gram[1, 1]) + least
    positive = 0.5 * math.erfc(-ra / math.sqrt(2.0 * aa))
    return -0.5 * (rr - ra * ra / aa + math.log(aa / least)) + math.log(2.0 * max(positive, CONTACT.least_chance))


def _log_evidence(
    rr: float, ra: float, aa: float, precision: float, across: tuple[float, ...], variance: float
) -> float:
    """Log of the probability of the torques for one force and two more across it of a variance.

    -1/2 (r^T S'^-1 r + log abs(S')/abs(S)), S' = S + a a^T / precision + variance (c_1 c_1^T + c_2 c_2^T); `across` are
    the products c_1 c_1, c_1 c_2, c_2 c_2, r c_1, r c_2, a c_1, a c_2, weighted with S^-1.
    """
    c11, c12, c22, r1, r2, a1, a2 = across
    n11, n22 = 1.0 + variance * c11, 1.0 + variance * c22
    n12 = variance * c12
    determinant = max(n11 * n22 - n12 * n12, 1.0 + variance * (c11 + c22))  # at least this, but for rounding
    w11, w12, w22 = variance * n22 / determinant, -variance * n12 / determinant, variance * n11 / determinant
    rr -= w11 * r1 * r1 + 2.0 * w12 * r1 * r2 + w22 * r2 * r2
    aa = max(0.0, aa - (w11 * a1 * a1 + 2.0 * w12 * a1 * a2 + w22 * a2 * a2))
    ra -= w11 * r1 * a1 + w12 * (r1 * a2 + r2 * a1) + w22 * r2 * a2
    return -0.5 * (rr - ra * ra / (aa + precision) + math.log(1.0 + aa / precision) + math.log(determinant))


def _terms(triangle: Triangle, precision: float) -> Terms:
    """Coefficients of 1, x, x^2 in G^T W G, 11, 12, 22, and in G^T W r, 1, 2."""
    _, ra1, ra2, rb1, rb2, a11, a12, a1b1, a1b2, a22, a2b1, a2b2, b11, b12, b22 = triangle
    return (
        (a11 + precision, 2.0 * a1b1, b11),
        (a12, a1b2 + a2b1, b12),
        (a22 + precision, 2.0 * a2b2, b22),
        (ra1, rb1, 0.0),
        (ra2, rb2, 0.0),
    )


def _explained(terms: Terms) -> tuple[Quartic, Quartic]:
    """What a force at x explains of r^T W r, as a ratio of two polynomials of x; the second is the determinant."""
    (p0, p1, p2), (q0, q1, q2), (s0, s1, s2), (c0, c1, _), (e0, e1, _) = terms
    f0, f1, f2 = c0 * c0, 2.0 * c0 * c1, c1 * c1
    g0, g1, g2 = 2.0 * c0 * e0, 2.0 * (c0 * e1 + c1 * e0), 2.0 * c1 * e1
    h0, h1, h2 = e0 * e0, 2.0 * e0 * e1, e1 * e1
    return (
        (
            f0 * s0 - g0 * q0 + h0 * p0,
            f0 * s1 + f1 * s0 - g0 * q1 - g1 * q0 + h0 * p1 + h1 * p0,
            f0 * s2 + f1 * s1 + f2 * s0 - g0 * q2 - g1 * q1 - g2 * q0 + h0 * p2 + h1 * p1 + h2 * p0,
            f1 * s2 + f2 * s1 - g1 * q2 - g2 * q1 + h1 * p2 + h2 * p1,
            f2 * s2 - g2 * q2 + h2 * p2,
        ),
        (
            p0 * s0 - q0 * q0,
            p0 * s1 + p1 * s0 - 2.0 * q0 * q1,
            p0 * s2 + p1 * s1 + p2 * s0 - 2.0 * q0 * q2 - q1 * q1,
            p1 * s2 + p2 * s1 - 2.0 * q1 * q2,
            p2 * s2 - q2 * q2,
        ),
    )


def _force(terms: Terms, x: float) -> tuple[Pair, float, Triple]:
    """Most likely force at position x, the part of r^T W r that it explains, and its covariance 11, 12, 22."""
    (p0, p1, p2), (q0, q1, q2), (s0, s1, s2), (c0, c1, _), (e0, e1, _) = terms
    n11, n12, n22 = p0 + x * (p1 + x * p2), q0 + x * (q1 + x * q2), s0 + x * (s1 + x * s2)
    torque1, torque2 = c0 + x * c1, e0 + x * e1
    determinant = n11 * n22 - n12 * n12
    f1, f2 = (n22 * torque1 - n12 * torque2) / determinant, (n11 * torque2 - n12 * torque1) / determinant
    return (f1, f2), f1 * torque1 + f2 * torque2, (n22 / determinant, -n12 / determinant, n11 / determinant)


def _with_tangential_force(
    gram: list[list[float]], precision: float, places: Sequence[float], offset: float, friction: float, radius: float
) -> tuple[Triangle, float, float]:
    """Arguments of `_Link` with the tangential force in the covariance, of the size at the likeliest of some places.

    Twist: the line of the force has a moment arm about the axis.  Axial: a friction force along the
    surface, one radius off the axis.  With z these two as torques of one standard deviation,
    S + z z^T has the Gram matrix G - u (1 + v)^-1 u^T, u = Z^T W z, v = z^T W z (Woodbury).  Written
    out in scalars because this is most of the work, and loops double its time.
    """
    (r, g1, g2, g3, g4, t, a) = gram
    triangle = (*r[:5], *g1[1:5], *g2[2:5], *g3[3:5], g4[4])
    terms = _terms(triangle, precision)
    found = [_force(terms, x) for x in places]
    _, best = max((explained, force) for force, explained, _ in found)
    precision = min(precision, 1.0 / (best[0] * best[0] + best[1] * best[1] + CONTACT.smallest_force))
    _, (f1, f2) = max((explained + math.log(sd[0] * sd[2] - sd[1] * sd[1]), force) for force, explained, sd in found)
    size = math.hypot(f1, f2) + CONTACT.smallest_force
    sd, arm, turn = friction * size, offset * size, friction * radius
    b1, b2 = turn * f1, turn * f2
    u0, u1, u2, u3, u4 = arm * t[0], arm * t[1], arm * t[2], arm * t[3], arm * t[4]
    v0, v1, v2 = (
        sd * a[0] + b1 * g3[0] + b2 * g4[0],
        sd * a[1] + b1 * g3[1] + b2 * g4[1],
        sd * a[2] + b1 * g3[2] + b2 * g4[2],
    )
    v3, v4 = sd * a[3] + b1 * g3[3] + b2 * g4[3], sd * a[4] + b1 * g3[4] + b2 * g4[4]
    w11, w12 = 1.0 + arm * (arm * t[5]), arm * (sd * a[5] + b1 * g3[5] + b2 * g4[5])
    w22 = 1.0 + sd * (sd * a[6] + b1 * g3[6] + b2 * g4[6]) + b1 * v3 + b2 * v4
    determinant = w11 * w22 - w12 * w12
    p0, q0 = (w22 * u0 - w12 * v0) / determinant, (w11 * v0 - w12 * u0) / determinant
    p1, q1 = (w22 * u1 - w12 * v1) / determinant, (w11 * v1 - w12 * u1) / determinant
    p2, q2 = (w22 * u2 - w12 * v2) / determinant, (w11 * v2 - w12 * u2) / determinant
    p3, q3 = (w22 * u3 - w12 * v3) / determinant, (w11 * v3 - w12 * u3) / determinant
    p4, q4 = (w22 * u4 - w12 * v4) / determinant, (w11 * v4 - w12 * u4) / determinant
    rr, ra1, ra2, rb1, rb2, a11, a12, a1b1, a1b2, a22, a2b1, a2b2, b11, b12, b22 = triangle
    wide = (
        rr - u0 * p0 - v0 * q0,
        ra1 - u0 * p1 - v0 * q1,
        ra2 - u0 * p2 - v0 * q2,
        rb1 - u0 * p3 - v0 * q3,
        rb2 - u0 * p4 - v0 * q4,
        a11 - u1 * p1 - v1 * q1,
        a12 - u1 * p2 - v1 * q2,
        a1b1 - u1 * p3 - v1 * q3,
        a1b2 - u1 * p4 - v1 * q4,
        a22 - u2 * p2 - v2 * q2,
        a2b1 - u2 * p3 - v2 * q3,
        a2b2 - u2 * p4 - v2 * q4,
        b11 - u3 * p3 - v3 * q3,
        b12 - u3 * p4 - v3 * q4,
        b22 - u4 * p4 - v4 * q4,
    )
    return wide, precision, math.log(determinant) - 2.0 * math.log(precision)
