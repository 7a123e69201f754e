"""Scenarios: paths without jerks, pushes, waiting for a contact, and files that are refused with a reason."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import yaml
from arms import CONFIGURATION, SHARED, WAM

from wam_control.force.contact_place import pinned_position
from wam_control.force.force_loop import ForceCommand
from wam_control.force.task import AxisKind, TaskAxis, TaskCommand
from wam_control.task.scenario import (
    NO_FORCE,
    Chirp,
    Push,
    Scenario,
    ScenarioOutput,
    ScenarioParameters,
    ScenarioStep,
    load,
    load_for,
)
from wam_control.task.scenario_node import ScenarioNode
from wam_control.task.scenario_settings import Setting
from wam_description.arm import Shared
from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError, parameter
from wam_description.signals import NO_CONTACT, ZERO, Contact, PathPoint, PosturePath, State
from wam_description.wiring import Call, Input, Inputs, Outputs, reaction
from wam_sim.simulation import Simulation


@dataclass(frozen=True)
class TunableParameters:
    stride: float = parameter("a live number of a controller of one's own", live=True)


DT = 0.005
START, GOAL = [0.0, -0.6, 0.0, 0.5], [0.2, -1.0, 0.1, 0.7]
PRESS = ForceCommand("base", (0.0, 0.0, -5.0))


def play(scenario: Scenario, periods: int, q: Any = START, contact: Contact = NO_CONTACT) -> list[ScenarioOutput]:
    return [scenario.step(q, contact, DT) for _ in range(periods)]


def touching(newtons: float) -> Contact:
    return Contact("outer_link", 0.3, (0.0, newtons, 0.0))


def test_path_has_the_smallest_jerk() -> None:
    outs = play(Scenario([ScenarioStep("go", 1.0, tuple(GOAL)), ScenarioStep("stay", 1.0)]), 300)
    assert outs[0].posture == START
    assert [(out.posture, out.step.name) for out in outs[201:]] == [(GOAL, "stay")] * 99
    for joint in range(4):
        path = np.array([out.posture[joint] for out in outs])
        reach = GOAL[joint] - START[joint]
        assert np.all(np.diff(path) * np.sign(reach) >= -1e-15), "it never goes back"
        speed = np.gradient(path, DT)
        assert np.max(np.abs(speed)) == pytest.approx(15.0 / 8.0 * abs(reach), rel=1e-3)
        acceleration = np.gradient(speed, DT)
        assert np.max(np.abs(acceleration)) == pytest.approx(10.0 / math.sqrt(3.0) * abs(reach), rel=0.01)
        assert np.max(np.abs(np.diff(acceleration))) < 70.0 * DT * abs(reach), "no step, at the ends too"


def test_the_next_path_goes_on_where_the_last_one_ended_even_if_the_arm_is_elsewhere() -> None:
    scenario = Scenario([ScenarioStep("there", 0.1, tuple(GOAL)), ScenarioStep("back", 0.1, tuple(START))])
    outs = play(scenario, 20) + play(scenario, 1, q=[9.0] * 4) + play(scenario, 20)
    assert outs[20].step.name == "back"
    assert outs[20].posture == GOAL
    steps = np.abs(np.diff([out.posture for out in outs], axis=0))
    assert np.max(steps) < 0.04, "no jump anywhere"


@pytest.mark.parametrize("last", [
    ScenarioStep("lift off", 1.0, tuple(START)), ScenarioStep("rest", 1.0),
    ScenarioStep("let go", 1.0, force=ForceCommand("outer_link", (0.0, 0.0, 0.0))),
])  # fmt: skip
def test_after_pressing_the_path_starts_from_the_measured_pose(last: ScenarioStep) -> None:
    scenario = Scenario([ScenarioStep("go", 0.1, tuple(GOAL)), ScenarioStep("press", 0.1, force=PRESS), last])
    play(scenario, 40)
    sunk = [0.21, -1.07, 0.1, 0.75]
    out = play(scenario, 1, q=sunk)[0]
    assert out.step == last
    assert out.posture == sunk
    assert out.force == last.force


def test_between_two_forces_the_posture_stays() -> None:
    harder = ForceCommand("base", (0.0, 0.0, -9.0))
    steps = [
        ScenarioStep("go", 0.1, tuple(GOAL)),
        ScenarioStep("press", 0.1, force=PRESS),
        ScenarioStep("more", 0.1, force=harder),
    ]
    scenario = Scenario(steps)
    outs = play(scenario, 40) + play(scenario, 1, q=[9.0] * 4)
    assert [outs[k].force for k in (0, 20, 40)] == [NO_FORCE, PRESS, harder]
    assert outs[40].posture == GOAL


def test_a_force_rises_from_that_of_the_step_before_in_its_own_frame() -> None:
    steps = [
        ScenarioStep("press", 0.1, force=ForceCommand("base", (0.0, 0.0, -4.0)), rise=0.1),
        ScenarioStep("more", 0.1, force=ForceCommand("base", (0.0, 0.0, -8.0)), rise=0.05),
        ScenarioStep("elsewhere", 0.1, force=ForceCommand("outer_link", (0.0, 6.0, 0.0), (0.0, 0.0, 1.2)), rise=0.1),
        ScenarioStep("turned", 0.1, force=ForceCommand("outer_link", (0.0, 0.0, 6.0), (0.0, -1.8, 0.0)), rise=0.1),
        ScenarioStep("anywhere", 0.1, force=ForceCommand("outer_link", (0.0, 0.0, 4.0)), rise=0.1),
        ScenarioStep("there", 0.1, force=ForceCommand("outer_link", (0.0, 0.0, 2.0), (0.0, -0.4, 0.0)), rise=0.1),
        ScenarioStep("off", 0.1, force=ForceCommand("outer_link", (0.0, 0.0, 0.0)), rise=0.1),
    ]
    found = [out.force for out in play(Scenario(steps), 140)]
    assert [force.force[2] for force in found[:40:10]] == pytest.approx([0.0, -2.0, -4.0, -8.0])
    assert found[50].force == pytest.approx((0.0, 3.0, 0.0))
    assert found[50].torque == pytest.approx((0.0, 0.0, 0.6))
    assert found[70][1:] == (pytest.approx((0.0, 3.0, 3.0)), pytest.approx((0.0, -0.75, 0.75))), "halfway between both"
    assert [pinned_position(force) for force in found[81:120:18]] == [None, None, ("outer_link", pytest.approx(0.2))]
    assert pinned_position(found[130]) == ("outer_link", pytest.approx(0.2)), "its own to the end"
    swept = Scenario([steps[0]._replace(seconds=1.0, chirp=Chirp(4.0, 2.0, 3.0))])
    assert np.abs(np.diff([out.force.force[2] for out in play(swept, 199)])).max() < 0.6, "a chirp rises with its force"
    early = Scenario([steps[0]._replace(until_force=1.0), *steps[1:]])
    assert (play(early, 6) + play(early, 1, contact=touching(1.0)))[-1].force.force[2] == pytest.approx(-1.2)
    with pytest.raises(ParameterError, match="rise is 2 s; allowed: 0 to 1 s"):
        Scenario([ScenarioStep("press", 1.0, force=PRESS, rise=2.0)], SHARED)


def test_a_step_until_a_force_ends_when_it_is_detected() -> None:
    scenario = Scenario([ScenarioStep("lower", 1.0, tuple(GOAL), until_force=2.0), ScenarioStep("then", 1.0)])
    assert play(scenario, 20, contact=touching(1.9))[-1].step.name == "lower"
    out = play(scenario, 1, q=[0.1] * 4, contact=touching(-2.0))[0]
    assert out.step.name == "then"
    assert out.failure == ""
    assert out.posture == [0.1] * 4, "it presses no harder"
    assert play(scenario, 10)[-1].posture == out.posture


def test_a_contact_that_does_not_come_fails_and_asks_for_the_brakes() -> None:
    scenario = Scenario([ScenarioStep("lower", 0.1, until_force=2.0), ScenarioStep("never", 1.0)])
    outs = play(scenario, 20)
    assert not any(out.done or out.request for out in outs)
    failed, after = play(scenario, 2)
    assert failed.done
    assert failed.request == "disable"
    assert failed.failure == "step 'lower': no contact of 2 N detected within 0.1 s"
    assert after.done
    assert after.request == "", "asked once"
    assert failed.force == NO_FORCE


def test_requests_and_settings_are_made_once_when_their_step_begins() -> None:
    settings = (Setting("driver", "effects.added_coulomb_friction", (0.5,)),)
    steps = [ScenarioStep("on", 0.02, request="enable"), ScenarioStep("rub", 0.02, settings=settings)]
    outs = play(Scenario([*steps, ScenarioStep("off", 0.02, request="disable")]), 14)
    assert [(k, out.request) for k, out in enumerate(outs) if out.request] == [(0, "enable"), (8, "disable")]
    assert [(k, out.step.settings) for k, out in enumerate(outs) if out.begins] == [(0, ()), (4, settings), (8, ())]
    assert [out.done for out in outs] == [False] * 12 + [True] * 2
    assert outs[-1].failure == ""


def test_a_push_of_a_script_acts_on_the_axis_of_the_tube_not_of_the_cover(tmp_path: Path) -> None:
    """The inner tube is 1.6 in aside at the elbow: a push on the cover's axis would hardly touch it."""
    push = {"cover": "inner_link", "contact_position": 0.5588, "newtons": [0.0, 10.0, 0.0], "begin": 0.0, "end": 0.1}
    steps = load(write(tmp_path, {"steps": [{"name": "a", "seconds": 0.2, "push": push}]}), SHARED)
    out = play(Scenario(steps, SHARED), 1)[0]
    np.testing.assert_allclose(out.push.torque, [-0.4064, 0.0, 5.588], rtol=1e-9)
    same = ScenarioStep("a", 0.2, push=Push("inner_link", 0.5588, (0.0, 10.0, 0.0), 0.0, 0.1))
    np.testing.assert_allclose(play(Scenario([same], SHARED), 1)[0].push.torque, out.push.torque, rtol=1e-9)


