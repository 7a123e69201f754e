"""The analysis of whole bags: two recordings whose friction, ripple and cycle are known, and bags that lack things."""

import base64
import hashlib
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from arms import WAM
from browser import looked_at
from rosbags.rosbag2 import StoragePlugin, Writer
from sample_messages import STORE, joint_state

from wam_analysis.findings.analysis import Analysis, analyse, analyse_bag
from wam_analysis.findings.charts import charts
from wam_analysis.findings.finding import Finding, Section, deviations, shown
from wam_analysis.findings.page import page
from wam_analysis.findings.prediction import PressedPoint, admitted, guarded, node_at
from wam_analysis.findings.text import SCHEMA, json_text, text
from wam_analysis.findings.transmission import CABLE, TransmissionSignals, _unrecorded
from wam_analysis.foreign.topic_map import TopicMap
from wam_analysis.recorded import prediction_parameters
from wam_bag.bag import Bag, JointColumns, TableColumns, WrenchColumns
from wam_cli.main import main
from wam_control.force.force_loop import ForceLoop
from wam_description.configuration import Configuration
from wam_description.parameters import ParameterError
from wam_description.rigid_body import RigidBody
from wam_ros.testing import RunningArm
from wam_sim.recorded_parameters import recorded_parameters

PRESS = 22.0  # N
CYCLING = [
    {"name": "release", "seconds": 0.3, "request": "enable"},
    {"name": "press", "seconds": 9.0, "force": {"frame": "link", "newtons": [0.0, -PRESS, 0.0]}},
    {"name": "brake", "seconds": 0.2, "request": "disable"},
]
STICTION = {"joints.static_friction": [4.0], "joints.dynamic_friction": [1.0]}
LOADS = ("sim/joint_states", "joint_sensors")  # topics that have the load of the motors
RIPPLE = 0.012  # N m at motor1, 24 cycles a turn
MOVING = [
    {"name": "release", "seconds": 0.1, "request": "enable"},
    {"name": "out", "seconds": 1.4, "posture": [0.5, -1.3, 0.1, 0.9]},
    {
        "name": "back and be pushed",
        "seconds": 1.4,
        "posture": [0.0, -0.6, -0.1, 0.4],
        "set": {"force_loop": {"force_gain": [2e-3]}},
        "push": {"cover": "outer_link", "contact_position": 0.3, "newtons": [0.0, 9.0, 2.0], "begin": 0.3, "end": 0.9},
    },
    {"name": "brake", "seconds": 0.1, "request": "disable", "set": {"force_loop": {"force_gain": [1e-3]}}},
]


class Recorded(NamedTuple):
    """A bag with the configuration that it was recorded with."""

    path: Path
    configuration: Configuration
    bag: Bag
    analysis: Analysis

    def finding(self, name: str) -> Finding:
        (found,) = [one for section in self.analysis.sections for one in section.findings if one.name == name]
        return found


def recorded(folder: Path, domain_id: int, steps: list[Any], **start: Any) -> Recorded:
    arm = RunningArm(domain_id, folder)
    bag = arm.play(steps, **start)
    return Recorded(bag.path, arm.configuration, bag, analyse_bag(bag, lambda doing: None))


@pytest.fixture(scope="module")
def cycling(tmp_path_factory: pytest.TempPathFactory, domain_of_module: int) -> Recorded:
    """The testbed with much stiction: it cycles about the force."""
    values = {"timing": {"outer_divisor": 10}, "force_loop": {"force_gain": [8e-3]}, "arm": STICTION}
    return recorded(tmp_path_factory.mktemp("cycling"), domain_of_module, CYCLING, configuration="testbed", **values)


@pytest.fixture(scope="module")
def moving(tmp_path_factory: pytest.TempPathFactory, domain_of_module: int) -> Recorded:
    """The arm on its way out and back, pushed, with noise on its sensors and a ripple in a motor."""
    driver = {
        "effects.ripples.amplitude": [RIPPLE, 0.0, 0.0, 0.0],
        "amplifier.torque_ripple": [0.0, 0.01, 0.0, 0.0],
        "sensors.encoder_noise": [2e-6] * 4,
        "sensors.strain_noise": [0.02] * 4,
    }
    return recorded(tmp_path_factory.mktemp("moving"), domain_of_module, MOVING, driver=driver)


