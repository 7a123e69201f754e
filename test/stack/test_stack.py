"""`import wam_stack`: what people use from Python, on real runs and recordings."""

from pathlib import Path

import numpy as np
import pytest

import wam_stack
from wam_bag.bag import BagError
from wam_control.task.scenario import ScenarioStep
from wam_description.parameters import ParameterError

SAMPLES = Path(__file__).resolve().parents[2] / "bags" / "sample"
POSE = [0.0, -0.6, 0.0, 0.5]


def test_a_configuration_has_values_of_ones_own_and_refuses_others() -> None:
    assert wam_stack.load(values={"timing.outer_divisor": 4}).shared.timing.outer_divisor == 4
    with pytest.raises(ParameterError, match="outer_divisor"):
        wam_stack.load(values={"timing.outer_divisor": -1})
    with pytest.raises(ParameterError, match="wam"):
        wam_stack.load("nothing")


def test_a_scenario_is_played_and_analysed() -> None:
    steps = [ScenarioStep("release", 0.1, request="enable"), ScenarioStep("rest", 0.3)]
    run = wam_stack.simulate("wam", steps)
    assert len(run.rows["joint_states"]) == pytest.approx(0.4 / 0.005, abs=3)
    assert "2 steps" in wam_stack.analyse(run).sections[0].sentences[0]
    run.step()
    with pytest.raises(ValueError, match="played again"):
        wam_stack.analyse(run)


def test_what_cannot_be_played_is_an_error_with_its_reason() -> None:
    steps = [ScenarioStep("release", 0.1, request="enable"), ScenarioStep("turn", 1.0, posture=(0.0, 0.0, 0.0, 1.0))]
    with pytest.raises(RuntimeError, match="above its limit"):
        wam_stack.simulate(wam_stack.load(values={"driver:cover_speed_limit": 0.01}), steps)


def test_a_recording_is_read_and_analysed() -> None:
    bag = SAMPLES / "wam-touch"
    assert len(wam_stack.read(bag).topics["/wam/motor_states"].stamp_ns)
    assert repr(wam_stack.analyse(bag)) == repr(wam_stack.analyse(wam_stack.read(bag, ["motor_states"])))
    table = {"time": np.arange(0.0, 5.0, 0.01), "position.elbow": np.sin(np.arange(0.0, 5.0, 0.01))}
    fields = np.rec.fromarrays(list(table.values()), names=list(table))
    known = np.ma.masked_less(fields["position.elbow"], -0.9)
    unknown, tall = known.filled(np.nan), {title: values[:, None] for title, values in table.items()}
    masked, lacking = (table | {"position.elbow": one} for one in (known, unknown))
    for one, other in ((table, fields), (table, tall), (masked, lacking)):
        assert repr(wam_stack.analyse(one)) == repr(wam_stack.analyse(other))
    with pytest.raises(BagError, match="'position' has 1000 numbers for 500 times"):
        wam_stack.analyse({"time": table["time"], "position": np.zeros((500, 2))})
    with pytest.raises(BagError, match="ndarray is no table"):
        wam_stack.analyse(np.zeros((5, 2)))


def test_the_guard_reports_its_margin_and_the_arm_its_jacobian() -> None:
    assert wam_stack.guard("wam").facts["gains"] == "accepted"
    arm = wam_stack.arm()
    assert arm.point_jacobian(POSE, "outer_link", (0.3, 0.0, 0.0)).shape == (3, 4)
    assert arm.gravity_torque(POSE)[1] == pytest.approx(7.55, abs=0.01)
