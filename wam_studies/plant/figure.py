"""The plant's effects as one figure and one table."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from wam_analysis.measures.limit_cycle import mean_cycle
from wam_analysis.table import markdown
from wam_studies.figures.panels import Series, ThesisPanel, draw_panels
from wam_studies.plant.effects import STUDIES, PlantCurve, resonances
from wam_studies.plant.levels import LEVELS

RATIOS = (4.0, 14.0, 60.0)
HZ = 0.5 / np.pi
POINTS = 40  # of the plant that are drawn
# of STUDIES: title, axes, and the scale of y
SHOWN = {
    "slack": ("slack of the loose strand", "stretch [rad]", "circuit torque [N m]", 1.0),
    "creep": ("creep, out and back (6.19)", "travel of the motor [rad]", "creep [mrad]", 1e3),
    "efficiency": ("efficiency (6.15)", "motor torque [N m]", "power out / power in [-]", 1.0),
    "ripple": ("eccentric pulley (6.23)", "angle of the motor [rad]", "torque [N m]", 1.0),
    "linear surface": ("linear surface", "depth [m]", "force [N]", 1.0),
    "hardening surface": ("hardening surface", "depth [m]", "force [N]", 1.0),
    "stiction cycle": ("stiction limit cycle (5.8), (5.9)", "time [s]", "F_c [N m]", 1.0),
    "actuator cycle": ("actuator limit cycle (5.20)", "time [s]", "motor at the joint [rad]", 1.0),
    "impact": ("impact (3.1)", "stiffness [N/m]", "greatest force [N]", 1.0),
    "backlash in the loop": ("actuator cycle with backlash (2.2)", "play [rad]", "cycle [rad]", 1.0),
    "backlash in a torque loop": ("torque loop with backlash (2.2)", "by describing function [Hz]", "cycle [Hz]", 1.0),
}


EFFECTS = (
    *(name for name in STUDIES if name != "stiction cycle"),
    "stiction cycle, peak to peak",
    "stiction cycle, period",
    "lower resonance",
    "upper resonance",
    *LEVELS,
)


def figure(file: Path) -> dict[str, float]:
    """Draw the figure; returns the greatest difference from theory of each of `EFFECTS`.

    Parameters
    ----------
    file : picture; its suffix is the format.
    """
    curves = {name: study() for name, study in STUDIES.items()}
    found = [resonances(ratio, np.geomspace(1e2, 1e5, 25)) for ratio in RATIOS]
    both = {side: [getattr(one, side) for one in found] for side in ("lower", "upper")}
    shown = [ThesisPanel(*SHOWN[name][:3], (("theory", _series(curves[name], SHOWN[name][3])),)) for name in SHOWN]
    for side, of_ratios in both.items():
        lines = tuple((f"N = {n:g}", _series(curve, HZ)) for n, curve in zip(RATIOS, of_ratios, strict=True))
        axes = "contact stiffness [N m/rad]", "frequency [Hz]"
        shown.append(ThesisPanel(f"{side} resonance (4.4)", *axes, lines, "xy"))
    draw_panels(tuple(shown), file, 4)
    stiction = curves.pop("stiction cycle")
    plant, exact = mean_cycle(stiction.x, stiction.plant), mean_cycle(stiction.x, stiction.theory)
    errors = (
        *(curve.error for curve in curves.values()),
        abs(plant.peak_to_peak / exact.peak_to_peak - 1.0),
        abs(plant.period / exact.period - 1.0),
        *(max(map(_relative, of_ratios)) for of_ratios in both.values()),
        *(level().error for level in LEVELS.values()),
    )
    return dict(zip(EFFECTS, errors, strict=True))


def _series(curve: PlantCurve, scale: float) -> Series:
    each = slice(None, None, max(1, len(curve.x) // POINTS))
    return Series(curve.x, curve.theory, curve.x[each], curve.plant[each]).scaled(1.0, scale)


def _relative(curve: PlantCurve) -> float:
    return float(np.abs(curve.plant / curve.theory - 1.0).max())


def table(errors: Mapping[str, float]) -> str:
    """Those differences as Markdown."""
    rows = [(n, "below 0.001 %" if e < 1e-5 else f"{100.0 * e:.2g} %") for n, e in errors.items()]
    return markdown(("effect", "greatest difference from theory"), rows)
