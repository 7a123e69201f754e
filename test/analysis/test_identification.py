"""From motion to the controllers' model: planted values are found, and what is stated about them is true."""

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arms import CONFIGURATION, SHARED, WAM
from numpy.typing import NDArray
from rosbags.rosbag2 import StoragePlugin, Writer
from sample_messages import STORE, joint_state, wrench

from wam_analysis.identification.contradictions import Mistake, contradictions
from wam_analysis.identification.fit import Identification, identify
from wam_analysis.identification.motion import motion, recorded_motion
from wam_analysis.identification.overlay import estimator_values, model_values, write_overlay
from wam_analysis.identification.regressor import Regressor
from wam_analysis.identification.report import report
from wam_analysis.identification.unknowns import DIRECTIONS as WAYS
from wam_bag.bag import BagError, read
from wam_cli.main import main
from wam_control.contact.contact_estimator import ContactEstimator, ContactEstimatorParameters
from wam_control.task.scenario import load
from wam_control.velocity.gravity_node import GravityNode
from wam_description.configuration import Configuration
from wam_description.mismatch import ModelMismatch, true_arm
from wam_description.parameters import ParameterError, build
from wam_description.rigid_body import RigidBody
from wam_description.signals import State
from wam_description.wiring import Inputs
from wam_sim.recorded_run import recorded_run
from wam_studies.identification.study import IdentificationTrial, run_trial

ROOT = Path(__file__).parents[2]
Array = NDArray[np.float64]


class Planted:
    """Torques of a motion by the inverse dynamics of a true arm and friction of its own, not by the regressor."""

    # that of own joints is counted at their motors, but the cables transmit it
    coulomb = np.array([[0.050, 0.035, 0.030, 0.040], [0.056, 0.030, 0.036, 0.048]])
    load = np.array([0.05, 0.02, 0.04, 0.03])
    viscous = np.array([2e-4, 3e-4, 1e-4, 2e-4])
    drop, stribeck = 0.012, np.array([8.0, 2.0, 3.0, 10.0])  # F_s - F_d, N m; rad/s, far from the configured 0.5
    joint_coulomb, is_own = np.array([0.4, 0.5, 0.4, 0.2]), np.array([1.0, 0.0, 0.0, 1.0])
    arm = true_arm(WAM, ModelMismatch((1.0, 1.02, 0.97, 1.05), (1.0,) * 4, (1.0,) * 4, (1.0,) * 4, 0.1, (1.0,) * 4))

    def __init__(
        self,
        seconds: float,
        seed: int,
        noise: float = 0.0,
        speed: float = 1.0,
        joint_load: Array | None = None,
        moving: tuple[int, ...] = (0, 1, 2, 3),
        payload: float = 0.0,
    ) -> None:
        """`joint_load`: friction of each joint per torque, (2, n), in positive and in negative motion."""
        self.joint_load = np.zeros((2, 4)) if joint_load is None else joint_load
        self.arm = replace(self.arm, payload=self.arm.payload + payload)
        random = np.random.Generator(np.random.PCG64(seed))
        self.time = np.arange(0.001, seconds, 0.001)
        rates = speed * random.uniform(0.5, 3.0, (4, 3))
        sizes, phases = random.uniform(0.1, 0.4, (4, 3)), random.uniform(0.0, 6.3, (4, 3))
        sizes *= np.isin(range(4), moving)[:, None]
        turns = self.time[:, None, None] * rates + phases
        q = np.array(WAM.joints.start) + (sizes * np.sin(turns)).sum(2)
        qd = (sizes * rates * np.cos(turns)).sum(2)
        qdd = -(sizes * rates**2 * np.sin(turns)).sum(2)
        to_motors = WAM.transmission.motor_from_joint.T
        self.theta = q @ to_motors
        self.torque = self._torques(q, qd, qdd) + self._coloured(random, noise)

    def _torques(self, q: Array, qd: Array, qdd: Array) -> Array:
        arm, matrix = self.arm, WAM.transmission.joint_from_motor
        body = RigidBody(arm)
        joint = np.array([body.inverse_dynamics(*each) for each in zip(q, qd, qdd, strict=True)])
        joint += qdd * arm.joints.armature + self.joint_coulomb * np.sign(qd)
        joint += np.where(qd > 0.0, *self.joint_load) * np.abs(joint) * np.sign(qd)
        v, vdot = (values @ np.linalg.inv(matrix).T for values in (qd, qdd))
        transmitted = joint @ matrix
        level = np.where(v > 0.0, *self.coulomb[:, None]) - (self.is_own * self.joint_coulomb) @ np.abs(matrix)
        level += self.load * np.abs(transmitted) + self.drop * np.exp(-((v / self.stribeck) ** 2))
        torque: Array = transmitted + arm.motors.inertia * vdot + level * np.sign(v) + self.viscous * v
        return torque

    def _coloured(self, random: np.random.Generator, sd: float) -> Array:
        """Noise with a correlation of 0.2 s."""
        keep = math.exp(-0.001 / 0.2)
        found, state = np.zeros((len(self.time), 4)), np.zeros(4)
        for row, draw in zip(found, random.standard_normal((len(self.time), 4)), strict=True):
            state = keep * state + sd * math.sqrt(1.0 - keep**2) * draw
            row[:] = state
        return found

    def identify(self) -> Identification:
        return identify(SHARED, motion(self.time, self.theta, self.torque))

    def coulomb_errors(self, found: Identification) -> tuple[Array, Array]:
        """Error and standard error of Coulomb friction, N m, both directions."""
        at = found.unknowns.places("motors.coulomb_positive") + found.unknowns.places("motors.coulomb_negative")
        return found.values[at] - self.coulomb.ravel(), found.sd[at]


