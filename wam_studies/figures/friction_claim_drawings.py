"""Drawings of figures 5.4, 5.5.1 and 5.5.2, which the thesis describes in words."""

from pathlib import Path

from matplotlib.axes import Axes

from wam_analysis.drawing import TRUE
from wam_studies.figures.conditions import CASE
from wam_studies.figures.friction_claims import AsymmetricStart, HarmonicsOfFriction, KeptContact
from wam_studies.figures.series import Series
from wam_studies.figures.style import GREY, SHADES, THEORY, legend, picture


def draw_start(numbers: AsymmetricStart, file: Path) -> None:
    """Figure 5.4."""
    with picture(file, 7.4, 2.9) as figure:
        left, right = figure.subplots(1, 2)
        for zeta, asymmetry, period, colour in zip(
            CASE.zetas, numbers.asymmetry, numbers.period, SHADES[1:], strict=False
        ):
            line_and_exact(left, asymmetry, colour, rf"$\zeta$ = {zeta:g}")
            line_and_exact(right, period, colour, rf"$\zeta$ = {zeta:g}")
        left.set(title="a) asymmetry", xlabel="slips", ylabel="asymmetry over D", yscale="log")
        right.set(
            title="b) period", xlabel="cycles", ylabel="period over that of (5.9)", xlim=(0, 200), ylim=(0.95, None)
        )
        legend(right)


def draw_harmonics(numbers: HarmonicsOfFriction, file: Path) -> None:
    """Figure 5.5.1."""
    with picture(file, 7.4, 2.9) as figure:
        left, right = figure.subplots(1, 2)
        for order, share, colour in zip(CASE.harmonics, numbers.shares, SHADES, strict=False):
            hundred = Series(share.x, 100.0 * share.y, share.plant_x, 100.0 * share.plant_y)
            line_and_exact(left, hundred, colour, f"{order:g}.")
        left.set(title="a) harmonics of the velocity", xlabel=r"$\gamma$", ylabel="over the fundamental [%]")
        legend(left, loc="upper left")
        right.semilogy(numbers.gamma, numbers.predicted, color=THEORY, linestyle="--", label="unstable, SIDF (5.16)")
        right.semilogy(numbers.gamma, numbers.exact, color=THEORY, label="unstable, exact")
        gamma, small, large = numbers.stable
        right.semilogy(gamma, small, "o", color=TRUE, mfc="none", markersize=6, label="stiction, after a small step")
        right.semilogy(gamma, large, "+", color=SHADES[0], label="stiction, after a step of F")
        right.axvline(1.0, color=GREY, linewidth=0.7, linestyle=":")
        right.set(title="b) cycles", xlabel=r"$\gamma$", ylabel=r"amplitude of $F_c/F_{dynamic}$", ylim=(0.05, 200.0))
        legend(right, loc="upper right")


def draw_kept_contact(numbers: KeptContact, file: Path) -> None:
    """Figure 5.5.2."""
    with picture(file, 4.4, 3.0) as figure:
        axes = figure.subplots()
        for zeta, series, colour in zip(numbers.zetas, numbers.series, SHADES[1:], strict=False):
            line_and_exact(axes, series, colour, rf"$\zeta$ = {zeta:g}")
        axes.set(
            xlabel=r"$\gamma$", ylabel=r"largest $F_0/F_{des}$ with contact kept", xlim=(0.7, None), ylim=(1.0, 9.0)
        )
        axes.text(1.5, 6.0, "contact lost", color=GREY)
        axes.text(0.75, 1.4, "contact kept", color=GREY)
        legend(axes)


def line_and_exact(axes: Axes, series: Series, colour: str, label: str) -> None:
    """A closed form, and the points that were found without it."""
    axes.plot(series.x, series.y, color=colour, label=label)
    axes.plot(series.plant_x, series.plant_y, "o", color=colour, markersize=3.4, mfc="none", mew=0.9)