def test_a_push_without_times_lasts_for_its_step_and_one_of_several_steps_without_a_pause(tmp_path: Path) -> None:
    push = {"cover": "outer_link", "contact_position": 0.3, "newtons": [0.0, 10.0, 0.0]}
    names = [{"name": name, "seconds": 0.1, "push": push} for name in "ab"]
    outs = play(Scenario(load(write(tmp_path, {"steps": [*names, {"name": "c", "seconds": 0.1}]}), SHARED)), 60)
    assert [k for k, out in enumerate(outs) if any(out.push.force)] == list(range(40))
    outs = play(Scenario(load(write(tmp_path, {"steps": [{**names[0], "push": {**push, "end": 0.1}}]}), SHARED)), 30)
    assert [k for k, out in enumerate(outs) if any(out.push.force)] == list(range(20))


@pytest.mark.parametrize(("begin", "end", "acts"), [
    (0.197, 0.2, [39]), (0.1011, 0.1039, [20]), (0.1039, 0.1061, [21]), (0.1, 0.105, [20]), (0.1, 0.1001, [20]),
])  # fmt: skip
def test_a_push_between_two_outer_periods_lasts_for_one(begin: float, end: float, acts: list[int]) -> None:
    push = Push("outer_link", 0.3, (0.0, 10.0, 0.0), begin, end)
    outs = play(Scenario([ScenarioStep("pushed", 0.2, push=push), ScenarioStep("free", 0.1)]), 50)
    assert [k for k, out in enumerate(outs) if any(out.push.force)] == acts