@pytest.fixture(scope="module")
def clean() -> tuple[Planted, Identification]:
    planted = Planted(40.0, 3)
    return planted, planted.identify()


@pytest.mark.slow
def test_planted_friction_is_found_in_each_direction(clean: tuple[Planted, Identification]) -> None:
    planted, found = clean
    error, _ = planted.coulomb_errors(found)
    assert np.abs(error / planted.coulomb.ravel()).max() < 0.01
    before, _ = planted.coulomb_errors(found._replace(values=found.unknowns.present))
    assert np.abs(before / planted.coulomb.ravel()).max() > 0.15, "it was not the prior"
    assert found.values[found.unknowns.places("motors.load_positive")] == pytest.approx(planted.load, abs=0.01)
    assert found.values[found.unknowns.places("joints.coulomb")] == pytest.approx([0.5, 0.4], rel=0.02)
    assert found.values[found.unknowns.places("motors.stribeck_velocity")] == pytest.approx(planted.stribeck, rel=0.1)


@pytest.mark.slow
def test_planted_masses_and_payload_give_the_gravity_torque(clean: tuple[Planted, Identification]) -> None:
    planted, found = clean
    shared = overlaid(found).shared
    truth, model, nominal = (RigidBody(arm) for arm in (planted.arm, shared.model_arm, WAM))
    poses = np.random.Generator(np.random.PCG64(5)).uniform(-1.0, 1.0, (20, 4))
    left = [model.gravity_torque(q) - truth.gravity_torque(q) for q in poses]
    before = [nominal.gravity_torque(q) - truth.gravity_torque(q) for q in poses]
    assert np.abs(left).max() < 0.02
    assert np.abs(before).max() > 0.4


@pytest.mark.slow
def test_stated_errors_are_the_errors_from_both_sides() -> None:
    scores = []
    for seed in range(6):
        planted = Planted(25.0, seed, noise=0.002)
        error, sd = planted.coulomb_errors(planted.identify())
        scores += (error / sd).tolist()
    rms = math.sqrt(np.mean(np.square(scores)))
    assert 0.5 < rms < 2.0, "neither too small nor too large"


@pytest.mark.slow
def test_what_the_motion_does_not_show_stays_as_it_was_and_is_reported_so(
    clean: tuple[Planted, Identification],
) -> None:
    _, found = clean
    at = found.unknowns.names.index("links.mass.link1")  # the first joint is vertical
    assert found.values[at] == pytest.approx(found.unknowns.present[at])
    assert not found.is_identified[at]
    assert not found.is_combined[at]
    text = report(SHARED, found, "bag")
    assert next(line for line in text.splitlines() if line.startswith("links.mass.link1 ")).endswith(" no")
    line = next(line for line in text.splitlines() if line.startswith("motors.coulomb_positive.motor2 "))
    assert line.endswith("yes")


