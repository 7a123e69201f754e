"""Friction of a motor or of a joint, identified from velocity and torque."""

import math
from typing import NamedTuple

import numpy as np

from wam_analysis.measures.runs import after_gaps, at_rest, median_step, noise, runs
from wam_analysis.thresholds import SHAFT
from wam_bag.arrays import Index, Mask, Numbers, Rows


class FrictionNumber(NamedTuple):
    """A number and its standard error; NaN if it is not identifiable."""

    value: float = math.nan
    error: float = math.nan

    @property
    def relative(self) -> float:
        """Error as a part of the number, at most 1."""
        return self.error / abs(self.value) if self.error < abs(self.value) else 1.0

    @property
    def is_sure(self) -> bool:
        """Whether a number that has to be above zero is identified."""
        return self.error < SHAFT.unsure * self.value

    @property
    def is_vague(self) -> bool:
        """Whether the error is too large to state the number."""
        return self.error > SHAFT.unsure * abs(self.value)

    @property
    def is_negative(self) -> bool:
        """Whether it is surely below zero: then the torque holds more than friction."""
        return self.value < -SHAFT.sigmas * self.error


UNKNOWN = FrictionNumber()
_Fitted = tuple[tuple[float, ...], tuple[float, ...], float]  # factors, errors, rms of the rest


class Friction(NamedTuple):
    """Friction of a shaft, N m (or N).

    Attributes
    ----------
    static : torque at which the shaft breaks away, median over the breakaways.  Those nearer to dynamic friction than
        to the third highest are left out: what moves off at less was not quite at rest.  Its error is at least half of
        its rise above `dynamic`: what creeps, too slowly to be seen, moves off at any torque between both, and as often
        as you like; and at least what the torque changes by in a period, in the median of all breakaways: it may be as
        much again until the shaft slips.  One below dynamic friction was torn off: within the period, the torque
        changed at least to that.  Infinite where the torque rises by no more than it scatters in motion.
    dynamic : torque of dry friction in motion.
    viscous : torque per velocity.
    inertia : torque per acceleration.  Three errors of these hold the truth also where there are few motions.
    offset : torque that does not change its sign.
    breakaways : their number.
    residual : rms of the averaged torque that the fit in motion leaves.
    factors : of the load.
    unexplained : rms of that and of what the average leaves out, as a share of the rms of the torque about its mean.
    """

    static: FrictionNumber = UNKNOWN
    dynamic: FrictionNumber = UNKNOWN
    viscous: FrictionNumber = UNKNOWN
    inertia: FrictionNumber = UNKNOWN
    offset: float = math.nan
    breakaways: int = 0
    factors: tuple[float, ...] = ()
    residual: float = math.nan
    unexplained: float = math.nan


def identify_friction(
    time: Numbers,
    velocity: Numbers,
    torque: Numbers,
    rest: float,
    window: float,
    use: Mask | None = None,
    load: Numbers | None = None,
    waves: Numbers | None = None,
) -> Friction:
    """Identify torque = F_dynamic sgn(v) + b v + J a + c in motion, and F_static at the start of motion.

    All columns are averaged by the same triangle of `window` seconds before the fit, so that the
    acceleration is not lost in noise and all have the same delay.  Samples whose window holds a change
    of direction are left out, and then outliers of the fit.  At a breakaway the torque is that of a line
    through the end of the rest, over a quarter of the window without noise, up to all of it with noise.

    Parameters
    ----------
    time : (n,), s, at a constant rate but for gaps.
    velocity : (n,), of the shaft, rad/s.
    torque : (n,), on the shaft, less what it passes on to the load, N m.
    rest : speed up to which the shaft is at rest, rad/s.
    window : s.
    use : (n,), samples that may be used; None for all.
    load : (n, k), torques of unknown size that also act, as those of a weight over the angle; None for none.  With them
        no breakaway is looked for, as not all of them are known at rest.
    waves : (n, k), N m, torques of which only the rms is known: each acts with a factor of unknown sign and about one,
        as the two quadratures of a cogging over the angle.  What they can change is part of all errors; None for none.

    Returns
    -------
    Friction
    """
    n = len(time)
    allowed = np.ones(n, dtype=np.bool_) if use is None else use.copy()
    allowed &= np.isfinite(velocity) & np.isfinite(torque)
    if np.count_nonzero(allowed) < SHAFT.fewest_samples:
        return Friction()
    velocity, torque = np.where(allowed, velocity, 0.0), np.where(allowed, torque, 0.0)
    period = median_step(time)
    gaps = np.flatnonzero(after_gaps(time))
    allowed[gaps] = allowed[gaps - 1] = False  # no window extends over them
    half = max(1, round(window / period / 2.0))
    acting, unknown = (
        np.empty((n, 0)) if each is None else np.where(allowed[:, np.newaxis], each, 0.0) for each in (load, waves)
    )
    solution, errors, left = _in_motion(velocity, torque, acting, unknown, rest, half, period, allowed)
    dynamic, viscous, inertia, offset = map(FrictionNumber, solution[:4], errors[:4])
    static, count = UNKNOWN, 0
    if load is None:
        breakaways = _breakaways(velocity, torque - np.nan_to_num(offset.value), rest, 2 * half, allowed)
        static, count = _static(*breakaways, dynamic.value, math.hypot(dynamic.error, left[0]), unknown)
    return Friction(static, dynamic, viscous, inertia, offset.value, count, solution[4:], *left)


