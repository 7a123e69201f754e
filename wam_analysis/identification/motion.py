"""Recorded motor states as samples for an identification: checked, filtered and thinned without delay.

Angle, velocity and acceleration are the coefficients of a cubic that is fitted to the angles of each window (Savitzky &
Golay 1964); the torque goes through the same window, so that the equation of motion still holds (Gautier 1997).
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from wam_analysis.held_messages import by_names
from wam_analysis.measures.runs import interpolated, median_step
from wam_analysis.thresholds import IDENTIFY, STREAM
from wam_bag.arrays import Mask, Numbers
from wam_bag.bag import BagError
from wam_description.arm import Arm
from wam_sim.recorded_run import RecordedRun

LOADS = {
    "sim/disturbance": "the simulator pushed the arm",
    "contact/wrench": "a contact was estimated",
}  # topics of forces that the equation of motion does not have, and what each is


class MotionSamples(NamedTuple):
    """Samples of the motion, thinned.

    Attributes
    ----------
    time : (k,), s.
    theta, thetad, thetadd : (k, n), rad, rad/s, rad/s^2.
    torque : (k, n), N m.
    velocities : (k, w, n), velocity at each state of the window, rad/s.
    torques : (k, w, n), torque at each state of the window, N m, each smoothed.
    weights : (w,), of the states in the mean of a window.
    """

    time: Numbers
    theta: Numbers
    thetad: Numbers
    thetadd: Numbers
    torque: Numbers
    velocities: Numbers
    torques: Numbers
    weights: Numbers


def recorded_motion(run: RecordedRun, arm: Arm) -> MotionSamples:
    """The motion in a bag.

    Raises
    ------
    BagError
        if the bag lacks motor states, or they are of another arm, too slow or too short.
    """
    columns = run.joints("motor_states")
    where = run.bag.path
    if columns is None:
        raise BagError(f"{where} has no motor_states with values; record the topic of the driver ('wam bag record')")
    names = arm.motors.names
    if not set(names) <= set(columns.names):
        raise BagError(
            f"{where}: motor_states are of {', '.join(columns.names)}; the configuration has {', '.join(names)}"
        )
    position, effort = (by_names(columns, field, names) for field in ("position", "effort"))
    if position is None or effort is None:
        raise BagError(f"{where}: motor_states have no position or no effort; both are needed")
    try:
        return motion(columns.stamp_ns / 1e9, position, effort)
    except ValueError as error:
        raise BagError(f"{where}: {error}") from None


def loaded(run: RecordedRun) -> Iterator[str]:
    """What acted on the arm in a bag, and for how much of it: its torques are then taken for friction and weight."""
    states = run.joints("motor_states")
    for topic, what in LOADS.items():
        forces = run.wrench(topic)
        if states is None or forces is None or not len(forces.stamp_ns):
            continue
        lasted = np.clip(np.diff(forces.stamp_ns, append=states.stamp_ns[-1]), 0, STREAM.held)
        share = float(np.sum(lasted[np.any(forces.force != 0.0, axis=1)]) / max(np.ptp(states.stamp_ns), 1))
        if share > IDENTIFY.least_contact:
            yield f"{what} in {100.0 * share:.3g} %"


def motion(stamps: Numbers, theta: Numbers, effort: Numbers) -> MotionSamples:
    """Filtered and thinned samples of motor states.

    Parameters
    ----------
    stamps : (k,), s.
    theta, effort : (k, n), rad, and torque in the period that ends, N m.

    Raises
    ------
    ValueError
        if there are too few states, stamps do not rise, or less than `shortest` can be used.
    """
    time, angles, torque, is_used = _evenly(stamps, theta, effort)
    period = float(time[1] - time[0])
    half = max(2, round(0.5 * IDENTIFY.window / period))
    weights = _cubic(half, period)
    step = max(1, round(IDENTIFY.thinning * 2 * half))
    centres = np.arange(2 * half, len(time) - 2 * half, step)
    spans = centres[:, None] + np.arange(-2 * half, 2 * half + 1)
    centres = centres[is_used[spans].all(1)]
    if len(centres) * step * period < IDENTIFY.shortest:
        raise ValueError(
            f"{len(centres) * step * period:.3g} s can be used, without brakes and gaps; "
            f"identification needs {IDENTIFY.shortest:g} s or more"
        )
    windows = centres[:, None] + np.arange(-half, half + 1)
    torques = _smoothed(torque, weights[0])
    # the velocity at each state: also from angles, because that of an encoder is a difference of counts
    turned, velocities, accelerations = (_smoothed(angles, each) for each in weights)
    return MotionSamples(
        time[centres],
        turned[centres],
        velocities[centres],
        accelerations[centres],
        torques[centres],
        velocities[windows],
        torques[windows],
        weights[0],
    )


def _evenly(stamps: Numbers, theta: Numbers, effort: Numbers) -> tuple[Numbers, Numbers, Numbers, Mask]:
    """Time, angles and torques at a constant rate, interpolated where a few are missing; and where they may be used.

    Not used are states that are missing, or under the brakes.
    """
    good = np.isfinite(theta).all(1) & np.isfinite(effort).all(1)
    stamps, theta, effort = stamps[good], theta[good], effort[good]
    if (np.diff(stamps) < 0.0).any():
        raise ValueError("the stamps of motor_states go back: the bag has several sessions; give a bag with one")
    _, first = np.unique(stamps, return_index=True)
    if len(first) < 3 or stamps[first[-1]] - stamps[first[0]] < IDENTIFY.shortest:
        span = stamps.max() - stamps.min() if len(stamps) else 0.0
        raise ValueError(
            f"{len(first)} motor states over {span:.3g} s; identification needs {IDENTIFY.shortest:g} s or more"
        )
    stamps, theta, effort = stamps[first], theta[first], effort[first]
    period = median_step(stamps)
    if period > IDENTIFY.window / 4.0:
        raise ValueError(
            f"motor_states have a period of {period:g} s; identification needs {IDENTIFY.window / 4.0:g} s or less"
        )
    time = np.arange(stamps[0], stamps[-1], period)
    # torque acts in the period that ends at its stamp: it is that of the middle of the period
    theta = interpolated(time, stamps, theta)
    torque = interpolated(time, stamps - 0.5 * period, effort)
    late = np.diff(stamps, append=stamps[-1])[np.searchsorted(stamps, time + 0.01 * period, side="right") - 1]
    is_used = (late <= IDENTIFY.largest_gap * period) & (np.abs(torque) > IDENTIFY.braked).any(1)
    return time, theta, torque, is_used


def _cubic(half: int, period: float) -> Sequence[Numbers]:
    """Weights, (2 half + 1,), of value, first and second derivative in the middle of a window."""
    at = np.arange(-half, half + 1) * period
    solved = np.linalg.pinv(np.vander(at / (half * period), 4, increasing=True))
    return [math.factorial(i) * solved[i] / (half * period) ** i for i in range(3)]


def _smoothed(values: Numbers, weights: Numbers) -> Numbers:
    return np.column_stack([np.convolve(column, weights[::-1], mode="same") for column in values.T])