def overlaid(found: Identification) -> Configuration:
    return CONFIGURATION.with_values(model_values(SHARED, found, "bag"))


@pytest.mark.slow
def test_the_overlay_is_a_configuration_that_the_nodes_use(
    clean: tuple[Planted, Identification], tmp_path: Path
) -> None:
    planted, found = clean
    file = tmp_path / "identified.yaml"
    values = model_values(SHARED, found, "bag") | estimator_values(CONFIGURATION)
    write_overlay(file, "wam", values, "wam identify bag")
    configuration = Configuration.load(file)
    shared = configuration.shared
    estimator = configuration.node("contact_estimator", ContactEstimatorParameters)
    assert estimator.observer.mass_scale == (1.0,) * 4
    ContactEstimator(shared.model_arm, shared.timing, estimator)
    assert shared.arm == WAM, "the plant keeps its own parameters"
    assert shared.model.source == "bag"
    assert shared.model.motors.coulomb_negative == pytest.approx(planted.coulomb[1], rel=0.01)
    assert shared.model.joints.coulomb[0] == 0.0, "it is part of its motor's"
    q = [0.3, -0.7, 0.2, 0.9]
    inputs = Inputs.of(0, 0.005, {"joint_states": (0, State(q, [], []))})
    (effort,) = GravityNode(shared, build(GravityNode.parameters, {})).step(inputs).values()
    assert effort.effort == pytest.approx(RigidBody(planted.arm).gravity_torque(q), abs=0.02)


@pytest.mark.slow
def test_the_covariance_in_the_overlay_is_that_of_the_torques_in_the_motion(
    clean: tuple[Planted, Identification],
) -> None:
    """Errors of all parameters are counted as errors that the estimator tracks; nearly nothing is left."""
    planted, found = clean
    model, tracked = overlaid(found).shared.model, found.tracked
    every = np.reshape(model.covariance.values, (len(model.covariance.parameters),) * 2)
    assert np.linalg.eigvalsh(every / np.sqrt(np.outer(every.diagonal(), every.diagonal()))).min() > 0.0
    assert every == pytest.approx(tracked.covariance, rel=1e-4)
    samples = motion(planted.time, planted.theta, planted.torque)
    regressor = Regressor(SHARED, found.unknowns, samples)
    torques, used = regressor.equations(found.values).columns, regressor.equations(found.values).is_used
    own = [found.unknowns.names.index(name) for name in tracked.names if name in found.unknowns.names]
    assert len(own) == len(tracked.names) - 7, "joint 1 carries no weight"
    shown = np.concatenate((torques[:, :, own], *regressor.joint_torques(found.values)), axis=2)
    shown = np.delete(shown, len(own), axis=2)  # the weight at joint 1, which is none
    for motor in range(4):
        mine, all_of_it = shown[used[:, motor], motor], torques[used[:, motor], motor]
        stated = (mine @ tracked.covariance * mine).sum(1).mean()
        whole = found.uncertainty.variances(all_of_it).mean()
        assert stated == pytest.approx(whole, rel=0.3)
        assert tracked.left[motor] < 0.5 * math.sqrt(whole)
    own_alone = tracked.covariance[np.ix_(range(len(own)), range(len(own)))]
    parameters = found.covariance[np.ix_(own, own)]
    assert np.abs(own_alone.diagonal() / parameters.diagonal() - 1.0).max() > 0.2, "not those of the parameters alone"
    assert model.is_identified
    assert not SHARED.model.is_identified


def test_without_an_overlay_the_controllers_model_is_the_arm_bit_for_bit() -> None:
    for name in ("wam", "testbed"):
        shared = Configuration.load(ROOT / "config" / f"{name}.yaml").shared
        assert shared.model_arm == shared.arm
    heavy = CONFIGURATION.with_values({"arm.links.mass": [8.0, 3.0, 2.0, 1.0]}).shared
    assert heavy.model.links.mass == (8.0, 3.0, 2.0, 1.0)
    own = CONFIGURATION.with_values({"model.links.mass": [8.0, 3.0, 2.0, 1.0]}).shared
    assert (own.arm.links.mass, own.model_arm.links.mass) == (WAM.links.mass, (8.0, 3.0, 2.0, 1.0))


