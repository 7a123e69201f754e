"""Figures 5.7 and 5.8: describing function and stability map, theory and plant.

Dimensionless: frequency in sqrt((k_tr + k_c)/J_l), G times b, so that the figures hold for every node with
their zeta and k_tr = k_c; the plant is the testbed with a contact and a damping for this zeta.
"""

from pathlib import Path

import numpy as np

from wam_description.signals import ZERO
from wam_studies.figures.conditions import CASE
from wam_studies.figures.panels import Mark, Numbers, Panel, Panels, Series, line_only
from wam_studies.figures.style import draw_panels
from wam_studies.plant.ideal_testbed import RATIO, force_step, loop_arm, loop_node, loop_plant
from wam_theory.describing_function import friction_to_velocity
from wam_theory.friction_model import FrictionNode
from wam_theory.linear_loop import gain_ratio, routh_gain
from wam_theory.loop_design import LoopDesign
from wam_theory.regimes import friction_dominated, gamma_3, point_b
from wam_theory.stability_map import largest_stable_steps


def equal_node(zeta: float, friction: tuple[float, float] = (0.0, 0.0)) -> FrictionNode:
    """Node of the testbed with k_c = k_tr, this zeta, and this static and dynamic friction, N m."""
    stiffness = loop_node(loop_arm(0.0, friction), 1.0).transmission_stiffness
    bare = loop_node(loop_arm(0.0, friction), stiffness)
    return loop_node(loop_arm(2.0 * zeta * float(np.sqrt(2.0 * stiffness * bare.inertia)), friction), stiffness)


def describing_function() -> Panels:
    """Figure 5.7: b G(j omega) in the complex plane, of theory and of the plant's one-step map.

    -1/N(A) is the negative real axis, b/N(A) = pi/4 b A/F_friction.
    """
    node = equal_node(CASE.unity_zeta)
    omega, points = np.geomspace(0.05, 30.0, 4000), np.array([0.3, 0.6, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5, 2.0, 3.0])
    curves = [("-b/N(A)", line_only([-4.4, 0.0], [0.0, 0.0]))]
    for gamma in CASE.gammas:
        ktr, kc = node.transmission_stiffness, node.contact_stiffness
        gain = gamma * float(routh_gain(node.inertia, node.damping, ktr, kc))
        line = node.damping * friction_to_velocity(
            1j * node.natural_frequency * omega, gain, node.inertia, node.damping, ktr, kc
        )
        plant = node.damping * _measured_response(node, gain, node.natural_frequency * points)
        curves.append((f"b G(jω), γ = {gamma:g}", Series(line.real, line.imag, plant.real, plant.imag)))
    cycle = Mark("unstable limit cycle (5.16)", -1.0 / (CASE.gammas[1] - 1.0), 0.0)
    axes = "real part of b G [-]", "imaginary part of b G [-]"
    return (Panel("ζ = 0.25", *axes, curves, marks=(cycle,), limits=(-4.4, 2.9, -2.1, 3.1)),)


def _measured_response(node: FrictionNode, gain: float, omega: Numbers) -> Numbers:
    """Velocity over a torque on the link with the loop closed, (frequencies,), from single steps of the plant."""
    matrix, inlet = closed_loop_map(node, gain)
    z = np.exp(1j * omega * CASE.fine_step)
    # for a torque held over a step, at the middle of the step
    responses = [np.linalg.solve(value * np.eye(3) - matrix, inlet)[2] * np.sqrt(value) for value in z]
    return np.array(responses)


def closed_loop_map(node: FrictionNode, gain: float) -> tuple[Numbers, Numbers]:
    """What a fine step of the plant does to x_m, x_l, v_l, (3, 3), and a torque on the link, N m, to them, (3,).

    Parameters
    ----------
    node : its inertia is that of the testbed; without friction.
    gain : G_I, rad/s/(N m).
    """
    small = 1e-6
    plant = loop_plant(loop_arm(node.damping, (0.0, 0.0)), node.contact_stiffness, step=CASE.fine_step)

    def after(state: Numbers, torque: float) -> Numbers:
        plant.data.qpos[:] = RATIO * state[0], state[1]
        plant.data.qvel[:] = -RATIO * gain * node.contact_stiffness * state[1], state[2]
        plant.push("link", ZERO, (0.0, 0.0, torque))
        plant.step([0.0])
        return np.array([plant.theta[0] / RATIO, plant.q[0], plant.qd[0]])

    columns = [after(small * unit, 0.0) / small for unit in np.eye(3)]
    return np.transpose(columns), after(np.zeros(3), small) / small