def section_of(recorded: Recorded, key: str) -> Section:
    (found,) = [section for section in recorded.analysis.sections if section.key == key]
    return found


# what was planted


@pytest.mark.slow
def test_a_limit_cycle_of_the_testbed_is_found_with_its_size_and_its_period(cycling: Recorded) -> None:
    size, period = (
        cycling.finding("press: limit cycle, peak to peak"),
        cycling.finding("press: period of the limit cycle"),
    )
    truth = cycling.bag.topics["/wam/sim/contact/wrench"]
    assert isinstance(truth, WrenchColumns)
    rows = (truth.stamp_ns > 3_200_000_000) & (truth.stamp_ns < 9_200_000_000)
    force, at = truth.force[rows, 1], truth.stamp_ns[rows] / 1e9
    high = force > (force.min() + force.max()) / 2.0
    ups = at[1:][high[1:] & ~high[:-1]]
    assert len(ups) >= 3
    assert size.measured == pytest.approx(np.median(force[high]) - np.median(force[~high]), rel=0.05)
    assert period.measured == pytest.approx(float(np.mean(np.diff(ups))), rel=0.02)
    assert cycling.finding("press: confidence of the limit cycle").measured > 0.8


def test_its_prediction_from_the_recorded_parameters_stands_beside_it(cycling: Recorded) -> None:
    """(5.8) by hand: Omega dF k_c/(k_tr + k_c) over the lever, for cables and servo in series."""
    found = cycling.finding("press: limit cycle, peak to peak")
    lever, contact, cable = 0.9144, 1751.26835 * 0.9144**2, 14.0**2 / (0.920992366 / (2 * 42258.1053 * 0.009525**2))
    servo = 14.0**2 * 2.0
    inertia = 1.62155 * 0.4572**2 + 0.112985
    damping = 3.74 + 14.0**2 * 1.83e-3
    stiffness = 1.0 / (1.0 / cable + 1.0 / servo)
    zeta = damping / (2.0 * math.sqrt(inertia * (stiffness + contact)))
    omega = 1.0 + math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2))
    assert found.predicted == pytest.approx(omega * 3.0 * contact / (stiffness + contact) / lever, rel=0.01)
    assert found.measured == pytest.approx(found.predicted, rel=0.05)  # the motor's own friction is not in it


@pytest.mark.slow
def test_the_friction_of_motors_and_joints_is_identified_in_spite_of_noise(moving: Recorded) -> None:
    arm, tension = moving.configuration.shared.arm, 2.0 * 253.549 * 7.5e-6
    for i, name in enumerate(arm.motors.names):  # what tension and ripple leave, and tension
        left = 1.0 - (tension + (RIPPLE if i == 0 else 0.0)) / arm.motors.static_friction[i]
        whole, found = arm.motors.dynamic_friction[i], moving.finding(f"{name}: dynamic friction")
        assert found.measured == pytest.approx(left * whole + tension, abs=0.03 * whole)  # the ripple averages out
        assert found.predicted == pytest.approx(left * whole + tension, rel=1e-6)
    for name, i in (("joint1", 0), ("joint2", 1), ("joint4", 3)):
        found = moving.finding(f"{name}: dynamic friction")
        assert found.measured == pytest.approx(arm.joints.dynamic_friction[i], rel=0.02)
        assert found.predicted == arm.joints.dynamic_friction[i]
    assert moving.finding("motor4: viscous friction").measured == pytest.approx(1e-4, rel=0.1)


def test_what_was_changed_while_the_arm_ran_is_named(moving: Recorded) -> None:
    text = " ".join(section_of(moving, "happened").sentences)
    gain = moving.configuration.sections["force_loop"]["force_gain"]
    assert f"Changed while it ran: force_loop:force_gain from {gain} to [0.002] at 1.5" in text
    assert ", force_loop:force_gain from [0.002] to [0.001] at 2.9" in text
    assert text.count("Changed") == 1
    assert "Predictions are for the values at the start." in text


