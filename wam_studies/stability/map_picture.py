"""The stability map of figure 5.8 for the stiffness and stiction of a loop, with the loop on it."""

import math
from pathlib import Path

import numpy as np
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from wam_analysis.drawing import MEASURED, TRUE
from wam_control.force.loop_design import LoopDesign
from wam_studies.figures.style import GREY, UNSTABLE, picture
from wam_theory.linear_loop import gain_ratio
from wam_theory.stability_map import largest_stable_steps

COLUMNS, ROWS = 40, 25
SPAN = 3.0  # of gamma and of zeta around the loop
LEAST = ((1.001, 3.0), (0.05, 1.0))  # ends of gamma and zeta that are shown at least


def draw(design: LoopDesign, file: Path) -> None:
    """Draw the largest stable step over gamma and zeta, in F_dynamic, and write the picture.

    The map is that of the loop without sampling and delay; the dashed line is the margin with both, in units of
    gamma, for this contact and all softer ones.
    """
    node = design.node
    gamma = np.geomspace(LEAST[0][0], max(LEAST[0][1], SPAN * design.gamma), COLUMNS)
    zeta = np.geomspace(min(LEAST[1][0], design.zeta / SPAN), max(LEAST[1][1], SPAN * design.zeta), ROWS)
    ratio = node.transmission_stiffness / node.contact_stiffness
    stiction = node.static_friction / node.dynamic_friction if node.dynamic_friction else 1.0
    steps = largest_stable_steps(gamma[None, :], zeta[:, None], ratio, stiction, 1e-2)
    plant = node.inertia, node.damping, node.transmission_stiffness, node.contact_stiffness
    margin = float(gain_ratio(design.verdict.margin, *plant))
    with picture(file, 6.4, 4.8) as figure:
        axes = figure.add_subplot()
        shown = np.where(np.isfinite(steps) & (steps > 0.0), np.log10(np.maximum(steps, 1e-9)), math.nan)
        mesh = axes.pcolormesh(gamma, zeta, shown, cmap="viridis", shading="nearest")
        known = shown[np.isfinite(shown)]
        decades = range(math.ceil(np.min(known)), math.floor(np.max(known)) + 1) if len(known) else range(0)
        bar = figure.colorbar(mesh, label="largest stable step, in units of F_dynamic", ticks=decades)
        bar.ax.set_yticklabels([f"{10.0**each:g}" for each in decades])
        axes.axvspan(min(0.3, design.gamma / SPAN), 1.0, color=TRUE, alpha=0.12, lw=0)
        axes.contour(gamma, zeta, (steps > 0.0).astype(float), levels=[0.5], colors=[GREY])
        axes.axvline(margin, color=MEASURED, ls="--", label="margin with sampling, delay, softer contacts")
        axes.plot(
            design.gamma,
            design.zeta,
            "o",
            color=UNSTABLE,
            mec="white",
            label=f"this loop: domain {design.verdict.domain}",
        )
        axes.set(xscale="log", yscale="log", xlim=(min(0.3, design.gamma / SPAN), gamma[-1]), ylim=(zeta[0], zeta[-1]))
        axes.set(xlabel="gamma: gain over that of the linear limit, (5.15)", ylabel="zeta: damping ratio, (5.12)")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_locator(NullLocator())
        for domain, x, y in (("I", 0.04, 0.93), ("II", 0.97, 0.06), ("III", 0.97, 0.93)):
            side = "left" if domain == "I" else "right"
            white = [withStroke(linewidth=3, foreground="white")]
            axes.text(x, y, domain, transform=axes.transAxes, ha=side, va="center", weight="bold", path_effects=white)
        figure.legend(loc="outside lower center", frameon=False)