def test_every_scenario_that_comes_with_the_package_can_be_loaded() -> None:
    found = sorted(packaged("wam").parent.glob("*scenario*.yaml"))
    assert found
    for path in found:
        own = path.with_name(path.name.replace("_scenario", ""))
        assert load(path, Configuration.load(own).shared if own.exists() else SHARED)


def test_a_scenario_file_says_what_the_steps_are(tmp_path: Path) -> None:
    path = write(tmp_path, {"steps": [{"name": "a", "seconds": 1}, {**WHOLE, "request": "disable"}]})
    first, second = load(path, SHARED)
    assert first == ScenarioStep("a", 1.0)
    assert second == ScenarioStep(
        "b",
        2.5,
        (0.1, -0.7, 0.05, 0.4),
        1.5,
        ForceCommand("outer_link", (0.0, -3.0, 1.0)),
        Push("inner_link", 0.3, (0.0, 9.0, 2.0), 0.1, 0.4),
        "disable",
    )


WHOLE: dict[str, Any] = {
    "name": "b",
    "seconds": 2.5,
    "posture": [0.1, -0.7, 0.05, 0.4],
    "until_force": 1.5,
    "force": {"frame": "outer_link", "newtons": [0, -3, 1]},
    "push": {"cover": "inner_link", "contact_position": 0.3, "newtons": [0.0, 9.0, 2.0], "begin": 0.1, "end": 0.4},
}


def write(directory: Path, tree: Any) -> Path:
    path = directory / "script.yaml"
    path.write_text(tree if isinstance(tree, str) else yaml.safe_dump(tree))
    return path


def placed(place: float, frame: str = "outer_link", newtons: Sequence[float] = (0, -3, 1)) -> dict[str, Any]:
    return {**WHOLE, "force": {"frame": frame, "newtons": list(newtons), "contact_position": place}}


def without(body: dict[str, Any], key: str) -> dict[str, Any]:
    return {name: value for name, value in body.items() if name != key}


@pytest.mark.parametrize(("step", "text"), [
    ("go", "is 'go'; it must be a mapping with name and seconds"),
    ({**WHOLE, "secnods": 1.0}, "unknown key 'secnods'; allowed: name, seconds, posture"),
    (without(WHOLE, "name"), "'name' is missing"),
    (without(WHOLE, "seconds"), "'seconds' is missing"),
    ({**WHOLE, "name": None}, "name is None; it must be a text"),
    ({**WHOLE, "seconds": 0}, "seconds is 0; it must be above 0"),
    ({**WHOLE, "seconds": "1 s"}, "seconds is '1 s'; it must be a finite number"),
    ({**WHOLE, "seconds": math.nan}, "seconds is nan; it must be a finite number"),
    ({**WHOLE, "posture": [0.0] * 3}, r"posture is \[0.0, 0.0, 0.0\]; it must be a list of 4 numbers"),
    ({**WHOLE, "posture": [0.0, "up", 0.0, 0.0]}, "posture is 'up'; it must be a finite number"),
    ({**WHOLE, "posture": [0.0, -9.0, 0.0, 0.0]}, "posture: joint2 is commanded to -9 rad; allowed: -2.356 to"),
    ({**WHOLE, "until_force": -1.0}, "until_force is -1; it must be 0"),
    ({**WHOLE, "request": "start"}, "request is 'start'; allowed: enable, disable, tare"),
    ({**WHOLE, "force": 5.0}, "force is 5.0; it must be a mapping with frame, newtons"),
    ({**WHOLE, "force": {"frame": "base"}}, "force: 'newtons' is missing"),
    ({**WHOLE, "force": {"frame": "hand", "newtons": [0, 0, 1]}}, "frame is 'hand'; allowed: base, inner_link"),
    ({**WHOLE, "force": {"frame": "base", "newtons": [0, 1]}}, r"newtons is \[0, 1\]; it must be a list of 3"),
    (placed(0.28, "base"), "contact_position is in m along a cover: command a force across it, in its frame"),
    (
        placed(0.28, newtons=[1, 0, 0]),
        "contact_position is in m along a cover: command a force across it, in its frame",
    ),
    (placed(0.0), "contact_position is 0 m; allowed: above 0, up to 0.4[0-9]* m of outer_link"),
    ({**WHOLE, "push": [1.0]}, r"push is \[1.0\]; it must be a mapping with cover, contact_position"),
    ({**WHOLE, "push": without(WHOLE["push"], "newtons")}, "push: 'newtons' is missing"),
    ({**WHOLE, "push": {**WHOLE["push"], "cover": "base"}}, "cover is 'base'; allowed: inner_link, outer_link"),
    (
        {**WHOLE, "push": {**WHOLE["push"], "contact_position": 0.6}},
        "contact_position is 0.6 m; inner_link reaches from 0 to 0.5588 m",
    ),
    (
        {**WHOLE, "push": {**WHOLE["push"], "newtons": [0, 0, 600]}},
        "push: the force is 600 N; allowed: up to disturbance_force_limit, 500 N",
    ),
    ({**WHOLE, "push": {**WHOLE["push"], "end": 0.1}}, "push has begin 0.1 s and end 0.1 s; allowed: begin from 0"),
    ({**WHOLE, "push": {**WHOLE["push"], "end": 5.0}}, "begin 0.1 s and end 5 s; allowed: .* up to the 2.5 s of "),
    ({**WHOLE, "push": {**without(WHOLE["push"], "end"), "begin": 2.5}}, "begin 2.5 s and end 2.5 s; allowed"),
])  # fmt: skip
def test_a_step_that_is_wrong_is_refused_with_file_step_and_value(step: Any, text: str, tmp_path: Path) -> None:
    path = write(tmp_path, {"steps": [{"name": "fine", "seconds": 1.0}, step]})
    with pytest.raises(ParameterError, match=text) as refusal:
        load(path, SHARED)
    assert str(refusal.value).startswith(f"{path}, step 2")