def test_motors_show_what_their_load_swings_by_between_its_samples() -> None:
    """Without it, a controller that acts as often as the load is recorded makes viscous friction of it."""
    time, nothing, swing = np.arange(0.0, 1.0, 1e-3), np.zeros((1000, 4)), np.tile([0.0, 1.0, 2.0, 2.0, 1.0], 200)
    velocity, sampled = np.sin(time)[:, np.newaxis] + nothing, swing == 0.0
    signals = TransmissionSignals(
        WAM, time, nothing, velocity, nothing, nothing, CABLE, sampled, sampled, nothing, nothing, nothing, ()
    )
    moved = signals._replace(torque=signals.rotors + swing[:, np.newaxis])
    assert _unrecorded(moved)[:, 0, 1] == pytest.approx(swing)
    turned = np.outer(np.sin(time), [0.0333667, 0.0, 0.0, 0.0])  # joint 1 as its motor, whose friction has its own
    apart = _unrecorded(moved._replace(load_from="", joint_velocity=turned))[:, :, 2]
    assert np.max(np.abs(apart), axis=0) == pytest.approx([0.0, 9.1e-5, 9.1e-5, 1.147e-4], rel=1e-3, abs=1e-9)


def test_a_push_is_in_no_friction_where_only_gravity_is_known(moving: Recorded) -> None:
    def seen(*left_out: str) -> Section:
        topics = {name: one for name, one in moving.bag.topics.items() if not name.endswith((*LOADS, *left_out))}
        sections = analyse_bag(moving.bag._replace(topics=topics, counts={}), lambda doing: None).sections
        (friction,) = (section for section in sections if section.key == "friction")
        return friction

    for unknown in ((), ("contact/wrench",)):
        friction = seen(*unknown)
        said = " ".join(friction.sentences)
        assert "because something pushed or touched the arm" in said
        assert ("touched the arm (contact/wrench)" in said) is bool(unknown)
        (found,) = (one for one in friction.findings if one.name == "motor4: dynamic friction")
        assert found.measured == pytest.approx(found.predicted, rel=0.1)
    said = " ".join(seen("contact/wrench", "sim/disturbance").sentences)
    assert "touched the arm (contact/wrench, sim/disturbance)" in said
    assert "gravity" not in " ".join(section_of(moving, "friction").sentences)


def test_the_efficiency_is_that_of_the_friction_that_is_configured(moving: Recorded) -> None:
    cables = {name: one for name, one in moving.bag.topics.items() if not name.endswith("joint_sensors")}
    for bag in (moving.bag, moving.bag._replace(topics=cables, counts={})):
        found = moving._replace(analysis=analyse_bag(bag, print)).finding("efficiency, motors to links")
        assert 40.0 < found.measured < 95.0
        assert found.measured == pytest.approx(found.predicted, abs=2.0)


def test_missed_periods_are_counted_from_the_stamps(moving: Recorded) -> None:
    states = moving.bag.topics["/wam/motor_states"]
    assert isinstance(states, JointColumns)
    keep = np.ones(len(states.stamp_ns), dtype=bool)
    keep[[500, 501, 900]] = False
    lost = np.outer(np.arange(len(keep)) > 1200, [0.0, 0.0, 1.5, 0.0])  # counts of an encoder
    states = states._replace(position=states.position - lost)
    fewer = JointColumns(*(c[keep] if isinstance(c, np.ndarray) else c for c in states))
    bag = moving.bag._replace(topics={**moving.bag.topics, "/wam/motor_states": fewer})
    sections = {section.key: section for section in analyse_bag(bag, lambda doing: None).sections}
    timing, found = sections["timing"], {one.name: one.measured for one in sections["timing"].findings}
    (jump,) = sections["stick_slip"].wrong
    assert jump == "motor3: the zero of the position moves once, by up to 1.5 rad; this is removed."
    assert not section_of(moving, "stick_slip").wrong
    assert found["motor_states: missed periods"] == 3.0
    assert "0.003 s" in timing.sentences[0]
    assert moving.finding("motor_states: missed periods").measured == 0.0


