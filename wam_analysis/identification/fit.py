"""Estimate of the parameters: robust least squares with a prior; covariance by jackknife.

The residuals are coloured, and what the model lacks does not average out: the variance of white residuals would be far
too small.  So parts of the motion are left out in turn (delete-a-group jackknife, Efron & Stein 1981), and each is
predicted from all others.  What is wrong alike in all parts is added: what the law of friction leaves out, and how much
the estimate depends on the filter of the motion.
"""

from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from wam_analysis.identification.motion import MotionSamples
from wam_analysis.identification.regressor import Equations, Regressor
from wam_analysis.identification.tracked_errors import TrackedErrors, Uncertainty, tracked_errors
from wam_analysis.identification.unknowns import DIRECTIONS, Unknowns, unknowns, with_kept_weight
from wam_analysis.measures.runs import median_step
from wam_analysis.thresholds import IDENTIFY
from wam_bag.arrays import Mask, Numbers, Rows
from wam_description.arm import Shared

NOT_NEGATIVE = ("motors.static_", "motors.load_", "motors.viscous", "joints.")


class Identification(NamedTuple):
    """What was identified.

    Attributes
    ----------
    unknowns : names, present values, prior.
    values : (p,).
    uncertainty : of the values.
    alone : (p,), standard deviation if all other parameters were known.
    residual, held_out, before : (n,), rms torque of each motor that the estimate, the estimate from the other parts of
        the motion, and the present model do not explain, N m.
    seconds : of the motion that was used, of each motor, (n,).
    both_directions : (n,), parts of the motion in which each motor turns both ways.
    tracked : the covariance in the errors of the model that the contact estimator tracks.
    """

    unknowns: Unknowns
    values: Numbers
    uncertainty: Uncertainty
    alone: Numbers
    residual: Numbers
    held_out: Numbers
    before: Numbers
    seconds: Numbers
    both_directions: Numbers
    tracked: TrackedErrors

    @property
    def covariance(self) -> Numbers:
        """(p, p), of the values."""
        return self.uncertainty.covariance(np.eye(len(self.values)))

    @property
    def sd(self) -> Numbers:
        """(p,), standard deviations of the values."""
        return np.sqrt(self.covariance.diagonal())

    @property
    def offset_if_alike(self) -> tuple[Numbers, Numbers]:
        """Torque offset of each motor if its friction were alike in both directions, and its standard error.

        (n,) each, N m, true less reported torque.  No recording shows which of both a difference of the directions is.
        """
        positive, negative = (self.unknowns.places(f"motors.coulomb_{way}") for way in DIRECTIONS)
        covariance = self.covariance
        variance = covariance.diagonal()
        both = variance[positive] + variance[negative] - 2.0 * covariance[positive, negative]
        return 0.5 * (self.values[negative] - self.values[positive]), 0.5 * np.sqrt(np.maximum(both, 0.0))

    @property
    def unexplained(self) -> Numbers:
        """(n,), rms torque of each motor that the estimate does not explain, per Coulomb friction."""
        level = np.mean([self.values[self.unknowns.places(f"motors.coulomb_{way}")] for way in DIRECTIONS], axis=0)
        return np.asarray(self.residual / np.maximum(level, IDENTIFY.least_friction), np.float64)

    @property
    def is_identified(self) -> Mask:
        """(p,), whether the motion shows a parameter by itself."""
        return self.sd <= IDENTIFY.identified * self.unknowns.prior_sd

    @property
    def is_combined(self) -> Mask:
        """(p,), whether the motion shows a parameter only together with others."""
        return ~self.is_identified & (self.alone <= IDENTIFY.identified * self.unknowns.prior_sd)


class _Estimate(NamedTuple):
    """One fit."""

    equations: Equations
    part: Rows
    weights: Numbers  # (k, n), 1/(N^2 m^2)
    values: Numbers
    without: Numbers  # (parts, p), estimates without each part
    prior: Numbers  # (p, p), information before the motion, large where a value is at its limit
    information: Numbers  # (p, p), of all parts
    held_out: Numbers