@pytest.mark.parametrize(("tree", "text"), [
    ("steps: [", "is not YAML"),
    ("steps: []\nsteps: []", "'steps' is given twice"),
    ("steps: &a [{name: x, seconds: 1.0, set: *a}]", r"is not YAML: \*a is inside of what it refers to"),
    (
        {"steps": [{"name": "a", "seconds": 1, "set": {"force_loop": {1: 2}}}]},
        "is not YAML: the key 1 is no text; write it in quotes",
    ),
    ("- 1", "has no list 'steps'"),
    ("", "has no list 'steps'"),
    ({"step": [{"name": "a", "seconds": 1}]}, "unknown key 'step'; allowed: steps"),
    ({"steps": {"name": "a"}}, "has no list 'steps'"),
    ({"steps": []}, "has no steps; give at least one"),
    ({"steps": [{"name": "a", "seconds": 1}], "loops": 3}, "unknown key 'loops'; allowed: steps"),
])  # fmt: skip
def test_a_file_that_is_no_scenario_is_refused_by_name(tree: Any, text: str, tmp_path: Path) -> None:
    path = write(tmp_path, tree)
    with pytest.raises(ParameterError, match=text) as refusal:
        load(path, SHARED)
    assert str(path) in str(refusal.value)


TOO_FAST = (
    "'go': joint2 turns at up to 7.5 rad/s; allowed: up to arm.joints.speed_limit, 4 rad/s; give .* at least 0.188 s"
)


def test_a_posture_that_cannot_be_reached_in_its_time_is_refused_where_its_start_is_known(tmp_path: Path) -> None:
    go = {"name": "go", "seconds": 0.1, "posture": GOAL}
    there = {"name": "there", "seconds": 1.0, "posture": START}
    for steps in ([there, go], [{**there, "posture": GOAL}, {**there, "name": "back"}, go]):
        with pytest.raises(ParameterError, match=TOO_FAST):
            load(write(tmp_path, {"steps": steps}), SHARED)
    load(write(tmp_path, {"steps": [there, {**go, "seconds": 0.19}]}), SHARED)
    load(write(tmp_path, {"steps": [there, {**there, "until_force": 1.0}, go]}), SHARED)  # it may stop before START


def test_a_posture_too_far_from_where_the_arm_is_fails_before_it_moves() -> None:
    step = ScenarioStep("go", 0.1, tuple(GOAL))
    outs = play(Scenario([step], SHARED), 3)
    assert re.search(TOO_FAST, outs[-1].failure)
    assert outs[-1].posture == START
    assert not play(Scenario([step._replace(seconds=0.19)], SHARED), 3)[-1].failure


def test_a_file_that_is_missing_or_no_text_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"scenario text is not a file; give the path of a YAML file"):
        load("text", SHARED)
    with pytest.raises(ParameterError, match=r"given as a text of several lines; write it to a file"):
        load("steps:\n  - {name: a, seconds: 1.0}\n", SHARED)
    with pytest.raises(ParameterError, match=rf"scenario {tmp_path}/none\.yaml is not a file"):
        load(tmp_path / "none.yaml", SHARED)
    path = tmp_path / "binary.yaml"
    path.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(ParameterError, match=f"scenario {path} is not YAML"):
        load(path, SHARED)


# an arm whose brakes are on

FOR_NOTHING = "step 'go': it commanded the arm, and the brakes were on; give it, or a step before it, 'request: enable'"


@pytest.mark.slow
@pytest.mark.parametrize("step", [ScenarioStep("go", 0.2, tuple(GOAL)), ScenarioStep("go", 0.1, force=PRESS)])
def test_a_scenario_that_commands_an_arm_which_nobody_has_enabled_fails(step: ScenarioStep) -> None:
    run = Simulation(CONFIGURATION, [ScenarioStep("wait", 0.05), step, ScenarioStep("never", 1.0)])
    assert run.play().startswith(FOR_NOTHING)
    assert run.driver.stamp / 1e9 == pytest.approx(0.051 + step.seconds, abs=0.01)
    assert Simulation(CONFIGURATION, [step]).play().startswith(FOR_NOTHING), "the last step, too"


@pytest.mark.slow
def test_whoever_enables_the_arm_a_scenario_may_command_it_and_push_it_braked() -> None:
    push = Push("outer_link", 0.3, (0.0, 5.0, 0.0), 0.0, 0.1)
    assert Simulation(CONFIGURATION, [ScenarioStep("push", 0.1, push=push)]).play() == ""
    steps = [ScenarioStep("go", 0.1, tuple(START)), ScenarioStep("stop", 0.02, request="disable")]
    assert Simulation(CONFIGURATION, [ScenarioStep("on", 0.05, request="enable"), *steps]).play() == ""
    assert Simulation(CONFIGURATION, [steps[0]._replace(request="enable")]).play() == ""
    run = Simulation(CONFIGURATION, steps)
    assert run.driver.safety.enable("").success
    assert run.play() == ""