def test_jitter_of_a_real_clock_comes_from_the_times_of_reception(moving: Recorded) -> None:
    """The lockstep bag as a clock would have received it: 20 us of jitter."""
    topics = dict(moving.bag.topics)
    jitter = np.random.default_rng(3).normal(0.0, 20_000.0, len(topics["/wam/motor_states"].log_time_ns))
    columns = topics["/wam/motor_states"]
    assert isinstance(columns, JointColumns)
    received = columns.stamp_ns + 10**18 + jitter.astype(np.int64)
    topics["/wam/motor_states"] = columns._replace(log_time_ns=received)
    metadata = {**moving.bag.metadata, "recording": {**moving.bag.metadata["recording"], "mode": "realtime"}}
    found = analyse_bag(moving.bag._replace(topics=topics, metadata=metadata), lambda doing: None)
    (timing,) = [section for section in found.sections if section.key == "timing"]
    numbers = {finding.name: finding.measured for finding in timing.findings}
    assert numbers["motor_states: reception jitter"] == pytest.approx(0.02 * math.sqrt(2.0), rel=0.1)
    assert "motor_states: reception jitter" not in {f.name for s in moving.analysis.sections for f in s.findings}


# forces


def pressed(touch: float, impact: float, before: float = 1.0, known: bool = True, held: float = 5.0) -> Section:
    """5 N are commanded from 1 s on, `held` in contact from `touch` s on; they swing to `impact` N for 0.04 s at first.

    Until 1 s the contact has `before` N, which are measured where they are `known`.
    """
    stamps = np.arange(0, 4_000_000_000, 5_000_000)
    time = stamps / 1e9
    commanded = np.where(time >= 1.0, -5.0, 0.0)
    since = time - max(touch, 1.0)
    swing = (impact - held) * np.sin(np.pi * np.clip(since / 0.04, 0.0, 1.0))
    pressing = held * np.clip(since / 0.01, 0.2, 1.0) + swing
    force = -np.where(since >= 0.0, pressing, np.where(time >= touch, before, 0.0))
    measured = np.where((since >= 0.0) | known, force, 0.0)

    def wrench(force_y: Any) -> WrenchColumns:
        forces = np.column_stack([0.0 * time, force_y, 0.0 * time])
        return WrenchColumns(stamps, stamps, ("outer_link",) * len(time), forces, np.zeros_like(forces))

    columns = {"force_command": commanded, "force_measured": measured, "sim/contact/wrench": -force}
    topics: dict[str, Any] = {f"/wam/{name}": wrench(force_y) for name, force_y in columns.items()}
    analysis = analyse_bag(Bag(Path("made"), topics, {}, {}, {}), lambda doing: None)
    return next(section for section in analysis.sections if section.key == "force")


@pytest.mark.parametrize(
    ("touch", "words"), [(1.3, "touched 0.3 s after it began"), (0.95, "touched 0.05 s before it began")]
)
def test_the_impact_of_a_touch_down_is_no_overshoot_of_the_control(touch: float, words: str) -> None:
    section = pressed(touch, 11.0)
    found = {finding.name.partition(": ")[2]: finding for finding in section.findings}
    (said,) = [sentence for sentence in section.sentences if "commanded on" in sentence]
    assert words in said
    assert found["largest force"].measured == pytest.approx(11.0)
    for name in ("overshoot", "rise time 10-90 %"):
        assert math.isnan(found[name].measured)
    assert found["settling time to 5 %"].measured == pytest.approx(0.04, abs=0.006)


def test_a_press_that_touches_nothing_holds_no_force_and_has_no_rise_time() -> None:
    found = {finding.name: finding.measured for finding in pressed(1.0, -0.3, held=-0.3).findings}
    assert not [name for name in found if "rise" in name or "settling" in name]
    assert found["largest held force"] == 0.0