def identify(shared: Shared, motion: MotionSamples) -> Identification:
    """Identify the model of the controllers from a motion.

    Parameters
    ----------
    shared : the arm and its present model, which is the prior.
    motion : free motion, without contacts.

    Raises
    ------
    ValueError
        if no motor turns in one direction for long enough.
    """
    sought = unknowns(shared)
    regressor = Regressor(shared, sought, motion, IDENTIFY.least_motion)
    moves, matrix = regressor.is_used.any(0), shared.arm.transmission.joint_from_motor
    still = [j for j, row in enumerate(matrix) if not moves[row != 0.0].all()]  # their torques are not seen
    if len(still) == shared.arm.n:
        raise ValueError(
            f"no joint turns freely for {IDENTIFY.least_motion:g} s: let each motor turn, faster than "
            f"{IDENTIFY.slowest_motor:g} rad/s, in both directions"
        )
    sought = regressor.unknowns = with_kept_weight(sought, shared, still)
    best = _estimate(regressor)
    moved = _moved_by_averaging(best)
    best = best._replace(values=np.maximum(best.values + moved, _least(sought)))
    uncertainty = _uncertainty(regressor, best)
    tracked = tracked_errors(regressor, shared.arm.joints.names, still, best.values, uncertainty)
    return _result(sought, best, uncertainty, tracked)


def _estimate(regressor: Regressor) -> _Estimate:
    sought = regressor.unknowns
    values, least = sought.present.copy(), _least(sought)
    velocities = sought.places("motors.stribeck_velocity")
    values[velocities] = np.maximum(values[velocities], IDENTIFY.stribeck)
    for _ in range(IDENTIFY.iterations):
        equations, before = regressor.equations(values), values[velocities]
        part = np.arange(len(equations.time)) * IDENTIFY.parts // len(equations.time)  # of each sample
        weights = _weights(equations, values)
        each = _normal(equations, part, weights)
        information, vector = (one.sum(0) for one in each)
        values, prior = _limited(information, vector, sought, least)
        # the curve is not linear in them: a longer step may end where no friction drops, and no step leads back
        values[velocities] = np.clip(values[velocities], before / 2.0, before * 2.0)
    without = np.array(
        [_solve(information - i, vector - v, sought.prior, sought.present) for i, v in zip(*each, strict=True)]
    )
    left = equations.torque - np.einsum("knp,kp->kn", equations.columns, without[part])
    return _Estimate(equations, part, weights, values, without, prior, information, rms(left, equations.is_used))


def _limited(information: Numbers, vector: Numbers, sought: Unknowns, least: Numbers) -> tuple[Numbers, Numbers]:
    """Solution with no value below its least, (p,), and the prior that it has then, (p, p)."""
    prior_sd, centre = sought.prior_sd.copy(), sought.present.copy()
    for _ in range(IDENTIFY.iterations):
        prior = sought._replace(prior_sd=prior_sd).prior
        values = _solve(information, vector, prior, centre)
        below = values < least
        prior_sd[below], centre[below] = IDENTIFY.pinned * sought.prior_sd[below], least[below]
    return np.maximum(values, least), prior


def _least(sought: Unknowns) -> Numbers:
    """Smallest values, (p,)."""
    least = np.array([0.0 if name.startswith(NOT_NEGATIVE) else -np.inf for name in sought.names])
    for inert in map(sought.places, ("links.mass", "motors.inertia")):
        least[inert] = IDENTIFY.lightest * sought.present[inert]
    least[sought.places("motors.stribeck_velocity")] = IDENTIFY.slowest_motor
    return least


def _normal(equations: Equations, part: Rows, weights: Numbers) -> tuple[Numbers, Numbers]:
    """Weighted normal equations by part of the motion, (parts, p, p) and (parts, p)."""
    p = equations.columns.shape[2]
    information, vector = np.zeros((IDENTIFY.parts, p, p)), np.zeros((IDENTIFY.parts, p))
    for i in range(IDENTIFY.parts):
        rows = equations.columns[part == i].reshape(-1, p)
        weighted = rows * weights[part == i].reshape(-1, 1)
        information[i] = weighted.T @ rows
        vector[i] = weighted.T @ equations.torque[part == i].ravel()
    return information, vector


def _weights(equations: Equations, values: Numbers) -> Numbers:
    """Weights of the rows, (k, n), 1/(N^2 m^2): those far from the present estimate count less (Huber)."""
    left = equations.torque - equations.columns @ values
    scale = np.array([_deviation(left[used, i]) for i, used in enumerate(equations.is_used.T)])
    return np.minimum(1.0, IDENTIFY.huber * scale / np.maximum(np.abs(left), 1e-12)) / scale**2 * equations.is_used


def _deviation(residuals: Numbers) -> float:
    """Standard deviation of residuals by their median, N m."""
    return max(1.4826 * float(np.median(np.abs(residuals))), 1e-6) if len(residuals) else 1.0


