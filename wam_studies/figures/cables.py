"""Numbers of the figures of chapter 6: efficiency over torque and stages, creep over travel."""

from typing import NamedTuple

import numpy as np

from wam_studies.figures.series import Numbers, Series
from wam_studies.plant.effects import creep_out_and_back, efficiency_under_load
from wam_studies.plant.ideal_testbed import ideal_testbed
from wam_theory.cable import efficiency, stage_loss
from wam_theory.tension_element import equal_stages_efficiency

STAGES = np.arange(1.0, 7.0)


class EfficiencyNumbers(NamedTuple):
    """Power out over power in of the testbed over motor torque, N m; of n equal stages over tension difference/EA."""

    testbed: Series
    stages: Numbers
    strain: Numbers
    equal_stages: Numbers  # (stages, strains)


def efficiencies() -> EfficiencyNumbers:
    """Upper bound (6.15) and the plant in slow motion under load."""
    cables, found = ideal_testbed().cables, efficiency_under_load()
    torques = np.linspace(0.0, 7.5, 60)
    line = [
        efficiency(stage_loss(t, cables.stage_radius, cables.stage_ea, cables.stage_circuits, cables.stage_ratio))
        for t in torques
    ]
    strain = np.linspace(0.0, 0.03, 60)
    equal = equal_stages_efficiency(strain, 1.0, STAGES[:, np.newaxis])
    return EfficiencyNumbers(Series(torques, np.array(line), found.x, found.plant), STAGES, strain, equal)


class Creep(NamedTuple):
    """Creep of the link, rad at the joint, over the motor's absolute travel, rad, and the travel at its reversal."""

    creep: Series
    reversal: float


def creep() -> Creep:
    """Creep (6.19) under a constant load of 40 N m, the motor going out and back."""
    found = creep_out_and_back()
    each = max(1, len(found.x) // 30)
    return Creep(Series(found.x, found.theory, found.x[::each], found.plant[::each]), float(found.x[-1]) / 2.0)