@pytest.mark.slow
def test_the_dynamic_range_is_of_what_was_held(cycling: Recorded) -> None:
    largest, error = cycling.finding("largest held force"), cycling.finding("largest error, bias plus ripple")
    truth = cycling.bag.topics["/wam/sim/contact/wrench"]
    assert isinstance(truth, WrenchColumns)
    rows = (truth.stamp_ns > 5_700_000_000) & (truth.stamp_ns < 9_300_000_000)  # the last 40 %
    assert largest.measured == pytest.approx(float(np.mean(truth.force[rows, 1])), rel=0.01)
    assert cycling.finding("dynamic range").measured == pytest.approx(largest.measured / error.measured)


# theory on the arm


@pytest.mark.slow
def test_the_node_of_a_press_has_the_stiffness_and_friction_of_statics(moving: Recorded) -> None:
    """A force along d stretches the cables by J^T d; what it must overcome follows from virtual work."""
    arm = moving.configuration.shared.arm
    q, direction, position = [0.2, -1.1, 0.0, 0.7], np.array([0.0, -1.0, 0.0]), 0.25
    parameters = prediction_parameters(recorded_parameters(moving.bag, "/wam"))
    body = RigidBody(arm)
    axis = body.cover_pose(q, "outer_link").rotation @ direction
    node = node_at(parameters, PressedPoint(body, q, "outer_link", position, axis))
    assert node is not None
    step = 1e-6
    here = body.point(q, "outer_link", (position, 0.0, 0.0))
    there = [body.point(np.array(q) + step * unit, "outer_link", (position, 0.0, 0.0)) for unit in np.eye(4)]
    move = np.array([(point - here) @ axis / step for point in there])
    matrix = np.reshape(arm.joint_from_motor, (4, 4))
    stretch = (matrix.T @ move) / np.array([circuit.stiffness for circuit in arm.circuits])  # rad per newton
    given = move @ (matrix @ stretch)  # m per newton
    assert 1.0 / node.transmission_stiffness == pytest.approx(given, rel=1e-4)
    assert node.contact_stiffness == 4000.0
    assert float(move @ node.joint_per_metre) == pytest.approx(1.0, rel=1e-4)
    lost = np.abs(node.joint_per_metre) @ np.array(arm.joints.dynamic_friction)
    assert node.dynamic_friction == pytest.approx(float(lost), rel=1e-6)


@pytest.mark.slow
def test_the_verdict_on_a_press_is_that_of_the_guard(moving: Recorded) -> None:
    recorded_set = prediction_parameters(recorded_parameters(moving.bag, "/wam"))
    assert recorded_set.force_loop is not None
    assert recorded_set.arm is not None
    assert recorded_set.timing is not None
    assert recorded_set.servo is not None
    q, position, direction = [0.0, -1.8, 0.0, 1.45], 0.28, np.array([0.0, -1.0, 0.0])
    body = RigidBody(recorded_set.arm)
    press = PressedPoint(body, q, "outer_link", position, body.cover_pose(q, "outer_link").rotation @ direction)
    for gain, words in ((0.015, "domain I, linearly stable "), (2.0, "NOT linearly stable")):
        own = replace(
            recorded_set.force_loop, force_gain=(gain,), contact_cover="outer_link", contact_position=position
        )
        found = guarded(recorded_set._replace(force_loop=own), press, math.nan)
        assert found is not None
        assert words in found.sentence
        loop = replace(own, guard=replace(own.guard, mode="refuse"))  # the force loop itself takes it or does not
        if gain < 1.0:
            taken = ForceLoop(recorded_set.arm, recorded_set.servo, loop, recorded_set.timing).supervision.assessment
            assert taken is not None
            assert found.assessment.scale >= taken.scale  # of one axis; the loop takes the worst of two
        else:
            with pytest.raises(ParameterError, match=r"times the largest linearly stable"):
                ForceLoop(recorded_set.arm, recorded_set.servo, loop, recorded_set.timing)


@pytest.mark.slow
def test_predictions_are_for_the_gains_that_the_guard_admitted(moving: Recorded) -> None:
    given = prediction_parameters(recorded_parameters(moving.bag, "/wam"))
    arm, servo, timing, own = given.arm, given.servo, given.timing, given.force_loop
    assert arm is not None and servo is not None and timing is not None and own is not None  # noqa: PT018 - for mypy
    high = replace(own, force_gain=(2.0,))
    loop = ForceLoop(arm, servo, high, timing).supervision
    assert loop.lowered.startswith("force_gain [0.")
    assert admitted(given._replace(force_loop=high)) == (given._replace(force_loop=loop.parameters), loop.lowered)
    assert admitted(given) == (given, "")