def test_a_force_with_a_place_is_commanded_with_the_torque_that_pins_it(tmp_path: Path) -> None:
    step = {**without(placed(0.28), "push"), "chirp": {"newtons": 1.0, "from": 1.0, "to": 2.0}}
    script = load(write(tmp_path, {"steps": [step]}), SHARED)
    node = ScenarioNode(SHARED, ScenarioParameters(""), Scenario(script))
    sizes = []
    for tick in range(100):
        joints = {"joint_states": (tick, State(list(START), [], []))}
        command = node.step(Inputs.of(tick + 1, 0.005, joints))["force_command"]
        assert pinned_position(ForceCommand(*command)) == ("outer_link", pytest.approx(0.28))
        sizes.append(math.hypot(*command.force))
    assert max(sizes) > min(sizes) + 0.5


def test_a_chirp_swings_the_force_along_itself_from_the_first_frequency_to_the_last() -> None:
    chirp = Chirp(2.0, 1.0, 8.0)
    press = ForceCommand("base", (0.0, -3.0, -4.0))
    dt = 1e-3
    scenario = Scenario([ScenarioStep("sweep", 6.0, force=press, chirp=chirp), ScenarioStep("rest", 0.1, force=press)])
    forces = np.array([scenario.step(START, NO_CONTACT, dt).force.force for _ in range(6002)])
    swing = forces @ np.array([0.0, -0.6, -0.8]) - 5.0
    assert np.abs(forces @ np.array([1.0, 0.8, -0.6])).max() < 1e-12, "nothing across the force"
    assert swing[:6000].max() == pytest.approx(2.0, rel=1e-3)
    assert swing[6000:] == pytest.approx(0.0, abs=1e-12)
    rises = np.flatnonzero((swing[:-1] <= 0.0) & (swing[1:] > 0.0)) * dt
    between = 0.5 * (rises[1:] + rises[:-1])
    assert 1.0 / np.diff(rises) == pytest.approx(8.0 ** (between / 6.0), rel=0.02)
    assert (between[0], between[-1]) == (pytest.approx(0.5, abs=0.4), pytest.approx(5.9, abs=0.1))
    assert len(rises) == pytest.approx(6.0 * 7.0 / math.log(8.0), abs=1)  # turns of an exponential sweep


def test_a_setting_that_does_not_fit_the_other_values_is_refused_where_these_are_known(tmp_path: Path) -> None:
    rods = [{"effects.added_coulomb_friction": [0.5] * joints} for joints in (4, 3)]
    steps = [{"name": "rod", "seconds": 1.0, "set": {"driver": rod}} for rod in rods]
    path = write(tmp_path, {"steps": steps})
    assert len(load(path, SHARED)) == 2
    with pytest.raises(ParameterError, match=f"{path}, step 2: set, driver: .*added_coulomb_friction.* has 3 values"):
        load_for(CONFIGURATION, str(path))
    write(tmp_path, {"steps": steps[:1]})
    assert len(load_for(CONFIGURATION, str(path))) == 1
    without = CONFIGURATION.with_values({"nodes": ["transform", "velocity_loop", "gravity", "force_loop"]})
    with pytest.raises(ParameterError, match="step 1: set, driver: no node is named so; nodes: transform, "):
        load(path, without.shared)


def test_settings_and_chirps_are_read_and_refused_with_a_reason(tmp_path: Path) -> None:
    def read(**body: Any) -> ScenarioStep:
        file = tmp_path / "one.yaml"
        file.write_text(yaml.safe_dump({"steps": [{"name": "a", "seconds": 1.0, **body}]}))
        return load(file, SHARED)[0]

    force = {"frame": "base", "newtons": [0.0, 0.0, -5.0]}
    step = read(
        set={"driver": {"effects": {"added_coulomb_friction": [0.5, 0, 0, 0]}}, "force_loop": {"posture_gain": 2.0}}
    )
    assert step.settings == (
        Setting("driver", "effects.added_coulomb_friction", (0.5, 0, 0, 0)),
        Setting("force_loop", "posture_gain", 2.0),
    )
    assert read(force=force, chirp={"newtons": 1, "from": 2, "to": 9}).chirp == Chirp(1.0, 2.0, 9.0)
    with pytest.raises(ParameterError, match="unknown key 'velocity_loop'; allowed: driver, force_loop"):
        read(set={"velocity_loop": {"proportional_gain": [1.0]}})
    with pytest.raises(ParameterError, match="set, driver is 3; give names and values"):
        read(set={"driver": 3})
    assert isinstance(read(set={"force_loop": {"posture_gain": 2}}).settings[0].value, float), "ROS takes no other type"
    for body, reason in (
        ({"force_loop": {"posture_gain": -1.0}}, "set, force_loop: parameter 'posture_gain' is -1.0 1/s; allowed: "),
        ({"force_loop": {"force_gain": 0.01}}, "set, force_loop: parameter 'force_gain' is 0.01; it must be a list of"),
        ({"force_loop": {"feedback": "guess"}}, "'feedback' is 'guess'; allowed: one of joint_sensors, "),
        ({"force_loop": {"posture_gian": 1.0}}, "no parameter 'posture_gian' that may change while it runs; did you "),
        ({"force_loop": {"posture_gian": 1.0}}, r"did you mean 'posture_gain'\?$"),
        ({"driver": {"seed": 3}}, "set, driver: it has no parameter 'seed' that may change while it runs; it has: eff"),
        ({"force_loop": {"forc_gain": {}}}, "set, force_loop: 'forc_gain' is empty; give it a value, or leave it out"),
        (
            {"force_loop": {"limits.settling_time": 1.0, "limits": {"settling_time": 2.0}}},
            "set, force_loop: 'limits.settling_time' is given twice, with dots and without; remove one",
        ),
    ):
        with pytest.raises(ParameterError, match=f"{tmp_path}/one.yaml, step 1: .*{reason}"):
            read(set=body)
    with pytest.raises(ParameterError, match="it must begin above 0 and rise"):
        read(force=force, chirp={"newtons": 1, "from": 9, "to": 2})
    for given, text in ({}, "it has 0 N"), ({"force": {**force, "newtons": [0, 0, -5]}}, "a chirp of 8 N needs .* 5 N"):
        with pytest.raises(ParameterError, match=text):
            read(chirp={"newtons": 8, "from": 2, "to": 9}, **given)