@pytest.mark.parametrize(("values", "text"), [
    ({"model.motors.coulomb_positive": [0.1] * 4}, "static_positive 0.05101 N m is below dynamic friction, 0.1"),
    ({"model.links.mass": [1.0] * 3}, r"'model.links.mass' has 3 values; it needs 4"),
    ({"model.covariance.values": [1.0, 2.0]}, "'model.covariance.values' has 2 values; it needs 1"),
    ({"model.covariance.values": [-1.0]}, "has a variance of -1"),
    ({"model.masses": [1.0]}, "no parameter 'model.masses'"),
])  # fmt: skip
def test_a_wrong_model_is_refused_by_name(values: dict[str, Any], text: str) -> None:
    with pytest.raises(ParameterError, match=text):
        CONFIGURATION.with_values(values).shared  # noqa: B018


def pressed(planted: Planted, force: tuple[float, float, float], share: float = 1.0) -> Array:
    """Torques of the motors while a force, N, acts on the outer link in the first part of each 2 s."""
    body, matrix = RigidBody(WAM), WAM.transmission.joint_from_motor
    joints = planted.theta @ matrix.T
    pushes = [body.point_jacobian(q, "outer_link", (0.3, 0.0, 0.0)).T @ np.array(force) for q in joints]
    acts = planted.time % 2.0 < 2.0 * share
    found: Array = planted.torque - np.array(pushes) @ matrix * acts[:, None]
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("what", "mistake", "about"), [
    ("amperes", Mistake.SCALED, ()),
    ("other sign", Mistake.SCALED, ()),
    ("sign of one", Mistake.SCALED_MOTOR, ("motor2",)),
    ("constant of one", Mistake.SCALED_MOTOR, ("motor3",)),
    ("nothing of one", Mistake.SCALED_MOTOR, ("motor3",)),
    ("names of two", Mistake.SWAPPED, ("motor2", "motor3")),
    ("all of one", Mistake.TURNED, ("motor4",)),
    ("pressed all the time", Mistake.PAYLOAD, None),
    ("pressed half of the time", Mistake.UNEXPLAINED, None),
    ("lifted all the time", Mistake.PAYLOAD, ()),
    ("nothing", None, ()),
])  # fmt: skip
def test_a_recording_that_contradicts_the_configured_arm_is_refused_with_its_likely_cause(
    what: str, mistake: Mistake | None, about: tuple[str, ...] | None
) -> None:
    planted = Planted(30.0, 3, noise=0.001)
    order = [0, 2, 1, 3] if what == "names of two" else [0, 1, 2, 3]
    factors = {"sign of one": [1, -1, 1, 1], "constant of one": [1, 1, 0.25, 1], "nothing of one": [1, 1, 0, 1]}
    factors |= {"amperes": [4] * 4, "other sign": [-1] * 4}
    torque = {
        "pressed all the time": lambda: pressed(planted, (0.0, 5.0, -6.2)),
        "pressed half of the time": lambda: pressed(planted, (8.0, 5.0, 10.0), 0.5),
        "lifted all the time": lambda: pressed(planted, (0.0, 0.0, -10.0)),
    }.get(what, lambda: planted.torque * factors.get(what, 1.0))()
    sides = np.array([1.0, 1.0, 1.0, -1.0 if what == "all of one" else 1.0])
    recorded = motion(planted.time, sides * planted.theta[:, order], sides * torque[:, order])
    found = contradictions(SHARED, recorded, identify(SHARED, recorded))
    assert [one.mistake for one in found[:1]] == ([] if mistake is None else [mistake])
    assert not re.search(r"\d{4}%", " ".join(map(str, found)))
    assert about is None or [one.about for one in found[:1]] == ([] if mistake is None else [about])


@pytest.mark.slow
def test_a_payload_is_none_of_the_links_where_it_is_declared_and_refused_where_not(clean: Any) -> None:
    loaded = Planted(40.0, 3, payload=0.4)
    recorded = motion(loaded.time, loaded.theta, loaded.torque)
    declared = CONFIGURATION.with_values({"arm.payload": 0.4})
    found = identify(declared.shared, recorded)
    assert contradictions(declared.shared, recorded, found) == []
    moments = found.unknowns.places("links.moment_x")
    assert found.values[moments] == pytest.approx(clean[1].values[moments], abs=0.002)
    cause, *_ = contradictions(SHARED, recorded, identify(SHARED, recorded))
    assert (cause.mistake, cause.size) == (Mistake.PAYLOAD, pytest.approx(0.5, abs=0.05))  # 0.1 kg are hidden


