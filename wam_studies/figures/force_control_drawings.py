"""Drawings of the figures of chapter 5."""

from pathlib import Path

import numpy as np

from wam_analysis.drawing import INK, TRUE
from wam_studies.figures.conditions import CASE
from wam_studies.figures.responses import (
    CoulombResponse,
    LostContact,
    SimpleResponses,
    StaircaseResponse,
)
from wam_studies.figures.stability import DescribingFunction, StabilityBound
from wam_studies.figures.style import GREY, SECOND, THEORY, UNSTABLE, legend, picture, plant, theory_and_plant


def draw_simple(numbers: SimpleResponses, file: Path) -> None:
    """Figure 5.3."""
    with picture(file, 7.0, 2.9) as figure:
        left, right = figure.subplots(1, 2, sharey=True)
        for axes, series in ((left, numbers.proportional), (right, numbers.integral)):
            axes.axhline(CASE.desired, color=GREY, linewidth=0.7, linestyle=":")
            theory_and_plant(axes, series)
            axes.set(xlabel="time [s]", ylim=(0.0, 1.12 * CASE.desired))
        left.text(1.45, CASE.desired + 0.3, r"$F_{des}$", ha="right", color=GREY)
        left.set(title="a) proportional control", ylabel="contact force $F_c$ [N m]")
        left.annotate(
            "",
            (1.2, CASE.desired),
            (1.2, CASE.desired - numbers.steady_error),
            arrowprops={"arrowstyle": "<->", "color": GREY},
        )
        left.text(
            1.17, CASE.desired - numbers.steady_error / 2.0, "steady error (5.1)", ha="right", va="center", color=GREY
        )
        right.set(title="b) integral control")
        tau = numbers.time_constant
        right.plot([tau, tau], [0.0, CASE.desired * (1.0 - np.exp(-1.0))], color=GREY, linewidth=0.7, linestyle=":")
        right.annotate(r"$\tau = 1/(G_I K)$ (5.2)", (tau, 0.0), (4, 4), textcoords="offset points", color=GREY)
        legend(right, loc="center right")


def draw_staircase(numbers: StaircaseResponse, file: Path) -> None:
    """Figure 5.5."""
    with picture(file, 7.0, 3.2) as figure:
        axes = figure.subplots()
        axes.plot(numbers.motor.x, numbers.motor.y, color=SECOND, label="$k_{tr} x_m$, exact")
        axes.plot(*numbers.jumps, color=GREY, linewidth=0.9, linestyle="--", label="$F_c$, no inertia (5.3), (5.8)")
        theory_and_plant(axes, numbers.force, THEORY, "$F_c$, exact")
        plant(axes, numbers.motor)
        axes.axhline(CASE.stairs, color=GREY, linewidth=0.7, linestyle=":")
        axes.set(xlabel="time [s]", ylabel="[N m]")
        legend(axes, loc="lower right", ncols=2)


def draw_describing_function(numbers: DescribingFunction, file: Path) -> None:
    """Figure 5.7."""
    with picture(file, 5.6, 4.2) as figure:
        axes = figure.subplots()
        axes.plot([-4.4, 0.0], [0.0, 0.0], color=INK, linewidth=2.2)
        axes.text(-4.3, 0.1, "$-b/N(A)$,\n$A$ grows to\nthe left", fontsize=8.0, va="bottom")
        for gamma, series, colour in zip(numbers.gammas, numbers.curves, (THEORY, SECOND), strict=True):
            kind = "stable" if gamma < 1.0 else "unstable"
            theory_and_plant(axes, series, colour, rf"$b\,G(j\omega)$, $\gamma$ = {gamma:g}, linearly {kind}")
        axes.plot(numbers.crossing, 0.0, "s", color=INK, markersize=6)
        axes.annotate(
            "unstable limit\ncycle (5.16)",
            (numbers.crossing, 0.0),
            (-4.3, -1.2),
            fontsize=8.0,
            arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.7},
        )
        axes.axvline(0.0, color=GREY, linewidth=0.6)
        axes.set(xlabel=r"real part of $b\,G$", ylabel=r"imaginary part of $b\,G$", xlim=(-4.4, 2.9), ylim=(-2.1, 3.1))
        legend(axes, loc="upper left")