# bags that lack things, and other people's


def topics_of(bag: Bag) -> list[str]:
    return sorted(name for name, columns in bag.topics.items() if len(columns.log_time_ns))


@pytest.mark.slow
def test_every_topic_may_be_missing(cycling: Recorded) -> None:
    for name in topics_of(cycling.bag):
        bag = cycling.bag._replace(topics={k: v for k, v in cycling.bag.topics.items() if k != name}, counts={})
        assert text(analyse_bag(bag, lambda doing: None))


def test_any_one_topic_alone_is_enough_to_say_something(moving: Recorded) -> None:
    for name in topics_of(moving.bag):
        bag = Bag(moving.path, {name: moving.bag.topics[name]}, {}, {}, {})
        found = analyse_bag(bag, lambda doing: None)
        assert found.sections[0].sentences
        assert json.loads(json_text(found))["schema"] == SCHEMA


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_clock_that_was_set_back_does_not_spoil_the_friction(moving: Recorded) -> None:
    def twice(columns: Any) -> Any:
        again = columns.stamp_ns > 2_500_000_000  # by more than 1 s, it would be another run
        return type(columns)(*(np.concatenate([c, c[again]]) if isinstance(c, np.ndarray) else c for c in columns))

    topics = {
        name: twice(columns) if hasattr(columns, "stamp_ns") and not isinstance(columns, TableColumns) else columns
        for name, columns in moving.bag.topics.items()
    }
    found = analyse_bag(moving.bag._replace(topics=topics), lambda doing: None)
    numbers = {finding.name: finding.measured for section in found.sections for finding in section.findings}
    assert numbers["motor_states: stamps that do not increase"] == 1.0
    assert numbers["motor4: dynamic friction"] == moving.finding("motor4: dynamic friction").measured


@pytest.fixture(scope="module")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Another robot's bag: only joint states, written by rosbags."""
    path = tmp_path_factory.mktemp("foreign") / "bag"
    kind = "sensor_msgs/msg/JointState"
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/robot/joint_states", kind, typestore=STORE)
        for i in range(400):
            stamp = 1_700_000_000_000_000_000 + i * 10_000_000
            angles = [math.sin(0.02 * i), 0.1]
            writer.write(connection, stamp, joint_state(stamp, ["elbow", "wrist"], angles, [0.0, 0.0], []))
    return path


# the ways out


@pytest.mark.slow
def test_the_command_writes_text_json_and_page(
    moving: Recorded, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["analyse", str(moving.path), "--json", "-", "--quiet"])
    out, err = capsys.readouterr()
    assert (ended.value.code, err) == (0, "")
    found = json.loads(out)
    assert [section["key"] for section in found["sections"]] == [s.key for s in moving.analysis.sections]
    with pytest.raises(SystemExit) as ended:
        main(["analyse", str(moving.path), "--json", str(tmp_path / "a.json")])
    out, err = capsys.readouterr()
    assert ended.value.code == 0
    assert json.loads((tmp_path / "a.json").read_text()) == found
    assert "What happened" in out
    assert max(map(len, out.splitlines())) <= 100
    assert "reading" in err
    (tmp_path / "t.csv").write_text("u,q1\n0.0,1.0\n")
    for name, said, *more in (
        ("nothing", "does not exist"), ("no.csv", "No such file"), ("t.csv", "has no column 'time'"),
        ("t.csv", "'x' is no unit of position; give", "--unit", "position=x"),
    ):  # fmt: skip
        with pytest.raises(SystemExit) as ended:
            main(["analyse", str(tmp_path / name), *more])
        err = capsys.readouterr().err
        assert (ended.value.code, said in err, "another robot" in err) == (2, True, False)


@pytest.fixture(scope="module")
def written(moving: Recorded, foreign: Path) -> dict[str, str]:
    """Pages of a bag with everything and of one with next to nothing."""
    return {"moving": page(moving.analysis), "foreign": page(analyse(foreign, lambda doing: None))}