def stability_bound() -> Panels:
    """Figure 5.8: F_friction/F_error of the bound over gamma, by exact events and by bisection on the plant."""
    last = float(gamma_3(CASE.unity_zeta))
    gamma = 1.0 + np.geomspace(1e-3, last * (1.0 - 1e-6) - 1.0, 300)
    stiction_gamma = np.linspace(1.0005, last, 300)
    steps = largest_stable_steps(stiction_gamma, CASE.unity_zeta, 1.0, CASE.stiction)
    held = steps > 0.0
    plant = np.array([1.0 / plant_largest_step(value) for value in CASE.plant_gammas])
    bound = Series(gamma, 1.0 / largest_stable_steps(gamma, CASE.unity_zeta), np.array(CASE.plant_gammas), plant)
    stiction = line_only(stiction_gamma[held], 1.0 / steps[held])
    lines = [
        (f"ζ = {CASE.unity_zeta:g}, Coulomb friction", bound),
        (f"the same, F_static = {CASE.stiction:g} F_dynamic", stiction),
    ]
    along = np.linspace(0.7, last, 60)
    lines.append(("friction-dominated above it", line_only(along, friction_dominated(along, CASE.unity_zeta))))
    for zeta in (0.15, 0.5, 1.0):
        end = float(gamma_3(zeta))
        along = 1.0 + np.geomspace(1e-3, end * (1.0 - 1e-6) - 1.0, 200)
        lines.append((f"ζ = {zeta:g}", line_only(along, 1.0 / largest_stable_steps(along, zeta))))
    marks = (
        Mark("Routh (5.15)", 1.0),
        Mark("A", 1.0, 0.0),
        Mark("B", last, float(point_b(CASE.unity_zeta))),
        Mark("B with stiction", float(stiction.x[-1]), float(stiction.y[-1])),
    )
    axes = "gain γ = J_l G_I K/b [-]", "F_friction/F_error [-]"
    panel = Panel("k_tr = k_c", *axes, lines, "", marks, (0.2, 2.6, 0.0, 2.2), is_relative=True)
    return (panel,)


def plant_largest_step(gamma: float, zeta: float = CASE.unity_zeta, step: float = 6e-5) -> float:
    """F_error/F_friction of the largest step with a bounded response of the simulated plant; to 0.5 %.

    A response grows if its error in the third quarter of a second exceeds that in the second; at 13 Hz this
    decides all but the border itself.

    Parameters
    ----------
    gamma, zeta : of the loop.
    step : of the plant, s.
    """
    node = equal_node(zeta, (1.0, 1.0))
    gain = gamma * float(routh_gain(node.inertia, node.damping, node.transmission_stiffness, node.contact_stiffness))

    def grows(desired: float) -> bool:
        found = force_step(desired, node.contact_stiffness, gain, node.damping, (1.0, 1.0), 0.75, step=step)
        error = np.abs(desired - found.force)
        third = len(error) // 3
        return float(error[2 * third :].max()) > float(error[third : 2 * third].max())

    low, high = 1.0, 2.0
    while grows(low):
        low, high = low / 2.0, low
    while not grows(high):
        low, high = high, high * 2.0
    while high > low * 1.01:
        middle = float(np.sqrt(low * high))
        if grows(middle):
            high = middle
        else:
            low = middle
    return float(np.sqrt(low * high))


def draw_loop(design: LoopDesign, file: Path) -> None:
    """Draw the bound of figure 5.8, F_dynamic over the largest stable step, with a loop on it, into a file.

    The bound is that of the loop without sampling and delay; the margin is that with both, in units of gamma, for
    this contact and all softer ones.
    """
    node, zeta = design.node, max(design.zeta, 1e-3)
    stiction = node.static_friction / node.dynamic_friction if node.dynamic_friction else 1.0
    gamma = np.linspace(1.001, float(gamma_3(zeta)), 100)
    ratio = node.transmission_stiffness / node.contact_stiffness
    steps = largest_stable_steps(gamma, zeta, ratio, stiction, 1e-2)
    held = np.isfinite(steps) & (steps > 0.0)
    plant = node.inertia, node.damping, node.transmission_stiffness, node.contact_stiffness
    margin = float(gain_ratio(design.verdict.margin, *plant))
    friction = node.dynamic_friction / design.loop.error_limit if design.loop.error_limit else 0.0
    marks = (
        Mark("linear limit (5.15)", 1.0),
        Mark("margin as sampled", margin),
        Mark(f"this loop: domain {design.verdict.domain}", design.gamma, friction),
    )
    axes = "gain γ over the linear limit [-]", "F_dynamic/F_error [-]"
    bound = ("largest stable step", line_only(gamma[held], 1.0 / steps[held]))
    draw_panels((Panel(f"ζ = {zeta:.3g}", *axes, (bound,), marks=marks),), file)
