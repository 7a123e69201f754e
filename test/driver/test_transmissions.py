"""Other transmissions as configurations of the same plant: formulas against the plant, and the stack on each."""

from functools import partial
from typing import Any

import mujoco
import numpy as np
import pytest
import yaml

from wam_control.task.scenario import ScenarioStep
from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError
from wam_description.signals import ForceCommand
from wam_sim.simulation import Simulation
from wam_studies.figures.transmissions import EFFICIENCY, HEAVIER, KINDS, STIFFNESS, driven, measured, predicted
from wam_studies.plant.ideal_testbed import ideal_testbed, released_plant
from wam_theory.cable import circuit_torque


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_plant_has_what_formulas_of_shaft_cable_and_gears_say(kind: str) -> None:
    expected, found = predicted(kind), measured(kind)
    assert set(expected) - set(found) == {HEAVIER}
    for name, value in found.items():
        assert value == pytest.approx(expected[name], rel=0.01, abs=1e-9)


def test_shaft_at_motor_speed_is_as_stiff_as_the_cable_and_direct_drive_pays_with_heat() -> None:
    cables, gears, direct = map(predicted, KINDS)
    assert gears[STIFFNESS] == pytest.approx(cables[STIFFNESS], rel=0.03)
    assert gears[EFFICIENCY] < cables[EFFICIENCY] < direct[EFFICIENCY]
    assert direct[HEAVIER] == pytest.approx(14.0)
    assert driven("shaft and gears").stiffness == pytest.approx(gears[STIFFNESS], rel=1e-3)  # the set's E A


@pytest.mark.slow
@pytest.mark.parametrize("name", filter(None, KINDS.values()))
def test_stack_presses_with_every_transmission(name: str) -> None:
    values = yaml.safe_load(packaged(f"experiments/sets/{name}").read_text(encoding="utf-8"))
    testbed = Configuration.load(packaged("testbed")).with_values(values)
    press = ForceCommand("link", (0.0, -20.0, 0.0))
    run = Simulation(testbed, [ScenarioStep("press", 6.0, request="enable", force=press)])
    assert not run.play()
    q = np.array([row.values[0] for row in run.rows["sim/joint_states"]])
    force = -1464.28 / 0.9144 * q[-200:]
    assert float(force.mean()) == pytest.approx(20.0, abs=0.3)


def test_torque_of_a_circuit_over_its_stretch_is_that_of_a_slack_strand_and_of_backlash() -> None:
    (circuit,), play = ideal_testbed().circuits, 0.04
    slack = partial(circuit_torque, stiffness=circuit.stiffness, pretension=circuit.pretension, radius=circuit.radius)
    cases: list[tuple[dict[str, Any], float, Any]] = [
        ({"slack": True}, circuit.slack_stretch, slack),
        (
            {"backlash": (play,)},
            play,
            lambda x: circuit.stiffness * np.sign(x) * np.maximum(np.abs(x) - play / 2, 0.0),
        ),
    ]
    for effects, scale, law in cases:
        plant, stretches, found = released_plant(ideal_testbed(), **effects), np.linspace(-2.5, 2.5, 101) * scale, []
        for stretch in stretches:
            plant.data.qpos[:] = (stretch, 0.0)
            mujoco.mj_forward(plant.model, plant.data)
            found.append(plant.circuit_torque[0])
        assert found == pytest.approx(law(stretches), rel=0.0, abs=1e-6 * np.abs(law(stretches)).max())


def test_link_moves_within_the_play_and_not_beyond() -> None:
    plant = released_plant(ideal_testbed(rotor=1e9), backlash=(0.14,))
    assert plant.q == plant.theta == [0.0]
    plant.push("link", np.zeros(3), np.array([0.0, 0.0, 1e-3]))
    before = plant.circuit_torque
    while plant.q[0] < 0.0049:
        plant.step([0.0])
        assert plant.circuit_torque == before == [0.0]
    while plant.qd[0] > 0.0:
        plant.step([0.0])
    assert 0.005 < plant.q[0] < 0.0052


def test_a_play_for_each_motor_is_refused_if_motors_are_missing() -> None:
    with pytest.raises(ParameterError, match="backlash"):
        released_plant(ideal_testbed(), backlash=(0.1, 0.2))