def _in_motion(
    velocity: Numbers,
    torque: Numbers,
    load: Numbers,
    waves: Numbers,
    rest: float,
    half: int,
    period: float,
    allowed: Mask,
) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, float]]:
    """Dynamic, viscous, inertia, offset and factors of the load by least squares, errors, rms and share of the rest."""
    nothing = ((math.nan,) * (4 + load.shape[1]), (math.nan,) * 4, (math.nan, math.nan))
    triangle = np.pad(np.concatenate([np.arange(1, half + 2), np.arange(half, 0, -1)]).astype(float), 2)
    triangle /= triangle.sum()
    slope = np.gradient(triangle)  # of the mean acceleration over two periods: that of all else is Simpson's
    triangle = np.convolve(triangle, (1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0), "same")
    if len(velocity) < len(triangle):
        return nothing
    reach = np.ones(len(triangle))
    onward, back = (
        np.convolve((allowed & moves).astype(float), reach, "same") > len(reach) - 0.5
        for moves in (velocity > rest, velocity < -rest)
    )
    ways = [float(np.sum(np.abs(velocity[each]))) for each in (onward, back)]
    rows = np.flatnonzero(onward | back)
    if len(rows) < SHAFT.fewest_samples or 0.0 < min(ways) < SHAFT.both_ways * max(ways):
        return nothing
    smooth = [np.convolve(each, triangle, "same") for each in (velocity, torque, *load.T, *waves.T)]
    v, wanted, *others = (each[rows] for each in smooth)
    acceleration = np.convolve(velocity, slope, "same")[rows] / period
    direction, number = np.where(onward[rows], 1.0, -1.0), load.shape[1]
    columns = np.column_stack([direction, v, acceleration, np.ones(len(rows)), *others[:number]])
    disturbances = np.column_stack([np.empty((len(rows), 0)), *others[number:]])
    solution, errors, residual = _robust(columns, wanted, disturbances, len(triangle), _halves(rows))
    once = smooth[1]
    curved = np.convolve(once, triangle, "same") - once  # what an average leaves out of a smooth motion, too
    inner = rows[np.isin(rows - half, rows) & np.isin(rows + half, rows)]
    inner, part = (inner, 1.0) if len(inner) >= SHAFT.fewest_samples else (rows, 0.0)
    fast = float(np.std((torque - once + part * curved)[inner]))
    left = residual, math.hypot(residual, fast) / max(float(np.std(torque[rows])), 1e-300)
    scatter = float(np.subtract(*np.percentile(np.abs(v), (95.0, 5.0))))
    uneven = SHAFT.uneven * abs(solution[0]) / scatter if scatter > 0.0 else math.inf
    return solution, (errors[0], math.hypot(errors[1], uneven), *errors[2:]), left