@pytest.mark.slow
def test_the_page_is_whole_in_itself(written: dict[str, str], moving: Recorded) -> None:
    for found in written.values():
        sources = [part.split('"')[0] for key in ('src="', 'srcset="', 'href="') for part in found.split(key)[1:]]
        assert all(source.startswith(("data:image/", "#")) for source in sources)
        assert "@import" not in found
        assert "default-src 'none'" in found
        allowed = re.findall(r"'sha256-([^']+)'", found.partition("script-src ")[2].partition('"')[0])
        scripts = re.findall(r"<script>(.*?)</script>", found, re.DOTALL)
        digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
        assert len(scripts) == 2
        assert digests == allowed  # nothing else runs, whatever a bag says
        assert "Permission is hereby granted" in scripts[0]
    assert written["moving"].count("<img") == 1  # the arm
    assert "encoder_noise" in written["moving"]  # the parameters
    assert moving.analysis.provenance["parameters, SHA-256"] in written["moving"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["moving", "foreign"])
@pytest.mark.parametrize("width", [1280, 390])
def test_the_page_reads_well_in_a_browser(name: str, width: int, written: dict[str, str], tmp_path: Path) -> None:
    seen = looked_at(written[name], width, tmp_path)
    assert seen["overflow"] == []
    assert seen["width"] == width
    assert seen["scroll"] == seen["room"] >= width - 20  # less a scroll bar
    assert seen["pictures"] == [True] * (name == "moving")
    assert seen["requests"] == []
    assert seen["height"] > 800
    assert seen["charts"] == written[name].count('<figure class="chart"')
    assert seen["charts"] > 0


# the samples


SAMPLES = Path(__file__).parents[2] / "bags" / "sample"
CYCLES = {"actuator-limit-cycle", "quantised-force", "stiction-limit-cycle"}
DIVERGES = {"testbed-5.6", "testbed-5.6-as-described", "testbed-own-servo"}
LARGEST = {"N": 2000.0, "N m": 1000.0, "%": 100.0, "J": 1000.0}  # that an arm of this size can have


@pytest.fixture(scope="module")
def samples() -> dict[str, Analysis]:
    """The analysis of every sample."""
    return {path.name: analyse(path, lambda doing: None) for path in sorted(SAMPLES.iterdir())}


def verdict_of(analysis: Analysis) -> str:
    assert analysis.sections[0].key == "verdict"
    return " ".join(analysis.sections[0].sentences)


@pytest.mark.slow
def test_the_samples_made_to_cycle_are_said_to_cycle_and_no_other_is(samples: dict[str, Analysis]) -> None:
    said = {name: verdict_of(found) for name, found in samples.items()}
    assert len(said) == len(list(SAMPLES.iterdir())) >= 12
    assert {name for name in said if "; limit cycle of" in said[name]} == CYCLES
    assert {name for name in said if "DIVERGES" in said[name]} == DIVERGES
    assert not any("too seldom" in line for line in said.values())
    assert "STOPPED: driver fault" in said["testbed-5.6"]


@pytest.mark.slow
def test_the_motor_cycle_of_the_sample_has_the_size_of_5_20(samples: dict[str, Analysis]) -> None:
    findings = [one for section in samples["actuator-limit-cycle"].sections for one in section.findings]
    (found,) = [one for one in findings if "cycle of the motors" in one.name]
    assert found.measured == pytest.approx(found.predicted, rel=0.02)


@pytest.mark.slow
def test_no_sample_has_a_number_that_cannot_be_or_that_was_not_measured(samples: dict[str, Analysis]) -> None:
    for name, analysis in samples.items():
        for section in analysis.sections:
            for one in section.findings:
                if math.isfinite(one.measured):
                    assert abs(one.measured) < LARGEST.get(one.unit, 1e5) * 1.0000001, (name, one)
                    assert one.measured >= 0.0 or one.quantity.startswith(("bias", "error", "friction")), (name, one)
        lacks_force = "/wam/force_measured" not in analysis.recording.bag.topics
        numbers = [one for section in analysis.sections for one in section.findings]
        assert not (lacks_force and any("limit cycle" in o.name and math.isfinite(o.measured) for o in numbers)), name
        for one in numbers:  # nothing right by definition is a prediction
            assert not (one.predicted in (0.0, 100.0) and one.unit in ("%", "cm", "N")), (name, one)