QUICK = """
steps:
  - {name: pose, seconds: 4.0, posture: [0.0, -1.8, 0.0, 1.45]}
  - {name: slower, seconds: 0.1, set: {force_loop: {joint_speed_limit: LIMIT}}}
  - {name: quick, seconds: SECONDS, posture: [0.0, -1.8, 0.0, 0.25]}
"""


def quick(folder: Path, seconds: float, limit: float) -> str:
    path = folder / "quick.yaml"
    path.write_text(QUICK.replace("SECONDS", str(seconds)).replace("LIMIT", str(limit)))
    return str(path)


@pytest.mark.parametrize(("limit", "allowed", "least"), [(1.5, "1.875", "1.2"), (0.75, "0.9375", "2.4")])
def test_a_posture_that_the_force_loop_cannot_follow_is_refused(
    limit: float, allowed: str, least: str, tmp_path: Path
) -> None:
    text = rf"joint4 turns at up to .* force_loop:joint_speed_limit, {allowed} rad/s; .* at least {least} s"
    with pytest.raises(ParameterError, match=text):
        load_for(CONFIGURATION, quick(tmp_path, float(least) - 0.01, limit))
    load_for(CONFIGURATION, quick(tmp_path, float(least), limit))
    with pytest.raises(ParameterError, match=r"force_loop:joint_speed_limit, 0 rad/s; raise it"):
        load_for(CONFIGURATION, quick(tmp_path, 1.0, 0.0))
    held = [name for name in CONFIGURATION.shared.nodes if name != "force_loop"]
    path = write(tmp_path, {"steps": [{"name": "go", "seconds": 0.35, "posture": GOAL}]})
    load_for(CONFIGURATION.with_values({"nodes": held, "force_loop:joint_speed_limit": 0.1}), str(path))


@pytest.mark.parametrize("time", ["1.0e-150", "1.0e+150"])
def test_a_time_of_a_trajectory_that_nothing_is_computed_with_is_refused(time: str, tmp_path: Path) -> None:
    text = "steps: [{name: go, seconds: 1.0, trajectory: {postures: [[0.0, -0.5, 0.0, 0.5]], times: [TIME]}}]"
    with pytest.raises(
        ParameterError, match=r"step 'go': a point of the trajectory is at .*; allowed: 1e-06 to 1e\+06 s"
    ):
        load_for(CONFIGURATION, str(write(tmp_path, text.replace("TIME", time))))


TURNED = [1.0, -0.6, 0.0, 0.5]
SLOWLY = {"force_loop:joint_speed_limit": 0.3}


@pytest.mark.parametrize(("motion", "advice"), [
    ({"trajectory": {"postures": [TURNED]}}, "lower motion.joint_speed to 0.3 rad/s"),
    (
        {"trajectory": {"postures": [TURNED], "times": [4.0]}},
        "give it 1.56 times the time, or no times and lower motion.joint_speed to 0.3 rad/s",
    ),
    ({"tip": [0.7, 0.5, 0.1]}, "lower motion.joint_speed to 0.3 rad/s"),
])  # fmt: skip
def test_a_motion_that_the_force_loop_cannot_follow_is_refused(motion: Any, advice: str, tmp_path: Path) -> None:
    begin = {"name": "begin", "seconds": 6.0, "posture": START}
    path = str(write(tmp_path, {"steps": [begin, {"name": "go", "seconds": 9.0, **motion}]}))
    load_for(CONFIGURATION, path)
    text = rf"'go': joint\d turns at up to .* rad/s; allowed: up to force_loop:joint_speed_limit, 0.3 rad/s; {advice}$"
    with pytest.raises(ParameterError, match=text):
        load_for(CONFIGURATION.with_values(SLOWLY), path)
    if "times" not in advice:
        load_for(CONFIGURATION.with_values({**SLOWLY, "motion.joint_speed": [0.3] * 4}), path)


@pytest.mark.parametrize("motion", [{"trajectory": {"postures": [TURNED]}}, {"tip": [0.7, 0.5, 0.1]}])
def test_after_a_trajectory_or_a_line_it_is_known_where_the_next_motion_begins(motion: Any, tmp_path: Path) -> None:
    steps = [
        {"name": "begin", "seconds": 2.0, "posture": START},
        {"name": "away", "seconds": 3.0, **motion},
        {"name": "back", "seconds": 0.5, "posture": START},
    ]
    with pytest.raises(ParameterError, match=r"step 'back': joint1 turns at up to .*joint_speed_limit, 1.875"):
        load_for(CONFIGURATION, str(write(tmp_path, {"steps": steps})))


