"""The table of the plant's effects, on the simulated plant and by theory."""

from collections.abc import Callable, Mapping

import numpy as np

from wam_analysis.table import markdown
from wam_driver.sensors import Encoders
from wam_sim.batch import processes, results
from wam_sim.pieces import default_file
from wam_studies.plant import effects
from wam_studies.plant.effects import PlantCurve, level
from wam_studies.plant.ideal_testbed import STEP


def noise(sd: float = 1e-3) -> PlantCurve:
    """Standard deviation of 20 000 readings of a motor encoder, rad."""
    encoders = Encoders([0.0], [sd], np.random.default_rng(1))
    readings = [encoders.read([0.0], [0.0], 1e-3)[0][0] for _ in range(20_000)]
    return level(float(np.std(readings)), sd)


EFFECTS: dict[str, Callable[[], PlantCurve]] = {
    "slack": effects.slack,
    "backlash": effects.backlash,
    "creep": effects.creep_out_and_back,
    "efficiency": effects.efficiency_under_load,
    "torque control": effects.coulomb_like,
    "pretension": effects.pretension,
    "ripple": effects.ripple,
    "hardening surface": lambda: effects.surface(50.0),
    "impact": effects.impact,
    "impact on a damped surface": lambda: effects.damped_impact(STEP),
    "impact on a damped surface at 0.5 ms": effects.damped_impact,
    "backlash in the loop": effects.actuator_cycle_with_backlash,
    "backlash in a torque loop": effects.backlash_in_a_torque_loop,
    "sensor noise, 20 000 readings": noise,
    "stiction cycle": lambda: effects.stiction_cycle(STEP),
    "stiction cycle at 0.5 ms": effects.stiction_cycle,
    "terminated cables": effects.terminated_creep,
    "gross slip": effects.gross_slip,
    "cover in series": effects.soft_cover,
    "current loop": effects.current_loop,
    "friction of a warm motor": effects.warm_friction,
}


def error_of(name: str) -> float:
    """The greatest difference of an effect from theory."""
    return EFFECTS[name]().error


def errors() -> dict[str, float]:
    """That of each effect; in parallel, and what was measured with this code is kept."""
    with processes() as executor:
        return dict(zip(EFFECTS, results(error_of, list(EFFECTS), executor, default_file("plant")), strict=True))


def table(found: Mapping[str, float]) -> str:
    """Those differences as Markdown."""
    rows = [(n, "below 0.001 %" if e < 1e-5 else f"{100.0 * e:.2g} %") for n, e in found.items()]
    return markdown(("effect", "greatest difference from theory"), rows)
