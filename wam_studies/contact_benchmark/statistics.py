"""Estimates with their 95 % intervals: shares, quantiles, rms values, counts."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

Z = 1.96  # of a two-sided 95 % interval
RESAMPLED = 400  # bootstrap samples


class Interval(NamedTuple):
    """A value, its 95 % interval and the number of observations.

    NaN without observations; an end of the interval is NaN if there are too few.
    """

    value: float
    low: float
    high: float
    observed: int


NONE = Interval(math.nan, math.nan, math.nan, 0)
FEW = "too few"
FEWEST = 20  # observations, below which a verdict is not one on the quantity


def counted(verdict: str, observed: int) -> str:
    """A verdict, with a remark where it is one on too few observations; '' stays ''."""
    return f"{verdict} (n={observed}: {FEW})" if verdict and observed < FEWEST and FEW not in verdict else verdict


def share(hits: int, count: int) -> Interval:
    """Share of hits with its Wilson interval (1927)."""
    if count == 0:
        return NONE
    p, z2 = hits / count, Z * Z
    centre = (p + z2 / (2.0 * count)) / (1.0 + z2 / count)
    half = Z * math.sqrt(p * (1.0 - p) / count + z2 / (4.0 * count * count)) / (1.0 + z2 / count)
    return Interval(p, max(0.0, centre - half), min(1.0, centre + half), count)


def quantile(values: Sequence[float], level: float) -> Interval:
    """A quantile with its interval by order statistics; infinite values are the greatest."""
    n = len(values)
    if n == 0:
        return NONE
    ordered = sorted(values)
    half = Z * math.sqrt(n * level * (1.0 - level))
    ranks = (math.floor(n * level + side * half) for side in (-1.0, 1.0))
    low, high = (ordered[rank] if 0 <= rank < n else math.nan for rank in ranks)
    middle = n * level - 0.5
    lower, upper = (ordered[min(max(k, 0), n - 1)] for k in (math.floor(middle), math.ceil(middle)))
    value = lower if lower == upper else lower + (middle - math.floor(middle)) * (upper - lower)
    return Interval(value, low, high, n)


def rms(sums: Sequence[float], counts: Sequence[int]) -> Interval:
    """Root mean square of observations in correlated groups; the interval is a bootstrap over the groups.

    Parameters
    ----------
    sums : sum of squares of each group.
    counts : observations of each group.
    """
    total = sum(counts)
    if total == 0:
        return NONE
    squares, sizes = np.array(sums), np.array(counts, dtype=float)
    chosen = np.random.default_rng(0).integers(0, len(squares), (RESAMPLED, len(squares)))
    values = np.sqrt(squares[chosen].sum(axis=1) / np.maximum(sizes[chosen].sum(axis=1), 1.0))
    low, high = np.quantile(values, (0.025, 0.975)).tolist()
    return Interval(math.sqrt(float(squares.sum()) / total), low, high, total)


def events(count: int, seconds: float) -> Interval:
    """Number of events in a time, s, with its Poisson interval (Byar's approximation)."""
    if seconds <= 0.0:
        return NONE
    low = count * (1.0 - 1.0 / (9.0 * count) - Z / (3.0 * math.sqrt(count))) ** 3 if count else 0.0
    more = count + 1
    high = more * (1.0 - 1.0 / (9.0 * more) + Z / (3.0 * math.sqrt(more))) ** 3
    return Interval(float(count), low, high, round(seconds))
