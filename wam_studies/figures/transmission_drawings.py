"""Drawings of figures 3.1, 4.9 and of chapter 6."""

from pathlib import Path

import numpy as np

from wam_studies.figures.bandwidth import Breakpoints
from wam_studies.figures.cables import Creep, EfficiencyNumbers
from wam_studies.figures.links import Grasp
from wam_studies.figures.series import Series
from wam_studies.figures.style import GREY, SHADES, THEORY, legend, picture, plant, theory_and_plant

HZ = 0.5 / np.pi


def draw_grasp(numbers: Grasp, file: Path) -> None:
    """Figure 3.1."""
    with picture(file, 7.0, 2.9) as figure:
        left, right = figure.subplots(1, 2)
        for axes, rows, text in (
            (left, numbers.length, "useful length of a link, $L'/L$  (3.2)"),
            (right, numbers.diameter, "largest cylinder, $D_{cyl}/L$  (3.3)"),
        ):
            for mu, row, colour in zip(numbers.friction, rows, SHADES, strict=False):
                axes.semilogx(numbers.aspect_ratio, row, color=colour, label=rf"$\mu$ = {mu:g}")
            axes.set(xlabel="aspect ratio, $L/W$", ylabel=text, ylim=(0.0, None))
            axes.set_xticks([2, 5, 10, 20, 40], ["2", "5", "10", "20", "40"])
            axes.minorticks_off()
        legend(left, loc="lower right")


def draw_breakpoints(numbers: Breakpoints, file: Path) -> None:
    """Figure 4.9, a to c."""
    with picture(file, 10.0, 3.4) as figure:
        first, second, third = figure.subplots(1, 3)
        for axes in (first, second):
            axes.set(xscale="log", yscale="log", xlabel="contact stiffness at the joint [N m/rad]", ylabel="[Hz]")
            axes.axvline(numbers.crossover, color=GREY, linewidth=0.7, linestyle=":")
        for series, label, colour in (
            (numbers.lower, r"$\omega_1$", THEORY),
            (numbers.upper, r"$\omega_2$", SHADES[2]),
        ):
            theory_and_plant(first, _hertz(series), colour, label)
        first.set(title="a) breakpoints (4.4), N = 14", ylim=(1.0, 2e3))
        legend(first, loc="upper left")
        x = numbers.lower.x
        second.plot(x, HZ * numbers.lower.y, color=THEORY, label=r"$\omega_1$, N = 14  (4.4)")
        second.plot(x, HZ * numbers.link, color=SHADES[3], linestyle="--", label=r"$\sqrt{k_c/J_l}$  (4.7)")
        second.plot(x, HZ * numbers.rotor, color=SHADES[4], linestyle="--", label=r"$\sqrt{k_{tr}/J_m}$  (4.7)")
        plant(second, _hertz(numbers.lower))
        second.set(title="b) the approximation for small N", ylim=(1.0, 2e3))
        second.text(
            0.85 * numbers.crossover,
            1.3,
            f"(4.9): {numbers.crossover:.0f}",
            ha="right",
            fontsize=7.5,
            color=GREY,
        )
        legend(second, loc="upper left")
        for series, ratio, colour in zip(numbers.family, numbers.ratios, SHADES, strict=True):
            theory_and_plant(third, series, colour, f"N = {ratio / numbers.matched:.2g} $N_m$")
        third.axhline(1.0, color=GREY, linewidth=0.7, linestyle=":")
        third.set(
            xscale="log",
            yscale="log",
            xlabel="contact stiffness over that of (4.9)",
            ylabel=r"$\omega_1$ over its asymptote (4.6)",
            title=f"c) several N, $N_m$ = {numbers.matched:.4g}",
            ylim=(7e-3, 1.5),
        )
        legend(third, loc="lower right")


def _hertz(series: Series) -> Series:
    return Series(series.x, HZ * series.y, series.plant_x, HZ * series.plant_y)


def draw_efficiency(numbers: EfficiencyNumbers, file: Path) -> None:
    """Efficiency (6.15): the testbed's two stages over torque, and n stages over the difference of tension."""
    with picture(file, 7.0, 2.9) as figure:
        left, right = figure.subplots(1, 2)
        theory_and_plant(left, numbers.testbed)
        left.set(title="two-stage testbed", xlabel="motor torque [N m]", ylabel="power out / power in", xlim=(0.0, 7.5))
        legend(left, loc="lower left")
        for n, row in zip(numbers.stages.tolist(), numbers.equal_stages, strict=True):
            right.plot(1e2 * numbers.strain, row, color=THEORY, alpha=0.35 + 0.65 / n)
            right.text(3.03, row[-1], f"n = {n:g}", va="center", fontsize=8.0)
        right.set(
            title="n stages of equal stress",
            xlabel="difference of tension $(T_2 - T_1)/EA$ [%]",
            ylabel="efficiency, upper bound",
            xlim=(0.0, 3.4),
        )


def draw_creep(numbers: Creep, file: Path) -> None:
    """Creep (6.19) out and back."""
    with picture(file, 4.6, 2.9) as figure:
        axes = figure.subplots()
        creep = numbers.creep
        theory_and_plant(axes, Series(creep.x, 1e3 * creep.y, creep.plant_x, 1e3 * creep.plant_y))
        axes.axvline(numbers.reversal, color=GREY, linewidth=0.7, linestyle=":")
        axes.annotate("motor reverses", (numbers.reversal, 0.0), (4, 2), textcoords="offset points", fontsize=8.0)
        axes.set(
            xlabel="absolute travel of the motor [rad]",
            ylabel="creep of the link [mrad]",
            ylim=(0.0, None),
            xlim=(0, None),
        )
        legend(axes, loc="upper left")