def _robust(columns: Numbers, wanted: Numbers, waves: Numbers, width: int, half: Rows) -> _Fitted:
    """Least squares without outliers, errors, rms of the rest; a column without information gives NaN.

    The averages of `width` samples overlap, so the errors count one sample in `width`.  What the law leaves out, such
    as creep of the cables, is similar within a motion and not noise: if the halves of motions, numbered by `half`,
    differ by more than the noise explains, their difference is the error (jackknife).  A factor that the samples which
    are left do not determine has an infinite error.  What `waves`, (n, k), of unknown size would add to each factor is
    in its error: where the same angles return, neither the rest of the fit nor the halves show it.
    """
    scale = np.sqrt(np.mean(columns**2, axis=0))
    scaled = columns / np.where(scale > 0.0, scale, 1.0)
    keep = np.ones(len(wanted), dtype=np.bool_)

    def fit() -> tuple[list[int], Numbers, Numbers]:
        """Columns that the kept samples distinguish, their factors in terms of `scale`, what is left of all samples."""
        used = _distinct(scaled[keep], width)
        a = scaled[keep][:, used]
        solution = np.asarray(np.linalg.lstsq(a.T @ a, a.T @ wanted[keep], rcond=None)[0], np.float64)
        return used, solution, wanted - scaled[:, used] @ solution

    for _ in range(4):
        if np.count_nonzero(keep) < SHAFT.fewest_samples:
            break
        used, solution, rest = fit()
        sd = 1.4826 * float(np.median(np.abs(rest[keep])))
        keep = np.abs(rest) <= max(SHAFT.jump * sd, 1e-12)
    if _distinct(scaled[keep], width) != used:  # what was left out was all of one direction
        used, solution, rest = fit()
    a = scaled[keep][:, used]
    products = a.T @ a
    inverse = np.linalg.pinv(products)
    freedom = max(len(a) / width - len(used), SHAFT.freedom)
    covariance = inverse * float(np.sum(rest[keep] ** 2)) / freedom
    noisy = _few(freedom) * np.sqrt(np.abs(np.diag(covariance)))
    noisy[_undetermined(products)] = math.inf
    found, errors = np.full(len(scale), math.nan), np.full(len(scale), math.nan)
    found[used] = solution / scale[used]
    errors[used] = np.maximum(noisy, _disagreement(a, wanted[keep], half[keep])) / scale[used]
    errors[used] = np.hypot(errors[used], np.linalg.norm(inverse @ (a.T @ waves[keep]), axis=1) / scale[used])
    errors = np.hypot(errors, SHAFT.neglected * found)
    return tuple(found.tolist()), tuple(errors.tolist()), float(np.sqrt(np.mean(rest[keep] ** 2)))


def _distinct(columns: Numbers, width: int) -> list[int]:
    """Columns that are not zero, without the offset in one direction only: dry friction looks the same.

    Fewer than `width` samples, which overlap, show nothing of a direction.
    """
    both = min(np.count_nonzero(columns[:, 0] > 0.0), np.count_nonzero(columns[:, 0] < 0.0)) >= width
    return [i for i in range(columns.shape[1]) if np.any(columns[:, i]) and (i != 3 or both)]


def _undetermined(products: Numbers) -> Mask:
    """Factors, (p,), that can change without any change of the fit of these normal equations, (p, p)."""
    sizes = np.sqrt(np.maximum(np.diag(products), 1e-300))
    values, vectors = np.linalg.eigh(products / np.outer(sizes, sizes))
    free = vectors[:, values < values[-1] / SHAFT.singular]
    return np.any(np.abs(free) > SHAFT.undetermined, axis=1)