@pytest.mark.slow
def test_a_number_far_from_its_prediction_is_flagged(samples: dict[str, Analysis]) -> None:
    """In wam-touch the cables creep while motor2 turns: that is alike for long, and no viscous friction."""
    assert "More than 3 standard errors" not in verdict_of(samples["wam-touch"])
    (friction,) = [section for section in samples["wam-touch"].sections if section.key == "friction"]
    (dry,) = [one for one in friction.findings if one.name == "motor3: dynamic friction"]
    known = f"{shown(dry.measured)} +- {shown(dry.error)}"  # one number, whether in a table or for a program
    assert known in " ".join(text(samples["wam-touch"]).split())
    (viscous,) = [one for one in friction.findings if one.name == "motor2: viscous friction"]
    assert (math.isnan(viscous.measured), "not identifiable: " in viscous.note) == (True, True)
    assert "a 1 +- 0.05 N, predicted 1.2" in deviations((Finding("a", "N", 1.0, 1.2, "", 0.05),))[0]
    assert Finding("a", "N", 1.0, 1.2, "", 0.05).deviates
    assert not Finding("a", "N", 1.0, 1.1, "", 0.05).deviates
    assert not Finding("a", "N", math.nan, 1.1, "", 0.05).deviates


@pytest.mark.slow
@pytest.mark.parametrize("name", ["testbed-5.6", "frequency-response"])
def test_no_efficiency_is_reported_where_what_is_stored_is_more_than_what_is_lost(
    name: str, samples: dict[str, Analysis]
) -> None:
    said = text(samples[name])
    assert "efficiency" in said
    assert "not measured" in said
    assert "efficiency, " not in said
    assert "came back" not in said


# other robots


@pytest.fixture(scope="module")
def planted() -> Analysis:
    """500 Hz of a joint that swings at 3.1 Hz under friction, of one at rest, and a force that cycles; with noise."""
    rng, stamps = np.random.default_rng(5), np.arange(0, 8_000_000_000, 2_000_000) + 10**18
    time = (stamps - stamps[0]) / 1e9
    omega = 2.0 * math.pi * 3.1
    position, speed = 0.3 * np.sin(omega * time), 0.3 * omega * np.cos(omega * time)
    torque = 0.8 * np.sign(speed) + 0.4 * speed - 0.12 * omega**2 * position
    positions = np.column_stack([0.2 + 0.0 * time, position]) + 1e-6 * rng.standard_normal((len(time), 2))
    speeds = np.column_stack([0.0 * time, speed]) + 1e-4 * rng.standard_normal((len(time), 2))
    efforts = np.column_stack([0.0 * time, torque]) + 1e-3 * rng.standard_normal((len(time), 2))
    joints = JointColumns(stamps, stamps, ("",) * len(time), ("wrist", "elbow"), positions, speeds, efforts)
    force = np.column_stack([0.0 * time, 1.2 * np.sin(omega * time), 10.0 + 0.0 * time])
    wrench = WrenchColumns(stamps, stamps, ("tool",) * len(time), force, np.zeros_like(force))
    bag = Bag(Path("other"), {"/r/joint_states": joints, "/r/wrench": wrench}, {}, {}, {})
    return analyse_bag(bag, lambda doing: None, given=TopicMap())


def test_every_joint_and_the_force_have_a_chart_of_their_own(planted: Analysis) -> None:
    drawn = list(charts(planted))
    assert [chart.title for chart in drawn[:3]] == [
        "elbow over time.", "wrist over time.", "/r/wrench over time.",
    ], "of the joints what moved most first"  # fmt: skip
    assert [chart.section for chart in drawn] == ["happened", "happened", "signals"]
    assert max(drawn[0].series[0].values) == pytest.approx(0.3, rel=0.01)
