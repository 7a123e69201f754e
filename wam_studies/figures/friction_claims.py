"""Figures for 5.4, 5.5.1 and 5.5.2, in words in the thesis: closed forms as lines, exact events as points.

The node has J_l = 1, k_tr + k_c = 4 and F_dynamic = 1, unless a stiffness is the abscissa.
"""

import numpy as np

from wam_studies.figures.conditions import CASE
from wam_studies.figures.panels import Mark, Numbers, Panel, Panels, Series, line_only
from wam_theory.describing_function import predicted_unstable_cycle, unstable_cycle
from wam_theory.guidelines import kept_contact_ratio
from wam_theory.harmonics import harmonic_share
from wam_theory.linear_loop import routh_gain
from wam_theory.regimes import gamma_3
from wam_theory.stick_slip import FrictionNode, IntegralLoop, Kind, assess, simulate
from wam_theory.stiction import slip_overshoot, stiction_cycle_period
from wam_theory.stiction_start import asymmetric_period_ratio, asymmetry_decay


def node_of(zeta: float, static: float) -> FrictionNode:
    """The node with this damping and static friction."""
    return FrictionNode(1.0, 4.0 * zeta, CASE.stiffness, CASE.stiffness, 1.0, static)


def gain_of(gamma: float, zeta: float) -> float:
    """G_I of this gamma."""
    return gamma * float(routh_gain(1.0, 4.0 * zeta, CASE.stiffness, CASE.stiffness))


def asymmetric_start(number: float = 0.002, slips: int = 800) -> Panels:
    """Asymmetry over D after each slip, and period over that of (5.9) after each cycle, from an error of 0.9 D.

    Parameters
    ----------
    number : left side of (5.4), far below 1.
    slips : of the response.
    """
    asymmetry, period = [], []
    for zeta in CASE.zetas:
        node, gain = node_of(zeta, CASE.static_friction), 2.0 * number
        jump = 0.5 * (CASE.static_friction - 1.0) * float(slip_overshoot(zeta))
        times, errors = standstills(node, gain, 0.9 * jump, slips)
        keep = 1.0 - float(asymmetry_decay(number, zeta))
        measured = np.abs(errors[1:] + errors[:-1]) / 2.0 / jump
        n = np.arange(float(len(measured)))
        asymmetry.append((f"ζ = {zeta:g}", Series(n, measured[0] * keep**n, n[::25], measured[::25])))
        symmetric = float(stiction_cycle_period(gain, CASE.stiffness, CASE.stiffness, CASE.static_friction, 1.0, zeta))
        predicted = asymmetric_period_ratio(jump * (0.5 + measured[0] * keep**n), jump)[:-1]
        cycles = (times[2:] - times[:-2]) / symmetric
        half = n[:-1] / 2.0
        period.append((f"ζ = {zeta:g}", Series(half, predicted, half[::25], cycles[::25])))
    over = "period over that of (5.9) [-]"
    return (
        Panel("a) asymmetry", "slips [-]", "asymmetry over D [-]", tuple(asymmetry), "y"),
        Panel("b) period", "cycles [-]", over, tuple(period), limits=(0.0, 200.0, 0.95, np.nan)),
    )


def standstills(node: FrictionNode, gain: float, error: float, slips: int) -> tuple[Numbers, Numbers]:
    """Times, s, and errors F_des - F_c, N m, of the standstills of a loop that begins stuck with this error.

    Parameters
    ----------
    node, gain : of the loop.
    error : at time 0, N m, with an unstressed spring between motor and node apart from the contact force.
    slips : after which it ends.
    """
    force = 10.0
    x = (force - error) / node.contact_stiffness
    motor = x + node.contact_stiffness * x / node.transmission_stiffness
    motion = simulate(node, IntegralLoop(gain), force, 1e9, (x, 0.0, motor), max_events=2 * slips)
    found = [(event.time, force - event.contact_force) for event in motion.events if event.kind is Kind.STICK]
    times, errors = np.array(found).T
    return times, errors