def _solve(information: Numbers, vector: Numbers, prior: Numbers, centre: Numbers) -> Numbers:
    return np.asarray(np.linalg.solve(information + prior, vector + prior @ centre), np.float64)


def rms(left: Numbers, is_used: Mask) -> Numbers:
    """Rms, (n,), of what is left of the torques, (k, n), where they are used."""
    counts = np.maximum(is_used.sum(0), 1)
    return np.sqrt((left**2 * is_used).sum(0) / counts)


def _uncertainty(regressor: Regressor, best: _Estimate) -> Uncertainty:
    """Of the estimate: also by what the law of friction and the equations leave out, what averaging and limits move.

    The equations leave out the asymmetry of the joints' load friction, and the friction of own joints as a load: it
    adds to the load of its motor's friction or takes from it, by the way of the load.
    """
    sought, equations, values = regressor.unknowns, best.equations, best.values
    variance = np.zeros(len(values))
    coulomb = [i for way in DIRECTIONS for i in sought.places(f"motors.coulomb_{way}")]
    variance[coulomb] = (IDENTIFY.law * values[coulomb]) ** 2
    white = np.asarray(np.linalg.inv(best.information + sought.prior), np.float64)
    # torques of the motors, (k, n, u), by one sd of each that is left out, and what the estimate takes for them
    asymmetry = IDENTIFY.asymmetry * values[sought.places("joints.load")]
    carried = regressor.carried_friction(values)
    carried = carried[..., None] * np.eye(carried.shape[1])
    unknown = np.concatenate((regressor.asymmetric_loads(values) * asymmetry, carried), axis=2)
    weighted = equations.columns * best.weights[..., None]
    taken = white @ np.einsum("knp,knj->pj", weighted, unknown, optimize=True)
    # by an error of the model a value would be beyond its limit: the limit moves all values
    moved = values - best.without.mean(0)
    return Uncertainty(best.without, white, np.diag(variance) + taken @ taken.T + np.outer(moved, moved))


def _moved_by_averaging(best: _Estimate) -> Numbers:
    """By how much the estimate differs, (p,), where neighbouring equations are averaged, from that of the same ones.

    Of a right model it would not.  Torque ripple accelerates the rotors within a window, the cables give way to it and
    the servo follows, so that it is correlated with the acceleration: a part of it counts as inertia, with the same
    sign in all parts of the motion.  Averaging takes a part of it out; what is left may be as much.
    """
    equations, weights = best.equations, best.weights
    bell = np.hanning(IDENTIFY.averaged + 2)[1:-1]
    edge = IDENTIFY.averaged // 2
    middle = slice(edge, len(weights) - edge)
    if len(weights) <= IDENTIFY.averaged:
        return np.zeros_like(best.values)
    span = equations.time[2 * edge :] - equations.time[: -2 * edge]
    follow = span < (IDENTIFY.averaged - 0.5) * median_step(equations.time)
    whole = sliding_window_view(equations.is_used, IDENTIFY.averaged, 0).all(-1) & follow[:, None]

    def solved(torque: Numbers, columns: Numbers) -> Numbers:
        weighted = columns * (weights[middle] * whole)[..., None]
        information = np.einsum("knp,knq->pq", weighted, columns, optimize=True)
        return _solve(information, np.einsum("knp,kn->p", weighted, torque), best.prior, best.values)

    averaged = [
        np.asarray(sliding_window_view(each, IDENTIFY.averaged, 0) @ (bell / bell.sum()), np.float64)
        for each in (equations.torque, equations.columns)
    ]
    return solved(*averaged) - solved(equations.torque[middle], equations.columns[middle])


def _result(sought: Unknowns, best: _Estimate, uncertainty: Uncertainty, tracked: TrackedErrors) -> Identification:
    equations = best.equations
    before = equations.torque - equations.columns @ sought.present
    left = equations.torque - equations.columns @ best.values
    step = median_step(equations.time)
    moves = equations.columns[:, :, sought.places("motors.viscous")].diagonal(axis1=1, axis2=2)
    by_part = [moves[best.part == i] for i in range(IDENTIFY.parts)]
    both = np.sum([(each > 0.0).any(0) & (each < 0.0).any(0) for each in by_part], axis=0)
    return Identification(
        sought,
        best.values,
        uncertainty,
        1.0 / np.sqrt(np.maximum(best.information.diagonal(), 1e-300)),
        rms(left, equations.is_used),
        best.held_out,
        rms(before, equations.is_used),
        equations.is_used.sum(0) * step,
        both,
        tracked,
    )
