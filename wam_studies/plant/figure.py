"""The plant's effects as one figure and one table."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from wam_analysis.drawing import PREDICTED, TRUE
from wam_analysis.measures.limit_cycle import mean_cycle
from wam_analysis.table import markdown
from wam_studies.figures.style import panels
from wam_studies.plant.effects import STUDIES, PlantCurve, resonances
from wam_studies.plant.levels import LEVELS

RATIOS = (4.0, 14.0, 60.0)
STIFFNESS = np.geomspace(1e2, 1e5, 25)
RAD_TO_HZ = 1.0 / (2.0 * np.pi)


def figure(file: Path) -> str:
    """Draw the figure; returns the table of errors (Markdown).

    Parameters
    ----------
    file : picture; its suffix is the format.
    """
    curves = {name: study() for name, study in STUDIES.items()}
    with panels(file, 4, 3, 9.0, 10.4) as (_, flat):
        _curve(flat[0], curves["slack"], "slack of the loose strand", "stretch [rad]", "circuit torque [N m]")
        _curve(flat[1], curves["creep"], "creep, out and back (6.19)", "travel of the motor [rad]", "creep [mrad]", 1e3)
        _curve(flat[2], curves["efficiency"], "efficiency (6.15)", "motor torque [N m]", "power out / power in")
        _curve(flat[3], curves["ripple"], "eccentric pulley (6.23)", "angle of the motor [rad]", "torque [N m]")
        _surfaces(flat[4], curves["linear surface"], curves["hardening surface"])
        _curve(flat[5], curves["stiction cycle"], "stiction limit cycle (5.8), (5.9)", "time [s]", "$F_c$ [N m]")
        _curve(flat[6], curves["actuator cycle"], "actuator limit cycle (5.20)", "time [s]", "motor at the joint [rad]")
        _curve(flat[7], curves["impact"], "impact (3.1)", "stiffness [N/m]", "greatest force [N]")
        worst = _resonances(flat[8], flat[9])
        _curve(
            flat[10], curves["backlash in the loop"], "actuator cycle with backlash (2.2)", "play [rad]", "cycle [rad]"
        )
        _curve(
            flat[11],
            curves["backlash in a torque loop"],
            "torque loop with backlash (2.2)",
            "by describing function [Hz]",
            "cycle [Hz]",
        )
        flat[0].legend(fontsize=9.0)
    return _table(curves, worst)


def _curve(axes: Axes, curve: PlantCurve, title: str, x: str, y: str, scale: float = 1.0) -> None:
    step = max(1, len(curve.x) // 40)
    axes.plot(curve.x, scale * curve.theory, color=PREDICTED, linewidth=1.5, label="theory")
    axes.plot(curve.x[::step], scale * curve.plant[::step], "o", color=TRUE, markersize=3.2, mfc="none", label="plant")
    axes.set(title=title, xlabel=x, ylabel=y)


def _surfaces(axes: Axes, linear: PlantCurve, hardening: PlantCurve) -> None:
    _curve(axes, linear, "surface, linear and hardening", "depth [m]", "force [N]")
    _curve(axes, hardening, "surface, linear and hardening", "depth [m]", "force [N]")


def _resonances(lower: Axes, upper: Axes) -> tuple[float, float]:
    """Both resonances over contact stiffness; returns the worst error of each."""
    worst = [0.0, 0.0]
    for ratio in RATIOS:
        found = resonances(ratio, STIFFNESS)
        for i, (axes, curve) in enumerate(((lower, found.lower), (upper, found.upper))):
            axes.loglog(curve.x, curve.theory * RAD_TO_HZ, color=PREDICTED, linewidth=1.5)
            axes.loglog(curve.x[::2], curve.plant[::2] * RAD_TO_HZ, "o", color=TRUE, markersize=3.2, mfc="none")
            worst[i] = max(worst[i], float(np.abs(curve.plant / curve.theory - 1.0).max()))
        above = ratio > min(RATIOS)
        position = (found.upper.x[1], found.upper.theory[1] * RAD_TO_HZ)
        upper.annotate(
            f"N = {ratio:g}",
            position,
            (0, 4 if above else -4),
            textcoords="offset points",
            va="bottom" if above else "top",
        )
    ratios = ", ".join(f"{ratio:g}" for ratio in RATIOS)
    lower.set(title=f"lower resonance (4.4), N = {ratios}", xlabel="contact stiffness [N m/rad]", ylabel="[Hz]")
    upper.set(title="upper resonance (4.4)", xlabel="contact stiffness [N m/rad]", ylabel="[Hz]", yscale="linear")
    upper.margins(y=0.1)
    lower.yaxis.set_major_formatter("{x:g}")
    lower.yaxis.set_minor_formatter("")
    return worst[0], worst[1]


def _table(curves: dict[str, PlantCurve], worst: tuple[float, float]) -> str:
    stiction = curves["stiction cycle"]
    plant, exact = mean_cycle(stiction.x, stiction.plant), mean_cycle(stiction.x, stiction.theory)
    rows = [(name, curve.error) for name, curve in curves.items() if name != "stiction cycle"]
    rows += [
        ("stiction cycle, peak to peak", abs(plant.peak_to_peak / exact.peak_to_peak - 1.0)),
        ("stiction cycle, period", abs(plant.period / exact.period - 1.0)),
        ("lower resonance", worst[0]),
        ("upper resonance", worst[1]),
    ]
    rows += [(name, level().error) for name, level in LEVELS.items()]
    cells = [(name, _percent(error)) for name, error in rows]
    return markdown(("effect", "greatest difference from theory"), cells)


def _percent(error: float) -> str:
    return "below 0.001 %" if error < 1e-5 else f"{100.0 * error:.2g} %"
