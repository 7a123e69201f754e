"""The stability bound of figure 5.8 for the stiffness, damping and stiction of a loop, with the loop on it."""

from pathlib import Path

import numpy as np

from wam_studies.figures.panels import Mark, Panel, line_only
from wam_studies.figures.style import draw_panels
from wam_theory.linear_loop import gain_ratio
from wam_theory.loop_design import LoopDesign
from wam_theory.regimes import gamma_3
from wam_theory.stability_map import largest_stable_steps


def draw(design: LoopDesign, file: Path) -> None:
    """Draw F_dynamic over the largest stable step, over gamma, and write the picture.

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