@pytest.mark.slow
def test_what_a_motion_of_one_joint_does_not_show_stays_as_configured() -> None:
    """The weight at joint 2 was 19 N m in place of 12, with a standard error of nothing; so is a turn of a second."""
    planted = Planted(30.0, 3, noise=0.001, moving=(0,))
    planted.theta[5000:, 3] += np.clip(planted.time[5000:] - 5.0, 0.0, 1.0)
    found = planted.identify()
    poses = np.random.Generator(np.random.PCG64(5)).uniform(-1.0, 1.0, (20, 4))
    model = RigidBody(overlaid(found).shared.model_arm)
    for q in poses:
        assert model.gravity_torque(q) == pytest.approx(RigidBody(WAM).gravity_torque(q), abs=0.02)
    assert set(found.tracked.names) == {
        f"motors.{what}_{way}.motor1" for what in ("coulomb", "load") for way in WAYS
    } | {"links.inertia.joint1"}
    assert np.linalg.eigvalsh(found.tracked.covariance).min() > 0.0


@pytest.mark.slow
def test_too_little_motion_is_refused_and_a_slow_one_is_warned_about() -> None:
    short = Planted(6.0, 1)
    with pytest.raises(ValueError, match=r"over 6 s; identification needs 10 s or more"):
        short.identify()
    with pytest.raises(ValueError, match="no joint turns freely for 2 s"):
        Planted(15.0, 1, speed=0.02).identify()
    slow = Planted(15.0, 1, speed=0.1)
    text = report(SHARED, slow.identify(), "bag")
    assert "warning: motor1 turns freely for" in text


def write_bag(bag: Path, planted: Planted, torques: Array, pushed_after: float = math.inf) -> None:
    """A bag of the motion with other torques, which states a push after a time, s."""
    names = list(WAM.motors.names)
    with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/wam/motor_states", "sensor_msgs/msg/JointState", typestore=STORE)
        push = writer.add_connection("/wam/sim/disturbance", "geometry_msgs/msg/WrenchStamped", typestore=STORE)
        for time, theta, torque in zip(planted.time, planted.theta.tolist(), torques.tolist(), strict=True):
            stamp = round(1e9 * time)
            writer.write(topic, stamp, joint_state(stamp, names, theta, [0.0] * 4, torque))
            if time > pushed_after:
                writer.write(push, stamp, wrench(stamp, "inner_link", 0.0, 3.0, 0.0, 0.0, 0.0, 0.0))


@pytest.mark.slow
def test_a_model_that_contradicts_the_configured_arm_is_written_by_force_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    planted, bag, model = Planted(25.0, 5), tmp_path / "bag", tmp_path / "model.yaml"
    write_bag(bag, planted, 1.6 * planted.torque)
    for more, code in ((["--force"], 0), ([], 1)):
        model.unlink(missing_ok=True)
        with pytest.raises(SystemExit) as ended:
            main(["identify", str(bag), "--write", str(model), *more])
        assert ended.value.code == code
        assert model.exists() is (code == 0)
    assert re.search(r"all torques are 1\.\d times those of the configuration: is the effort", capsys.readouterr().err)