def draw_bound(numbers: StabilityBound, file: Path) -> None:
    """Figure 5.8."""
    with picture(file, 7.2, 4.2) as figure:
        axes = figure.subplots()
        top, bound, end = 2.2, numbers.bound, numbers.gamma_3
        axes.fill_between(bound.x, 0.0, bound.y, color=UNSTABLE, alpha=0.10, linewidth=0)
        axes.axvspan(end, 2.6, color=UNSTABLE, alpha=0.10, linewidth=0)
        axes.plot([*bound.x, end], [*bound.y, top], color=THEORY, linewidth=2.0, label="Coulomb friction, exact")
        label = rf"$F_{{static}}$ = {CASE.stiction:g} $F_{{dynamic}}$"
        axes.plot(*numbers.with_stiction, color=SECOND, linestyle="--", label=label)
        for zeta, gamma, height in numbers.others:
            axes.plot(gamma, height, color=GREY, linewidth=0.8)
            shown = np.flatnonzero(gamma < 2.0)[-1]
            label_at = (float(gamma[shown]), float(height[shown]))
            aside = (0, -9) if label_at[0] > 1.9 else (0, 3)
            text = rf"$\zeta$ = {zeta:g}"
            axes.annotate(text, label_at, aside, textcoords="offset points", fontsize=7.5, color=GREY, ha="center")
        plant(axes, bound)
        axes.axvline(1.0, color=GREY, linewidth=0.9, linestyle=":")
        axes.text(0.985, 1.6, "Routh (5.15)", rotation=90, ha="right", va="center", color=GREY, fontsize=8.0)
        axes.plot(end, numbers.point_b, "s", color=INK, markersize=5)
        axes.annotate("B", (end, numbers.point_b), (5, 2), textcoords="offset points")
        axes.plot(1.0, 0.0, "s", color=INK, markersize=5, clip_on=False)
        axes.annotate("A", (1.0, 0.0), (-12, 4), textcoords="offset points")
        for x, y, text in (
            (0.6, 0.9, "I\nstable for\nevery step"),
            (1.55, 1.75, "II\nstable for small steps"),
            (2.42, 1.85, "III\nunstable"),
        ):
            axes.text(x, y, text, ha="center", va="center")
        axes.set(
            xlim=(0.2, 2.6),
            ylim=(0.0, top),
            xlabel=r"gain, $\gamma = J_l G_I K / b$",
            ylabel="$F_{friction}/F_{error}$",
            title=rf"$\zeta$ = {numbers.zeta:g}, $k_{{tr}} = k_c$",
        )
        legend(axes, loc="upper left")


def draw_coulomb(numbers: CoulombResponse, file: Path) -> None:
    """Figure 5.9."""
    with picture(file, 7.0, 4.2) as figure:
        upper, lower = figure.subplots(2, 1, sharex=True)
        theory_and_plant(upper, numbers.force, THEORY, "exact")
        upper.axhline(CASE.desired, color=GREY, linewidth=0.7, linestyle=":")
        upper.set(ylabel="$F_c$ [N m]", title=rf"$\gamma$ = {numbers.gamma:g}, $\zeta$ = {numbers.zeta:g}")
        theory_and_plant(lower, numbers.motor, SECOND, "exact")
        lower.set(xlabel="time [s]", ylabel="motor $x_m$ at the joint [rad]")
        legend(upper, loc="lower right")


def draw_trajectory(numbers: CoulombResponse, file: Path) -> None:
    """Figure 5.11, which the thesis draws in space, as seen along two of its axes."""
    with picture(file, 7.4, 3.4) as figure:
        exact, points = (1e3 * numbers.exact[0], *numbers.exact[1:]), (1e3 * numbers.plant[0], *numbers.plant[1:])
        labels = ("motor $x_m$ at the joint [mrad]", "$F_c$ [N m]", "velocity [rad/s]")
        for axes, across, up in zip(figure.subplots(1, 2), (0, 0), (1, 2), strict=True):
            axes.plot(exact[across], exact[up], color=THEORY, linewidth=1.0, label="exact")
            axes.plot(points[across], points[up], "o", color=TRUE, markersize=2.6, mfc="none", mew=0.7, label="plant")
            axes.plot(exact[across][-1], exact[up][-1], "s", color=INK, markersize=4, label="at rest")
            axes.set(xlabel=labels[across], ylabel=labels[up])
        axes.legend(loc="upper left")


def draw_lost_contact(numbers: LostContact, file: Path) -> None:
    """Figure 5.10."""
    with picture(file, 5.4, 3.6) as figure:
        axes = figure.subplots()
        low = float(numbers.cycle.x.min())
        axes.axvspan(1.08 * low, 0.0, color=GREY, alpha=0.12, linewidth=0)
        axes.text(0.98 * low, 0.0, "no contact", va="center", fontsize=8.0)
        theory_and_plant(axes, numbers.cycle, THEORY, "exact")
        axes.plot(CASE.desired, 0.0, "+", color=INK, markersize=8)
        axes.annotate("$F_{des}$", (CASE.desired, 0.0), (4, 4), textcoords="offset points")
        axes.set(
            xlabel="$k_c x$ [N m] (right of 0 the contact force)",
            ylabel="velocity of the link [rad/s]",
            title=rf"$\gamma$ = {numbers.gamma:.3g}, $\zeta$ = {numbers.zeta:g}",
            xlim=(1.08 * low, None),
        )
        legend(axes, loc="upper right")