def _halves(rows: Index) -> Rows:
    """Number the halves of stretches without a gap, (k,): a motion gets faster in one, slower in the other."""
    begins = np.flatnonzero(np.diff(rows, prepend=rows[0] - 2) > 1)
    lengths = np.diff(begins, append=len(rows))
    result = np.zeros(len(rows), dtype=np.int64)
    result[np.concatenate([begins, begins + lengths // 2])[np.tile(lengths > 1, 2)]] = 1
    return np.cumsum(result)


def _disagreement(columns: Numbers, wanted: Numbers, half: Rows) -> Numbers:
    """Standard errors of the columns' factors from leaving out one half of a motion at a time (jackknife)."""
    begins = np.flatnonzero(np.diff(half, prepend=half[0] - 1))
    pieces = list(zip(np.split(columns, begins[1:]), np.split(wanted, begins[1:]), strict=True))
    products, targets = np.array([a.T @ a for a, _ in pieces]), np.array([a.T @ b for a, b in pieces])
    left, right = products.sum(axis=0) - products, targets.sum(axis=0) - targets
    is_known = np.linalg.cond(left) < SHAFT.singular
    found = np.linalg.solve(left[is_known], right[is_known][:, :, None])[:, :, 0]
    if len(found) < 2:
        return np.zeros(columns.shape[1])
    return _few(len(found) - 1.0) * np.sqrt((len(found) - 1) * np.var(found, axis=0))


def _few(freedom: float) -> float:
    """Factor on a standard error from few values, by which three of them are exceeded as rarely as with many.

    Student's t by the approximation of Wallace (1959), at most 7 % too large from three degrees of freedom on.
    """
    n = max(freedom, SHAFT.freedom)
    deviate = SHAFT.sigmas * (8.0 * n + 3.0) / (8.0 * n + 1.0)
    return math.sqrt(n * math.expm1(deviate**2 / n)) / SHAFT.sigmas


def _static(
    torques: Numbers, steps: Numbers, rows: Rows, dynamic: float, noise: float, waves: Numbers
) -> tuple[FrictionNumber, int]:
    """Static friction and the number of breakaways that count.

    A shaft that creeps carries dynamic friction, about which the torque scatters by `noise`: breakaways that rise by no
    more may all be of a shaft that never stuck, and the error is infinite.  The part of `waves` in it is in the error.
    """
    near = torques >= dynamic  # what moved at less was creeping; where it never slid, it was no breakaway
    if not np.any(near):
        return UNKNOWN, 0
    count = torques >= (dynamic + float(np.min(np.sort(torques[near])[-SHAFT.agreeing :]))) / 2.0
    torque = torques[count]
    static = float(np.median(torque))
    wave = float(np.sqrt(np.mean(np.sum(waves[rows[count]] ** 2, axis=1))))
    if not static - dynamic > SHAFT.sigmas * math.sqrt(max(noise**2 - wave**2, 0.0)):
        return FrictionNumber(static, math.inf), len(torque)
    scatter = 1.4826 * float(np.median(np.abs(torque - static)))
    alike = _few(len(torque) - 1.0) * scatter / math.sqrt(len(torque))
    step = float(np.median(np.maximum(steps, dynamic - torques)))
    error = math.hypot(alike, SHAFT.creep * (static - dynamic), step, wave)
    return FrictionNumber(static, error), len(torque)


def _breakaways(
    velocity: Numbers, torque: Numbers, rest: float, window: int, allowed: Mask
) -> tuple[Numbers, Numbers, Rows]:
    """Torque against the rest at the end of each stick, with the sign of the slip that follows.

    Then its larger change in the last two periods, and the row, (k,) each.
    """
    sd = noise(velocity[np.abs(velocity) <= rest])
    still = at_rest(velocity, max(3.0 * sd, SHAFT.still * rest), max(window // 4, 1))
    slips = {begin: float(np.sign(np.mean(velocity[begin:end]))) for begin, end in runs(~still).tolist()}
    level = float(np.percentile(np.abs(torque), 90.0))
    needed = (2.0 * noise(torque) / (SHAFT.precise * level)) ** 2 if level > 0.0 else 0.0
    length = int(np.clip(needed, max(window // 4, 4), max(window, 4)))
    found = []
    for begin, end in runs(still).tolist():
        slow = np.flatnonzero(np.abs(velocity[begin:end]) <= max(sd, SHAFT.still * rest))
        last = begin + int(slow[-1]) + 1 if len(slow) else begin
        first = max(begin, last - length)
        # counts of an encoder in these rows are too few for a motion, and still one
        is_stuck = np.all(allowed[first:last]) and np.all(np.abs(velocity[first:last]) <= rest)
        if end in slips and last - first >= 4 and is_stuck:
            step = float(np.max(np.abs(np.diff(torque[last - 3 : last]))))
            line = np.polynomial.polynomial.polyfit(np.arange(first, last) + 1.0 - last, torque[first:last], 1)
            found.append((slips[end] * float(line[0]), step, last - 1))
    torques, steps, rows = np.array(found, dtype=np.float64).reshape(-1, 3).T
    return torques, steps, rows.astype(np.int64)