@pytest.mark.slow
def test_a_recording_with_a_contact_gives_no_model_that_no_configuration_could_have(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Who pushes motor1 along its motion, by more than its friction, takes the friction below zero.

    What the bag states of pushes is a warning, also where the model is possible; a program sends them while it pushes.
    """
    planted = Planted(14.0, 5)
    pushed = planted.torque - [0.3, 0.0, 0.0, 0.0] * np.sign(np.gradient(planted.theta, axis=0))
    bag, model = tmp_path / "bag", tmp_path / "model.yaml"
    write_bag(bag, planted, pushed, 7.0)
    with pytest.raises(SystemExit) as ended:
        main(["identify", str(bag), "--write", str(model)])
    assert ended.value.code == 1
    assert not model.exists()
    printed = capsys.readouterr()
    impossible = r"'model\.motors\.coulomb_\w+' is -0\.\d+ N m; allowed: 0 to 100\. .*without contact"
    assert "contradicts the configuration, so no model is written: the torques of motor1 are" in printed.err
    assert "warning: the simulator pushed the arm in 50 % of the recording" in printed.out
    assert printed.out.startswith("NOT A POSSIBLE MODEL: "), "before the report"
    assert re.search(impossible, printed.out.splitlines()[0])


@pytest.mark.parametrize(("bag", "text"), [
    ("stiction-limit-cycle", r"motor_states are of motor1; the configuration has motor1, motor2, motor3, motor4"),
    ("wam-touch", r"identification needs 10 s or more|no motor_states"),
])  # fmt: skip
def test_a_wrong_bag_is_refused(bag: str, text: str) -> None:
    folder = ROOT / "bags" / "sample" / bag
    if not folder.exists():
        pytest.skip(f"no sample {bag}")
    with pytest.raises(BagError, match=text):
        recorded_motion(recorded_run(read(folder, ["motor_states", "status"], may_lack=True)), WAM)


@pytest.mark.slow
def test_the_exciting_scenario_is_one_that_plays_and_keeps_its_limits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "excite.yaml"
    with pytest.raises(SystemExit) as ended:
        main(["identify", "--excite", str(file), "--only-write", "--seconds", "10"])
    assert ended.value.code == 0
    assert f"--scenario {file}" in capsys.readouterr().out
    steps = load(file, CONFIGURATION.shared)
    assert sum(step.seconds for step in steps if step.posture) >= 10.0
    before = np.array(WAM.joints.start)
    for step in steps:
        if step.posture:
            assert np.abs(np.subtract(step.posture, before)).max() * 1.875 / step.seconds < 1.5
            before = np.array(step.posture)


@pytest.mark.slow
def test_friction_of_a_plant_of_every_kind_at_once_is_found_to_four_per_cent() -> None:
    result = run_trial(IdentificationTrial(CONFIGURATION, "all", 1, 20.0))
    assert result.failure == ""
    assert np.abs(result.level).max() < 0.04
    assert np.abs(result.before).max() > 0.1
    assert result.gravity < 0.5 * result.gravity_before


@pytest.mark.slow
def test_a_torque_offset_is_named_as_not_identifiable_with_its_value_if_friction_were_alike(
    clean: tuple[Planted, Identification],
) -> None:
    """An offset o in the torques of both directions is (F_c negative - F_c positive)/2 of what is identified."""
    planted, found = clean
    shifted = Planted(40.0, 3)
    offsets = np.array([0.004, -0.003, 0.0, 0.002])
    shifted.torque = shifted.torque - offsets  # what is reported lacks what the motor gives besides
    other = shifted.identify()
    before, after = found.offset_if_alike[0], other.offset_if_alike[0]
    assert after - before == pytest.approx(offsets, abs=2e-4)
    assert before == pytest.approx((planted.coulomb[1] - planted.coulomb[0]) / 2.0, abs=5e-4)
    assert (other.offset_if_alike[1] < 1e-3).all()
    lines = report(SHARED, other, "bag").splitlines()
    (line,) = (line for line in lines if line.startswith("motors.torque_offset.motor1 "))
    assert line.endswith("not from this recording")
    level = [sum(each.values[each.unknowns.places(f"motors.coulomb_{way}")]) for each in (found, other) for way in WAYS]
    assert level[0] + level[1] == pytest.approx(level[2] + level[3], rel=1e-2), "the nodes take the sum of both"


@pytest.mark.slow
def test_torque_constants_that_differ_between_motors_of_the_same_joints_are_found_and_friction_as_reported() -> None:
    planted, scale = Planted(40.0, 3), np.array([1.0, 1.02, 0.98, 1.0])
    planted.torque = planted.torque / scale
    found = planted.identify()
    at = found.unknowns.names.index("motors.torque_difference.motor3")
    assert -0.025 < found.values[at] < -0.005, "as far as load friction does not look the same"
    error, _ = planted.coulomb_errors(found)
    reported = np.tile(1.0 - 1.0 / scale, 2)  # friction in units of the assumed constants
    assert np.abs(error / planted.coulomb.ravel() + reported).max() < 0.015
    values = model_values(SHARED, found, "bag")
    assert not any("torque_difference" in name for name in (*values, *values["model.covariance.parameters"]))
