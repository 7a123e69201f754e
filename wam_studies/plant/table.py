"""The table of the plant's effects, on the simulated plant and by theory."""

from collections.abc import Callable, Mapping

import numpy as np

from wam_analysis.measures.limit_cycle import mean_cycle
from wam_analysis.table import markdown
from wam_driver.sensors import Encoders
from wam_studies.plant import effects, options
from wam_studies.plant.effects import PlantCurve, level, torque_loop, torque_loop_response
from wam_studies.plant.ideal_testbed import STEP
from wam_theory.backlash_cycle import exact_cycle


def noise(sd: float = 1e-3) -> PlantCurve:
    """Standard deviation of 20 000 readings of a motor encoder, rad."""
    encoders = Encoders([0.0], [sd], np.random.default_rng(1))
    readings = [encoders.read([0.0], [0.0], 1e-3)[0][0] for _ in range(20_000)]
    return level(float(np.std(readings)), sd)


def torque_cycle(hertz: float = 477.0) -> PlantCurve:
    """Torque of the cycle by backlash in a torque loop, peak to peak, N m (2.2)."""
    return level(mean_cycle(*torque_loop_response(hertz)).peak_to_peak, exact_cycle(torque_loop(hertz)).torque)


EFFECTS: dict[str, Callable[[], PlantCurve]] = {
    "slack": effects.slack,
    "backlash": effects.backlash,
    "creep": effects.creep_out_and_back,
    "efficiency": effects.efficiency_under_load,
    "torque control": effects.coulomb_like,
    "pretension": effects.pretension,
    "ripple": effects.ripple,
    "linear surface": lambda: effects.surface(0.0),
    "hardening surface": lambda: effects.surface(50.0),
    "impact": effects.impact,
    "backlash in the loop": effects.actuator_cycle_with_backlash,
    "backlash in a torque loop": effects.backlash_in_a_torque_loop,
    "cycle by backlash in a torque loop, peak to peak": torque_cycle,
    "sensor noise, 20 000 readings": noise,
    "stiction cycle": lambda: effects.stiction_cycle(STEP),
    "stiction cycle at 0.5 ms": effects.stiction_cycle,
    "impact on a damped surface": lambda: effects.damped_impact(STEP),
    "impact on a damped surface at 0.5 ms": effects.damped_impact,
    "terminated cables": options.terminated_creep,
    "gross slip": options.gross_slip,
    "cover in series": options.soft_cover,
    "current loop": options.current_loop,
    "friction of a warm motor": options.warm_friction,
}


def errors() -> dict[str, float]:
    """The greatest difference from theory of each effect."""
    return {name: measure().error for name, measure in EFFECTS.items()}


def table(found: Mapping[str, float]) -> str:
    """Those differences as Markdown."""
    rows = [(n, "below 0.001 %" if e < 1e-5 else f"{100.0 * e:.2g} %") for n, e in found.items()]
    return markdown(("effect", "greatest difference from theory"), rows)