def test_only_of_a_simulated_arm_it_is_known_where_it_begins_a_real_one_is_braked_at_the_end(tmp_path: Path) -> None:
    far = [WAM.joints.start[0] + 1.0, *WAM.joints.start[1:]]
    path = write(tmp_path, {"steps": [{"name": "go", "seconds": 0.1, "posture": far}]})
    with pytest.raises(ParameterError, match="'go': joint1 turns at up to"):
        load_for(CONFIGURATION, str(path))
    assert len(load(path, SHARED)) == 1, "played into a stack that runs, by an arm that may be there"
    others = [name for name in SHARED.nodes if name != "driver"]
    assert len(load_for(CONFIGURATION.with_values({"nodes": others}), str(path))) == 1
    for nodes, requests in (
        (SHARED.nodes, [Call("driver", "pause", True)]),
        (tuple(others), [Call("driver", "enable", False)]),
    ):
        scenario = Scenario([ScenarioStep("wait", 0.005)])
        node = ScenarioNode(replace(SHARED, nodes=nodes), ScenarioParameters(""), scenario)
        for tick in range(3):
            node.step(Inputs.of(tick + 1, 0.005, {"joint_states": (tick, State(list(START), [], []))}))
        assert (node.done, node.failure, node.requests) == (True, "", requests)


@pytest.mark.slow
def test_the_arm_ends_a_posture_in_the_least_time_where_it_ends_it_without_a_limit() -> None:
    least, short = 1.2, 0.8
    pose, goal = (0.0, -1.8, 0.0, 1.45), (0.0, -1.8, 0.0, 0.25)

    def left(seconds: float, limit: float) -> float:
        steps = [ScenarioStep("pose", 0.5, pose, request="enable"), ScenarioStep("quick", seconds, goal)]
        free = {"driver:world.obstacles.positions": [5.0] * 3, "force_loop:joint_speed_limit": limit}
        free |= {"arm.joints.start": list(pose), "force_loop:guard.posture": list(pose)}
        run = Simulation(CONFIGURATION.with_values(free), steps)
        assert not run.play()
        return abs(run.rows["sim/joint_states"][-1].values[3] - goal[3])

    assert left(least, 1.5) == pytest.approx(left(least, 3.9), abs=0.01)
    assert left(short, 1.5) > left(short, 3.9) + 0.1


PRESSING = TaskAxis(AxisKind.FORCE, -1, "outer_link", 0.28, (0.0, 0.0, -1.0), 5.0)


def task(*axes: TaskAxis, frame: str = "base") -> ScenarioStep:
    return ScenarioStep("go", 1.0, task=TaskCommand(frame, axes))


def path(given: PosturePath) -> ScenarioStep:
    return ScenarioStep("go", 1.0, trajectory=given)


def setting(node: str, name: str, value: Any) -> ScenarioStep:
    return ScenarioStep("go", 1.0, settings=(Setting(node, name, value),))


@pytest.mark.slow
@pytest.mark.parametrize(("step", "text"), [
    (ScenarioStep("go", 1.0, cast(Any, np.array(GOAL))), "posture is array.*; it must be a list .*; give its tol"),
    (ScenarioStep("go", 1.0, force=cast(Any, [1.0, 2.0])), r"force is .*; give a ForceCommand\("),
    (ScenarioStep("go", 1.0, push=Push("outer_link", 2.0, ZERO, 0.0, 1.0)), "contact_position is 2 m; outer_link"),
    (task(PRESSING._replace(position=2.0)), "axis 1: contact_position is 2.0 m; allowed: 0 to"),
    (task(PRESSING, TaskAxis(AxisKind.POSITION, 3, value=9.0)), "axis 2: joint4 is commanded to 9.0 rad; allowed"),
    (task(), "the task has no axes; give at least one, or no task"),
    (setting("force_loop", "posture_gain", -1.0), "set, force_loop: parameter 'posture_gain' is -1.0 1/s; allowed"),
    (ScenarioStep("go", 1.0, settings=cast(Any, None)), r"settings is None; it must be a list of Setting\("),
    (path(PosturePath(())), "the trajectory has no points; give at least one"),
    (path(PosturePath((PathPoint(tuple(GOAL), (0.1,)),))), r"velocity is \(0.1,\); it must be a list of 4 numbers"),
])  # fmt: skip
def test_a_step_made_in_python_is_checked_as_one_of_a_file(step: ScenarioStep, text: str) -> None:
    with pytest.raises(ParameterError, match=f"^step 2[:,] .*{text}"):
        Scenario([ScenarioStep("fine", 1.0), step], SHARED)
    with pytest.raises(ParameterError, match=text):
        Simulation(CONFIGURATION, [ScenarioStep("fine", 1.0), step])


@pytest.mark.parametrize(("steps", "text"), [
    ([], "no steps"),
    (None, "steps is None; it must be a list of ScenarioStep"),
    ((one for one in [ScenarioStep("go", 1.0)]), "steps is <generator .*; it must be a list of ScenarioStep"),
    ([ScenarioStep("go", 1.0), None], "step 2 is None; give a ScenarioStep"),
    ([{"name": "go", "seconds": 1.0}], "step 1 is {'name': 'go', .*; give a ScenarioStep"),
])  # fmt: skip
def test_steps_that_are_none_are_refused_by_number(steps: Any, text: str) -> None:
    with pytest.raises(ParameterError, match=text):
        Scenario(steps)
    with pytest.raises(ParameterError, match=text):
        Simulation(CONFIGURATION, steps)


