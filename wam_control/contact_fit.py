"""One contact on one straight link, fitted to joint torques in closed form for a given place.

A frictionless contact at place x pushes across the link: tau_ext = (A + x B) f, with f the two
components of the force across the link, N.  The line of the force may miss the axis of the tube a
little: friction, or a tube that is not where the model has it.  That adds a twist about the axis,
a torque t, of unknown size.  Everything that the fit needs of arm and torques are inner products,
weighted with the inverse covariance: the Gram matrix of (r, A, B, t), 6 by 6.
"""

import math
from typing import NamedTuple


class Fit(NamedTuple):
    """The most likely contact on one link.

    Attributes
    ----------
    place : m, where the fit is best.
    place_sd : m, with the force unknown; infinite where the torques do not hold the place.
    force : (2,), N, components across the link at `place`.
    force_at_end : (2,), N, the same if the place were the end of the link, the longest lever.
    residual : what the contact leaves unexplained, chi^2.
    log_evidence : log of the probability of the torques, up to a constant of all fits.
    """

    place: float
    place_sd: float
    force: tuple[float, float]
    force_at_end: tuple[float, float]
    residual: float
    log_evidence: float


ITERATIONS = 8
STEP_END = 1e-4  # m
WEAK_PRIOR = 1e-9  # of the force prior: keeps directions that no joint sees from dividing by zero


class _Link:
    """The weighted least squares problem of one link, by its Gram matrix."""

    def __init__(self, gram: list[list[float]], precision: float) -> None:
        self.precision = precision
        self.rr, self.ra1, self.ra2, self.rb1, self.rb2 = gram[0][:5]
        self.a11, self.a12, self.a1b1, self.a1b2 = gram[1][1:5]
        self.a22, self.a2b1, self.a2b2 = gram[2][2:5]
        self.b11, self.b12 = gram[3][3:5]
        self.b22 = gram[4][4]

    def normal(self, x: float) -> tuple[float, float, float]:
        """(11, 12, 22) of G^T W G, G = A + x B."""
        return (
            self.a11 + x * (2.0 * self.a1b1 + x * self.b11),
            self.a12 + x * (self.a1b2 + self.a2b1 + x * self.b12),
            self.a22 + x * (2.0 * self.a2b2 + x * self.b22),
        )

    def force(self, x: float) -> tuple[float, float, float]:
        """Best force at place x, and the part of r^T W r that it explains."""
        n11, n12, n22 = self.normal(x)
        n11, n22 = n11 + self.precision, n22 + self.precision
        c1, c2 = self.ra1 + x * self.rb1, self.ra2 + x * self.rb2
        determinant = n11 * n22 - n12 * n12
        f1, f2 = (n22 * c1 - n12 * c2) / determinant, (n11 * c2 - n12 * c1) / determinant
        return f1, f2, f1 * c1 + f2 * c2

    def survey(self, places: list[float]) -> list[tuple[float, float]]:
        """(explained, log evidence) of each place.

        Log probability of the torques, up to a constant, for a contact there of any likely force:
        -1/2 (r^T (S + s^2 G G^T)^-1 r + log abs(1 + s^2 G^T W G)), s the force's scale.
        """
        result = []
        square = self.precision**-2
        for x in places:
            n11 = self.a11 + x * (2.0 * self.a1b1 + x * self.b11) + self.precision
            n12 = self.a12 + x * (self.a1b2 + self.a2b1 + x * self.b12)
            n22 = self.a22 + x * (2.0 * self.a2b2 + x * self.b22) + self.precision
            c1, c2 = self.ra1 + x * self.rb1, self.ra2 + x * self.rb2
            determinant = n11 * n22 - n12 * n12
            explained = (n22 * c1 * c1 - 2.0 * n12 * c1 * c2 + n11 * c2 * c2) / determinant
            result.append((explained, -0.5 * (self.rr - explained + math.log(square * determinant))))
        return result

    def slope(self, x: float, f1: float, f2: float) -> float:
        """Half the derivative of the explained part by the place, the force always the best."""
        v1, v2 = self.coupling(x, f1, f2)
        return f1 * self.rb1 + f2 * self.rb2 - f1 * v1 - f2 * v2

    def coupling(self, x: float, f1: float, f2: float) -> tuple[float, float]:
        """(B f)^T W G, what place and force have in common."""
        return (
            f1 * (self.a1b1 + x * self.b11) + f2 * (self.a1b2 + x * self.b12),
            f1 * (self.a2b1 + x * self.b12) + f2 * (self.a2b2 + x * self.b22),
        )

    def information(self, x: float, f1: float, f2: float, precision: float) -> float:
        """What the torques say of the place, 1/m^2, the force unknown: a Schur complement."""
        n11, n12, n22 = self.normal(x)
        n11, n22 = n11 + precision, n22 + precision
        v1, v2 = self.coupling(x, f1, f2)
        known = (v1 * v1 * n22 - 2.0 * v1 * v2 * n12 + v2 * v2 * n11) / (n11 * n22 - n12 * n12)
        return f1 * f1 * self.b11 + 2.0 * f1 * f2 * self.b12 + f2 * f2 * self.b22 - known