def harmonics_of_friction(zeta: float = 0.25) -> Panels:
    """Harmonics that the describing function neglects, and the cycles, amplitude of F_c, that it has and has not.

    Points of harmonics: Fourier series of the periodic motion of the linear block.  Cycles with stiction: those that
    steps of 0.01 and of F_dynamic settle in, where the describing function has none.
    """
    gamma = 1.0 + np.geomspace(0.02, float(gamma_3(zeta)) - 1.001, 60)
    gain = np.array([gain_of(value, zeta) for value in gamma])
    rest = (1.0, 4.0 * zeta, CASE.stiffness, CASE.stiffness)
    predicted = predicted_unstable_cycle(gain, *rest, 1.0)
    some = np.arange(3, 60, 8)
    spectra = [_spectrum(gain[i], zeta, float(predicted.frequency[i])) for i in some]
    shares = []
    for order in CASE.harmonics:
        line = harmonic_share(order, predicted.frequency, gain, *rest)
        points = np.array([spectrum[int(order)] / spectrum[1] for spectrum in spectra])
        shares.append((f"{order:g}.", Series(gamma, line, gamma[some], points).scaled(1.0, 100.0)))
    stable_gamma = np.array([0.3, 0.5, 0.7, 0.9, 1.05, 1.2])
    small, large = (np.array([_settled(value, zeta, step) for value in stable_gamma]) for step in (0.01, 1.0))
    cycles = (
        ("unstable, SIDF (5.16)", line_only(gamma, predicted.force)),
        ("unstable, exact", line_only(gamma, unstable_cycle(gain, *rest, 1.0).force)),
        ("stiction, after a small step", line_only(stable_gamma, small)),
        ("stiction, after a step of F", line_only(stable_gamma, large)),
    )
    amplitude, routh = "amplitude of F_c over F_dynamic [-]", Mark("Routh", 1.0)
    over = "over the fundamental [%]"
    return (
        Panel("a) harmonics of the velocity", "γ [-]", over, tuple(shares), is_relative=True),
        Panel("b) cycles", "γ [-]", amplitude, cycles, "", (routh,), (np.nan, np.nan, 0.0, 20.0)),
    )


def _settled(gamma: float, zeta: float, step: float) -> float:
    """Amplitude of F_c of the cycle after a step, NaN if it is none."""
    found = assess(node_of(zeta, CASE.static_friction), IntegralLoop(gain_of(gamma, zeta)), step)
    return 0.5 * found.peak_to_peak


def _spectrum(gain: float, zeta: float, frequency: float) -> Numbers:
    """Amplitudes of the harmonics of the velocity, (n,), of the linear block under a square wave of friction.

    The periodic motion from the state matrices: x(T/2) = -x(0).
    """
    state = np.array([[0.0, 1.0, 0.0], [-4.0, -4.0 * zeta, CASE.stiffness], [-gain * CASE.stiffness, 0.0, 0.0]])
    count = 2048
    values, vectors = np.linalg.eig(np.block([[state, np.array([[0.0], [-1.0], [0.0]])], [np.zeros((1, 4))]]))
    step = (vectors @ np.diag(np.exp(values * np.pi / frequency / count)) @ np.linalg.inv(vectors)).real
    half = np.linalg.matrix_power(step, count)
    begin = np.linalg.solve(np.eye(3) + half[:3, :3], -half[:3, 3])
    x, velocity = np.append(begin, 1.0), []
    for _ in range(count):
        velocity.append(x[1])
        x = step @ x
    spectrum: Numbers = np.abs(np.fft.rfft(np.append(velocity, np.negative(velocity))))
    return spectrum


def kept_contact() -> Panels:
    """Largest F_c before a step down over F_des with contact kept: closed form, and bisection on the exact response."""
    series = []
    for zeta in CASE.zetas[1:]:
        last = float(gamma_3(zeta))
        gamma = np.linspace(0.75, 0.98 * last, 120)
        points = np.linspace(0.8, 0.95 * last, 7)
        found = np.array([_largest_step_down(value, zeta) for value in points])
        series.append((f"ζ = {zeta:g}", Series(gamma, kept_contact_ratio(gamma, zeta), points, found)))
    shown = (0.7, np.nan, 1.0, 9.0)
    return (Panel("contact is lost above", "γ [-]", "F_0/F_des [-]", tuple(series), limits=shown, is_relative=True),)


def _largest_step_down(gamma: float, zeta: float) -> float:
    """F_0/F_des where the lowest F_c of the response is zero, by bisection; small steps, so that each slip sticks."""
    node, loop, desired = node_of(zeta, 1.0), IntegralLoop(gain_of(gamma, zeta)), 1e-3

    def lowest(ratio: float) -> float:
        x = ratio * desired / CASE.stiffness
        motion = simulate(node, loop, desired, 1e9, (x, 0.0, 2.0 * x), max_events=12)
        return min(event.contact_force for event in motion.events)

    low, high = 1.0, 1e3
    while high > 1.0001 * low:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if lowest(middle) < 0.0 else (middle, high)
    return low