# a step with what Python has for numbers, and the keys of a file with the same
IN_PYTHON: list[tuple[dict[str, Any], dict[str, Any]]] = [
    (
        {"settings": (Setting("driver", "effects.added_coulomb_friction", cast(Any, [1, 0, 0, 0])),)},
        {"set": {"driver": {"effects": {"added_coulomb_friction": [1, 0, 0, 0]}}}},
    ),
    ({"seconds": Fraction(2), "posture": [0, 0, 0, 1]}, {"seconds": 2.0, "posture": [0.0, 0.0, 0.0, 1.0]}),
    ({"tip": [Fraction(1, 2), 0, np.float32(0.25)]}, {"tip": [0.5, 0.0, 0.25]}),
    (
        {"trajectory": PosturePath(cast(Any, [PathPoint(cast(Any, GOAL), cast(Any, []))]))},
        {"trajectory": {"postures": [GOAL]}},
    ),
    (
        {"trajectory": PosturePath((PathPoint(tuple(np.array([0, 0, 0, 1])), (), cast(Any, Fraction(2))),))},
        {"trajectory": {"postures": [[0.0, 0.0, 0.0, 1.0]], "times": [2.0]}},
    ),
    (
        {"force": ForceCommand("base", cast(Any, [0, 0, -5])), "chirp": Chirp(1, np.int64(2), Fraction(9, 2))},
        {"force": {"frame": "base", "newtons": [0, 0, -5]}, "chirp": {"newtons": 1, "from": 2, "to": 4.5}},
    ),
    (
        {"push": Push("outer_link", Fraction(1, 4), cast(Any, [0, np.int64(5), 0]), 0, Fraction(1, 2))},
        {"push": {"cover": "outer_link", "contact_position": 0.25, "newtons": [0, 5, 0], "end": 0.5}},
    ),
    (
        {
            "task": TaskCommand(
                "base",
                cast(
                    Any,
                    [TaskAxis(AxisKind.FORCE, -1, "outer_link", Fraction(1, 4), cast(Any, [0, 0, -1]), Fraction(5))],
                ),
            )
        },
        {"task": {"axes": [{"force": 5, "along": [0, 0, -1], "cover": "outer_link", "contact_position": 0.25}]}},
    ),
]


@pytest.mark.parametrize(("made", "body"), IN_PYTHON)
def test_numbers_of_a_step_made_in_python_are_those_of_a_file(
    made: dict[str, Any], body: dict[str, Any], tmp_path: Path
) -> None:
    """Compiled code refuses others with a TypeError, in the middle of the run."""
    (read,) = load(write(tmp_path, {"steps": [{"name": "go", "seconds": 1.0, **body}]}), SHARED)
    (taken,) = Scenario([ScenarioStep(**{"name": "go", "seconds": 1.0, **made})], SHARED).steps
    assert repr(taken) == repr(read), "equal, and of the same types"


def test_what_a_step_made_in_python_sets_has_to_fit_the_other_values_of_its_node() -> None:
    text = "the scenario, step 2: set, driver: .*added_coulomb_friction"
    with pytest.raises(ParameterError, match=text):
        Simulation(
            CONFIGURATION, [ScenarioStep("wait", 1.0), setting("driver", "effects.added_coulomb_friction", [0.5])]
        )


def test_a_step_made_in_python_sets_the_parameters_of_a_controller_that_takes_the_place_of_the_force_loop() -> None:
    class Tunable:
        name, parameters = "force_loop", TunableParameters

        def __init__(self, shared: Shared, own: TunableParameters) -> None:
            self.own = own

        def tune(self, own: TunableParameters) -> None:
            self.own = own

        @reaction(Input("joint_states", "position"), outputs=())
        def step(self, inputs: Inputs) -> Outputs:
            return {}

    sections = {**CONFIGURATION.sections, "force_loop": {"stride": 1.0}}
    steps = [setting("force_loop", "stride", 2.0)._replace(seconds=0.1)]
    run = Simulation(CONFIGURATION._replace(sections=sections), steps, {"force_loop": Tunable})
    assert run.play() == ""
    assert run.nodes["force_loop"].own.stride == 2.0


@pytest.mark.parametrize(("more", "chirp", "text"), [
    ({}, 0.0, "step 'press': 70 N is commanded; allowed: up to force_limit, 60 N; command less, or raise force_loop:"),
    ({}, 20.0, "90 N is commanded; allowed"),
    ({"torque": [0.0, 0.0, 0.0, 99.0]}, 0.0, "torque of joint 4: 99 N m is commanded; allowed: up to torque_limit, 40"),
    ({"task": {"axes": [{"force": 61.0, "cover": "outer_link", "along": [0, 0, 1], "contact_position": 0.3}]}}, 0.0,
     "'set': force along .*: 61 N is commanded"),
    ({"set": {"force_loop": {"force_limit": 69.0}}}, 0.0, "70 N is commanded; allowed: up to force_limit, 69 N"),
    ({"set": {"force_loop": {"force_limit": 70.0}}}, 0.0, ""),
])  # fmt: skip
def test_a_force_above_the_limit_is_refused_before_the_start(
    more: dict[str, Any], chirp: float, text: str, tmp_path: Path
) -> None:
    press = {"name": "press", "seconds": 1.0, "force": {"frame": "base", "newtons": [0.0, 0.0, -70.0]}}
    if chirp:
        press["chirp"] = {"newtons": chirp, "from": 0.1, "to": 1.0}
    path = str(write(tmp_path, {"steps": [{"name": "set", "seconds": 1.0, **more}, press]}))
    configuration = CONFIGURATION.with_values({"force_loop:force_limit": 60.0})
    if not text:
        assert load_for(configuration, path)
        return
    with pytest.raises(ParameterError, match=text):
        load_for(configuration, path)