def fit_contact(
    gram: list[list[float]], start: float, end: float, *, force_scale: float, twist_arm: float, places: int
) -> Fit:
    """Place and force of one contact, by weighted least squares over place and direction at once.

    The start is the best of a row of places, the rest are Gauss-Newton steps in the place alone,
    the force being linear.  The place stays on the link.

    A link that explains the torques anywhere is more likely than one that does so at a single
    place: the evidence is averaged over the link, by Laplace's method, cut at the ends, where the
    place is held by the torques, over the row of places where it is not.

    Parameters
    ----------
    gram : (6, 6), Z^T S^-1 Z, Z = (r, A_1, A_2, B_1, B_2, t): torques, columns of A and B, twist.
    start, end : m, where the link begins and ends along x.
    force_scale : N, sd of each component of the force before anything is felt.
    twist_arm : m, sd of the distance by which the line of the force misses the axis of the tube.
    places : how many places are tried for a start, at least 2.
    """
    precision = 1.0 / force_scale**2
    f1, f2, _ = _Link(gram, precision).force(0.5 * (start + end))
    gain = twist_arm**2 * (f1 * f1 + f2 * f2)
    link = _Link(_with_twist(gram, gain), precision)
    spacing = (end - start) / (places - 1)
    row = [start + i * spacing for i in range(places)]
    tried = link.survey(row)
    best = max(range(places), key=lambda i: tried[i][0])
    x = _climb(link, row[best], start, end, spacing)
    f1, f2, explained = link.force(x)
    information = link.information(x, f1, f2, precision * WEAK_PRIOR)
    sd = 1.0 / math.sqrt(information) if information > 0.0 else math.inf
    if sd < end - start:
        root = math.sqrt(2.0) * sd
        inside = 0.5 * (math.erf((end - x) / root) - math.erf((start - x) / root))
        share = min(1.0, inside * math.sqrt(2.0 * math.pi) * sd / (end - start))
        log_evidence = link.survey([x])[0][1] + math.log(share)
    else:
        most = max(evidence for _, evidence in tried)
        log_evidence = most + math.log(sum(math.exp(evidence - most) for _, evidence in tried) / places)
    residual = max(0.0, link.rr - explained - precision * (f1 * f1 + f2 * f2))
    log_evidence -= 0.5 * math.log1p(gain * gram[5][5])
    return Fit(x, sd, (f1, f2), link.force(end)[:2], residual, log_evidence)


def _climb(link: _Link, x: float, start: float, end: float, longest: float) -> float:
    """Gauss-Newton steps from place x to where the best force explains most, on the link."""
    f1, f2, explained = link.force(x)
    for _ in range(ITERATIONS):
        information = link.information(x, f1, f2, link.precision)
        if information <= 0.0:
            break
        step = min(longest, max(-longest, link.slope(x, f1, f2) / information))
        following = min(end, max(start, x + step))
        trial = link.force(following)
        while trial[2] < explained and abs(following - x) > STEP_END:
            following = 0.5 * (x + following)
            trial = link.force(following)
        moved = abs(following - x)
        if trial[2] >= explained:
            x, (f1, f2, explained) = following, trial
        if moved <= STEP_END:
            break
    return x


def _with_twist(gram: list[list[float]], variance: float) -> list[list[float]]:
    """The Gram matrix for the covariance S + variance t t^T (Sherman-Morrison)."""
    t = gram[5]
    factor = variance / (1.0 + variance * t[5])
    return [
        [value - factor * ti * tj for value, tj in zip(row, t, strict=True)]
        for row, ti in zip(gram[:5], t, strict=False)
    ]
