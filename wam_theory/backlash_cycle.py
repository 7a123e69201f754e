"""The limit cycle of a torque loop by backlash (2.2): a sensor behind a play, exactly.

A motor of inertia J and damping b turns a gear with play against a link at rest.  The sensor reads the torque
tau of the flank; the loop answers it with -(G tau + G_I integral of tau + G_D d tau/dt).  Within the play it answers
nothing, so that the derivative, which stabilises the loop on a flank, is missing for a part of each cycle.
"""

import math
from typing import NamedTuple

import numpy as np

from wam_theory.arguments import Array, above_zero, zero_or_more
from wam_theory.friction_model import require
from wam_theory.thresholds import SEARCH
from wam_theory.zero_order_hold import zero_order_hold


class GearedTorqueLoop(NamedTuple):
    """The gear, the motor and the gains.

    Attributes
    ----------
    stiffness, play : of the gear at its motor, N m/rad and rad, above zero.
    inertia, damping : of the motor, with the damping of its own velocity feedback, kg m^2 and N m s/rad.
    proportional, integral : G, above -1, and G_I, 1/s, zero or more, of the torque.
    derivative : G_D of the torque, s, above zero.
    """

    stiffness: float
    play: float
    inertia: float
    damping: float
    proportional: float
    integral: float
    derivative: float

    @property
    def critical_gain(self) -> float:
        """N of Routh's criterion, the part of the stiffness at which the loop without play is marginal.

        (b + N k G_D) (1 + G) = J G_I; at most 0: no cycle; from 1 on the loop is unstable without play.
        """
        needed = self.inertia * self.integral / (1.0 + self.proportional) - self.damping
        return needed / (self.stiffness * self.derivative)


class BacklashCycle(NamedTuple):
    """A stable limit cycle: torque of the sensor, peak to peak, N m, and frequency, rad/s; 0 and NaN for none."""

    torque: float
    frequency: float


NO_CYCLE = BacklashCycle(0.0, math.nan)


def exact_cycle(loop: GearedTorqueLoop) -> BacklashCycle:
    """The cycle by exact motion over play and flank in turn, until a half cycle repeats itself.

    Parameters
    ----------
    loop : gear, motor and gains.

    Raises
    ------
    ValueError
        if a value of the loop is out of its range, or no cycle has settled after 5000 half cycles.
    """
    above_zero(stiffness=loop.stiffness, play=loop.play, inertia=loop.inertia, derivative=loop.derivative)
    zero_or_more(damping=loop.damping, integral=loop.integral)
    require("proportional", loop.proportional, above=-1.0)
    if not 0.0 < loop.critical_gain < 1.0:
        return NO_CYCLE
    n, proportional = loop.critical_gain, loop.proportional  # by the describing function omega^2 = N k (1 + G)/J
    frequency = math.sqrt(n * loop.stiffness * (1.0 + proportional) / loop.inertia)
    speed, wound = frequency * loop.play, 0.0  # rad/s at the flank; G_I integral of tau
    for _ in range(SEARCH.half_cycles):
        contact, most, back, wound_then = _flank(loop, speed, wound)
        crossing, reached = _play(loop, back, wound_then)
        if math.isnan(crossing):
            return NO_CYCLE  # it comes to rest within the play
        change = abs(reached - speed) / speed + abs(wound_then + wound) / (abs(wound_then) + 1e-300)
        speed, wound = reached, -wound_then
        if change < SEARCH.flank_change:
            return BacklashCycle(2.0 * most, math.pi / (contact + crossing))
    raise ValueError(f"no cycle of {loop} has settled after {SEARCH.half_cycles} half cycles")


def _flank(loop: GearedTorqueLoop, speed: float, wound: float) -> tuple[float, float, float, float]:
    """From contact to its end: its time, s, greatest torque, N m, speed at the end, rad/s, and G_I integral of tau."""
    k, j = loop.stiffness, loop.inertia
    rate = np.array(
        [
            [0.0, 1.0, 0.0],
            [-(1.0 + loop.proportional) * k / j, -(loop.damping + loop.derivative * k) / j, -1.0 / j],
            [loop.integral * k, 0.0, 0.0],
        ]
    )
    state, time, most = np.array([0.0, speed, wound]), 0.0, 0.0
    dt = 1.0 / (SEARCH.contact_steps * float(np.abs(np.linalg.eigvals(rate)).max()))
    ahead = zero_order_hold(rate, np.zeros((3, 1)), dt)[0]
    while (after := ahead @ state)[0] > 0.0:
        if after[1] < 0.0 <= state[1]:
            top, _ = _until(rate, state, dt, 1)
            most = k * float(top[0])
        state, time = after, time + dt
    end, rest = _until(rate, state, dt, 0)
    return time + rest, most, float(end[1]), float(end[2])


def _until(rate: Array, state: Array, dt: float, which: int) -> tuple[Array, float]:
    """State and time where a component becomes zero from above within dt."""
    low, high = 0.0, dt
    for _ in range(60):
        middle = 0.5 * (low + high)
        positive = (zero_order_hold(rate, np.zeros((3, 1)), middle)[0] @ state)[which] > 0.0
        low, high = (middle, high) if positive else (low, middle)
    return zero_order_hold(rate, np.zeros((3, 1)), high)[0] @ state, high


def _play(loop: GearedTorqueLoop, speed: float, wound: float) -> tuple[float, float]:
    """Across the play from a flank: time, s, and speed towards the other one, rad/s; NaN if it does not arrive.

    The motor leaves with a speed below zero, under the constant torque -G_I integral of tau.
    """
    away, push, b, j = -speed, wound / loop.inertia, loop.damping / loop.inertia, loop.play

    def at(time: float) -> tuple[float, float]:
        if b == 0.0:
            return away * time + 0.5 * push * time * time, away + push * time
        decay = -math.expm1(-b * time) / b
        return away * decay + push / b * (time - decay), away * math.exp(-b * time) + push * decay

    high = j / away
    for _ in range(60):
        if at(high)[0] >= j:
            break
        if at(high)[1] <= 0.0:
            return math.nan, math.nan
        high *= 2.0
    else:
        return math.nan, math.nan
    low = 0.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if at(middle)[0] >= j else (middle, high)
    return high, at(high)[1]
