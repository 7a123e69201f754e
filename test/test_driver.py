"""The driver as a machine: what it lets through, when it stops, what it keeps."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from arms import CONFIGURATION, NOWHERE, WAM, changed
from contact_truth import joint_torques

from wam_description.arm import Shared
from wam_description.effects import no_effects
from wam_description.parameters import Field, ParameterError, fields
from wam_description.rigid_body import RigidBody
from wam_description.world import NO_SPRINGS, World
from wam_driver.driver import Driver, DriverParameters
from wam_driver.safety import Mode

SHARED = CONFIGURATION.shared
PARAMETERS = dataclasses.replace(
    CONFIGURATION.node("driver", DriverParameters), world=World(NOWHERE, NO_SPRINGS), effects=no_effects(WAM)
)
PERIOD = SHARED.timing.period
MOTOR_FROM_TORQUE = np.linalg.inv(np.array([joint_torques(e) for e in np.eye(4)]).T)
BODY = RigidBody(WAM)
START = np.array(WAM.joints.start)
SLOW = 0.05  # s; a stop must come within it
FAST_JOINTS = {"speed_limit": (1e6,) * 4}
NO_LIMITS = {"elbow_speed_limit": 1e6, "tip_speed_limit": 1e6}


def driver(joints: dict[str, tuple[float, ...]] | None = None, **parameters: float) -> Driver:
    shared = dataclasses.replace(SHARED, arm=changed(WAM, joints=joints))
    return Driver(shared, dataclasses.replace(PARAMETERS, **parameters))


def carrying(q: np.ndarray | list[float], extra: tuple[float, ...] = (0.0,) * 4) -> list[float]:
    """Currents that carry the links, with joint torques on top, A."""
    tau = MOTOR_FROM_TORQUE @ (BODY.gravity_torque(q) + extra)
    return (tau / WAM.motors.torque_constant).tolist()


def enabled(joints: dict[str, tuple[float, ...]] | None = None, **parameters: float) -> Driver:
    machine = driver(joints, **parameters)
    assert machine.enable("").success
    return machine


def play(machine: Driver, seconds: float, extra: tuple[float, ...] = (0.0,) * 4) -> None:
    """Answer every state with currents that carry the links."""
    for _ in range(round(seconds / PERIOD)):
        machine.command(machine.stamp, carrying(machine.plant.q, extra))
        machine.advance(0.0)


def until_fault(machine: Driver, extra: tuple[float, ...], seconds: float = 2.0) -> list[str]:
    """Play until a fault; returns the last warnings before it."""
    warnings: list[str] = []
    for _ in range(round(seconds / PERIOD)):
        warnings = machine.warnings or warnings
        play(machine, PERIOD, extra)
        if machine.safety.mode is Mode.FAULT:
            return warnings
    return warnings


def test_starts_braked_and_does_not_sag() -> None:
    machine = driver()
    for _ in range(2000):
        machine.advance(0.0)
    assert machine.safety.mode is Mode.BRAKED
    np.testing.assert_allclose(machine.plant.q, START, atol=1e-9)


def test_brakes_released_without_currents_let_the_arm_fall() -> None:
    machine = enabled(watchdog=1e9)
    for _ in range(200):
        machine.advance(0.0)
    assert max(abs(machine.plant.q - START)) > 0.01


def test_commands_are_ignored_while_braked_and_in_a_fault() -> None:
    machine = driver()
    machine.command(machine.stamp, [5.0] * 4)
    machine.advance(0.0)
    assert machine.currents == [0.0] * 4
    machine.fault("test")
    machine.command(machine.stamp, [5.0] * 4)
    machine.advance(0.0)
    assert machine.currents == [0.0] * 4


def test_enable_discards_every_command_before_it() -> None:
    machine = driver()
    machine.command(machine.stamp, [5.0] * 4)
    machine.enable("")
    machine.advance(0.0)
    assert machine.currents == [0.0] * 4
    machine.command(machine.stamp, [5.0] * 4)
    machine.enable("")
    machine.advance(0.0)
    assert machine.currents == [0.0] * 4
    machine.command(machine.stamp, [5.0] * 4)
    machine.advance(0.0)
    assert machine.currents == [5.0] * 4


def test_answer_to_a_state_before_the_release_of_the_brakes_is_ignored_when_it_comes_late() -> None:
    machine = driver()
    before = machine.stamp
    machine.advance(0.0)
    machine.enable("")
    machine.command(before, [5.0] * 4)
    machine.advance(0.0)
    assert machine.currents == [0.0] * 4
    machine.command(machine.stamp, [1.0] * 4)
    machine.advance(0.0)
    assert machine.currents == [1.0] * 4


def test_newer_command_is_not_undone_by_an_older_one() -> None:
    machine = enabled()
    machine.advance(0.0)
    machine.advance(0.0)
    newer = machine.stamp
    machine.command(newer, [1.0] * 4)
    machine.command(newer - SHARED.timing.period_ns, [2.0] * 4)
    machine.command(newer + SHARED.timing.period_ns, [3.0] * 4)
    machine.advance(0.0)
    assert machine.currents == [1.0] * 4


def test_caller_may_reuse_the_list_it_gave() -> None:
    machine = enabled()
    currents = [1.0] * 4
    machine.command(machine.stamp, currents)
    currents[0] = 9.0
    machine.advance(0.0)
    assert machine.currents == [1.0] * 4


def test_last_command_is_held_between_commands() -> None:
    machine = enabled()
    machine.command(machine.stamp, [1.0] * 4)
    for _ in range(20):
        machine.advance(0.0)
        assert machine.currents == [1.0] * 4


@pytest.mark.parametrize("watchdog", [PARAMETERS.watchdog, 0.05, 0.01])
def test_stale_stamp_stops_the_arm_within_50_ms_and_brakes(watchdog: float) -> None:
    machine = enabled(watchdog=watchdog)
    play(machine, 0.1)
    sent = machine.stamp
    machine.command(sent, carrying(machine.plant.q))
    for _ in range(100):
        began = machine.stamp  # the period in which the last currents flow ends here
        machine.advance(0.0)
        if not any(machine.currents):
            break
    assert watchdog - 1e-9 <= (began - sent) * 1e-9 <= SLOW
    assert machine.safety.mode is Mode.FAULT
    assert "stale" in machine.safety.fault
    assert "velocity_loop" in machine.safety.fault
    held = machine.plant.theta
    play(machine, 0.2, (20.0, 20.0, 20.0, 20.0))
    np.testing.assert_allclose(machine.plant.theta, held, atol=1e-6)


def test_without_the_watchdog_a_stale_command_flows_on() -> None:
    machine = enabled(watchdog=1e9)
    machine.command(machine.stamp, carrying(START))
    for _ in range(200):
        machine.advance(0.0)
    assert any(machine.currents)
    assert machine.safety.mode is Mode.ENABLED


def test_command_that_came_too_long_ago_stops_the_arm_whatever_its_stamp() -> None:
    machine = enabled()
    machine.command(machine.stamp, carrying(START))
    machine.advance(PARAMETERS.watchdog - 1e-3)
    assert machine.safety.mode is Mode.ENABLED
    assert any(machine.currents)
    machine.command(machine.stamp, carrying(START))
    machine.advance(PARAMETERS.watchdog + 1e-3)
    assert machine.safety.mode is Mode.FAULT
    assert machine.currents == [0.0] * 4


def test_arm_that_never_gets_a_command_is_stopped_too() -> None:
    machine = enabled()
    for _ in range(round(SLOW / PERIOD)):
        machine.advance(0.0)
    assert machine.safety.mode is Mode.FAULT


def test_current_is_clipped_to_the_peak_of_the_motor() -> None:
    machine = enabled(FAST_JOINTS, **NO_LIMITS)
    machine.command(machine.stamp, [1e3, -1e3, 0.5, 0.0])
    machine.advance(0.0)
    peak = WAM.motors.peak_torque[0] / WAM.motors.torque_constant[0]
    assert machine.currents == [peak, -peak, 0.5, 0.0]
    assert machine.motor_state.effort == pytest.approx([4.85834765, -4.85834765, 0.125, 0.0])


SPIN = (6.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("limit", "joints", "parameters", "fault"),
    [
        (1.0, {"speed_limit": (1.0, 1e6, 1e6, 1e6)}, NO_LIMITS, "speed of joint1"),
        (0.8, FAST_JOINTS, NO_LIMITS | {"tip_speed_limit": 0.8}, "speed of the tip"),
        (0.4, FAST_JOINTS, NO_LIMITS | {"elbow_speed_limit": 0.4}, "speed of the elbow"),
    ],
)
def test_too_fast_is_a_fault_and_nearly_too_fast_a_warning(
    limit: float, joints: dict[str, tuple[float, ...]], parameters: dict[str, float], fault: str
) -> None:
    machine = enabled(joints, **parameters)
    warnings = until_fault(machine, SPIN)
    assert machine.safety.fault.startswith(fault)
    assert f"above its limit {limit:g}" in machine.safety.fault
    assert len(warnings) == 1
    assert warnings[0].startswith(fault)
    assert machine.currents == [0.0] * 4
    allowed = enabled(FAST_JOINTS, **NO_LIMITS)
    assert not until_fault(allowed, SPIN, 0.4)
    assert allowed.safety.mode is Mode.ENABLED


def test_speeds_that_are_watched_are_those_of_the_arm() -> None:
    """Turning about the vertical, tip and elbow move with their distance from the axis."""
    arm = enabled(FAST_JOINTS, **NO_LIMITS)
    play(arm, 0.2, SPIN)
    speed, q = abs(arm.plant.qd[0]), arm.plant.q
    elbow = speed * 0.5588 * abs(math.sin(q[1]))
    tip = speed * abs(-0.5588 * math.sin(q[1]) + 0.4064 * math.cos(q[1] + q[3]))
    for what, value in (("elbow", elbow), ("tip", tip)):
        for factor, mode in ((0.95, Mode.FAULT), (1.05, Mode.ENABLED)):
            watched = enabled(FAST_JOINTS, **(NO_LIMITS | {f"{what}_speed_limit": factor * value}))
            play(watched, 0.2, SPIN)
            assert watched.safety.mode is mode
            assert bool(watched.warnings) is (mode is Mode.ENABLED)


def test_warning_ends_when_the_arm_is_braked() -> None:
    machine = enabled({"speed_limit": (1.0, 1e6, 1e6, 1e6)}, **NO_LIMITS)
    for _ in range(2000):
        if not machine.warnings:
            play(machine, PERIOD, SPIN)
    assert machine.warnings
    machine.disable()
    assert machine.warnings == []


def test_hot_motor_is_a_warning() -> None:
    machine = enabled(FAST_JOINTS, **NO_LIMITS, amplifier=dataclasses.replace(PARAMETERS.amplifier, thermal_time=0.1))
    play(machine, 0.05, (0.0, 0.0, 0.0, -60.0))
    assert any("motor4 is hot" in warning for warning in machine.warnings)
    assert machine.safety.mode is Mode.ENABLED


def _braked(machine: Driver) -> None:
    machine.disable()


def _faulty(machine: Driver) -> None:
    machine.fault("another")


def _running(machine: Driver) -> None:
    play(machine, 0.05)


@pytest.mark.parametrize("prepare", [_braked, _running, _faulty])
def test_estop_works_in_every_state(prepare: Callable[[Driver], None]) -> None:
    machine = enabled()
    prepare(machine)
    answer = machine.estop()
    assert answer.success
    assert "reset_fault" in answer.message
    assert machine.safety.mode is Mode.FAULT
    assert machine.safety.fault == ("another" if prepare is _faulty else "emergency stop")
    assert machine.currents == [0.0] * 4
    held = machine.plant.theta
    play(machine, 0.1, (20.0,) * 4)
    np.testing.assert_allclose(machine.plant.theta, held, atol=1e-6)
    assert not machine.enable("").success
    machine.reset_fault()
    assert machine.safety.mode is Mode.BRAKED
    assert machine.enable("").success


def test_disable_puts_on_the_brakes_and_drops_the_command() -> None:
    machine = enabled()
    play(machine, 0.05)
    assert any(machine.currents)
    machine.disable()
    assert machine.currents == [0.0] * 4
    held = machine.plant.theta
    play(machine, 0.1, (20.0,) * 4)
    np.testing.assert_allclose(machine.plant.theta, held, atol=1e-6)


def test_samples_before_a_fault_are_kept_until_it_is_reset() -> None:
    machine = enabled(post_mortem_samples=50)
    play(machine, 0.1)
    newest = machine.stamp
    machine.estop()
    play(machine, 0.2)
    assert len(machine.recent) == 50
    stamps = [sample.stamp for sample in machine.recent]
    assert stamps == [newest - k * SHARED.timing.period_ns for k in range(49, -1, -1)]
    assert any(machine.recent[-1].flowing)
    assert machine.recent[-1].asked == machine.recent[-1].flowing
    machine.reset_fault()
    machine.advance(0.0)
    assert machine.recent[-1].stamp == machine.stamp


def test_sample_at_a_speed_fault_shows_the_speed() -> None:
    machine = enabled({"speed_limit": (1.0, 1e6, 1e6, 1e6)}, **NO_LIMITS)
    until_fault(machine, SPIN)
    assert abs(machine.recent[-1].thetad[0]) / 29.97 > 1.0


@pytest.mark.parametrize("prepare", [_braked, _running, _faulty])
def test_reset_puts_the_arm_back_braked_while_time_goes_on(prepare: Callable[[Driver], None]) -> None:
    machine = enabled()
    play(machine, 0.1, (5.0, 0.0, 0.0, 0.0))
    prepare(machine)
    before = machine.stamp
    machine.reset()
    assert machine.safety.mode is (Mode.FAULT if prepare is _faulty else Mode.BRAKED)
    assert machine.stamp == before
    np.testing.assert_array_equal(machine.plant.q, START)
    machine.advance(0.0)
    assert machine.stamp == before + SHARED.timing.period_ns
    np.testing.assert_allclose(machine.plant.q, START, atol=1e-12)


def test_time_is_counted_in_periods_from_one() -> None:
    machine = driver()
    assert machine.stamp == SHARED.timing.period_ns
    assert machine.is_outer
    outer = []
    for _ in range(10):
        machine.advance(0.0)
        outer.append(machine.is_outer)
    assert [k for k, is_outer in enumerate(outer, 1) if is_outer] == [5, 10]


def test_joint_signals_are_of_the_plant() -> None:
    machine = enabled()
    play(machine, 0.2, (3.0, 0.0, 0.0, 0.0))
    np.testing.assert_array_equal(machine.joint_sensors.position, machine.plant.q)
    np.testing.assert_array_equal(machine.joint_sensors.effort, machine.plant.strain_torque)
    np.testing.assert_array_equal(machine.true_joint_state.effort, machine.plant.cable_torque)
    assert machine.true_contact.cover == ""


def test_true_contact_is_the_greatest_load() -> None:
    machine = driver()
    machine.plant.push("inner_link", np.array([0.0, 2.0, 0.0]), np.zeros(3))
    machine.plant.push("outer_link", np.array([0.0, 3.0, 0.0]), np.array([0.0, 0.0, 0.6]))
    machine.advance(0.0)
    assert machine.true_contact.cover == "outer_link"
    assert machine.true_contact.place == pytest.approx(0.2)
    assert machine.true_contact.force == (0.0, 3.0, 0.0)


# cables


def machine_with_cables(parameters: DriverParameters = PARAMETERS, **cables: tuple[float, ...]) -> Driver:
    machine = Driver(dataclasses.replace(SHARED, arm=changed(WAM, cables=cables)), parameters)
    assert machine.enable("").success
    return machine


def tight_tensions() -> np.ndarray:
    """T_0 + tau/(2 r) of each motor that carries the links, N; 57 lb and 0.375 in."""
    torque = MOTOR_FROM_TORQUE @ BODY.gravity_torque(START)
    return 57 * 4.4482216 + np.abs(torque) / (2 * 0.375 * 0.0254)


@pytest.mark.parametrize("i", range(4))
@pytest.mark.parametrize(("share", "warns", "faults"), [(0.89, False, False), (0.91, True, False), (1.01, True, True)])
def test_cable_near_its_breaking_strength_is_a_warning_and_above_a_fault_that_names_it(
    i: int, share: float, warns: bool, faults: bool
) -> None:
    strength = [1e6] * 4
    strength[i] = tight_tensions()[i] / share
    machine = machine_with_cables(breaking_strength=tuple(strength))
    play(machine, 0.03)
    what = f"cable tension of motor{i + 1} {tight_tensions()[i]:.0f}"
    assert [warning for warning in machine.warnings if warning.startswith(what[:-2])] == machine.warnings
    assert (machine.safety.mode is Mode.FAULT) is faults
    if faults:
        assert what[:-2] in machine.safety.fault
        assert f"is above its limit {strength[i]:g}" in machine.safety.fault
        assert machine.currents == [0.0] * 4
    else:
        assert bool(machine.warnings) is warns
        assert machine.safety.mode is Mode.ENABLED


def test_pull_of_one_period_breaks_a_cable_too() -> None:
    """A blow between two looks at the speeds, 5 ms apart, is over when they come."""
    machine = machine_with_cables(breaking_strength=(320.0,) * 4)
    play(machine, 0.021)
    assert machine.safety.mode is Mode.ENABLED
    machine.plant.data.qpos[3] += 0.2  # as a blow on the link winds up its cable: 120 N more
    play(machine, 0.001)
    machine.plant.data.qpos[3] -= 0.2
    play(machine, 0.02)
    assert "cable tension of motor4" in machine.safety.fault


# noise


def noisy(**sensors: tuple[float, ...]) -> DriverParameters:
    return dataclasses.replace(
        PARAMETERS,
        amplifier=dataclasses.replace(PARAMETERS.amplifier, current_noise=(0.05,) * 4, torque_ripple=(0.02,) * 4),
        sensors=dataclasses.replace(PARAMETERS.sensors, **sensors),
    )


NOISY = noisy(
    encoder_resolution=(1e-3,) * 4,
    encoder_noise=(1e-3,) * 4,
    joint_encoder_noise=(1e-3,) * 4,
    strain_noise=(0.1,) * 4,
)


def told(parameters: DriverParameters) -> list[object]:
    machine = machine_with_cables(parameters)
    said: list[object] = []
    for _ in range(200):
        play(machine, PERIOD)
        said += [machine.motor_state, machine.joint_sensors, machine.currents, machine.true_joint_state]
    assert machine.safety.mode is Mode.ENABLED
    return said


def test_noisy_driver_says_the_same_again_bit_for_bit_and_another_seed_something_else() -> None:
    assert told(NOISY) == told(NOISY)
    assert told(NOISY) != told(dataclasses.replace(NOISY, seed=NOISY.seed + 1))
    assert told(noisy()) != told(PARAMETERS)


def test_no_noise_flows_while_the_brakes_are_on() -> None:
    machine = Driver(SHARED, NOISY)
    for _ in range(50):
        machine.command(machine.stamp, [1.0] * 4)
        machine.advance(0.0)
        assert machine.currents == [0.0] * 4
    np.testing.assert_allclose(machine.plant.q, START, atol=1e-9)


def test_reset_of_an_arm_with_real_encoders_makes_no_speed() -> None:
    machine = machine_with_cables(noisy(encoder_resolution=(1e-3,) * 4, joint_encoder_noise=(1e-9,) * 4))
    play(machine, 0.2, (10.0, 0.0, 0.0, 0.0))
    assert abs(machine.motor_state.position[0]) > 0.5
    machine.reset()
    machine.advance(0.0)
    np.testing.assert_allclose(machine.motor_state.velocity, 0.0, atol=1.0)
    np.testing.assert_allclose(machine.joint_sensors.velocity, 0.0, atol=1e-4)


# parameters

GROUPS = ("effects.", "world.", "amplifier.", "sensors.", "arm.cables.")
EVERY = [
    (prefix, field)
    for prefix, cls in (("driver:", DriverParameters), ("", Shared))
    for field in fields(cls)
    if field.name.startswith(GROUPS)
]


def built(values: dict[str, Any]) -> Driver:
    configuration = CONFIGURATION.with_values(values)
    return Driver(configuration.shared, configuration.node("driver", DriverParameters))


def present(prefix: str, field: Field) -> Any:
    return CONFIGURATION.sections["driver" if prefix else "/**"][field.name]


@pytest.mark.parametrize(("prefix", "field"), EVERY, ids=[field.name for _, field in EVERY])
def test_wrong_value_is_refused_with_its_name_and_what_is_allowed(prefix: str, field: Field) -> None:
    key, value = prefix + field.name, present(prefix, field)
    bad: list[tuple[object, str]] = []
    if field.kind is bool:
        bad += [(1, "a bool"), ("yes", "a bool")]
    elif field.kind is str:
        bad += [(1, "a str")] + [("nonsense", "one of " + ", ".join(field.choices))] * bool(field.choices)
    else:
        bad += [("much", "a number"), (True, "a number"), (math.nan, ""), (math.inf, "")]
        bad += [(field.low - 1, field.allowed)] * math.isfinite(field.low)
        bad += [(field.high + 1, field.allowed)] * math.isfinite(field.high)
        bad += [(field.low + 0.5, "a whole number")] * (field.kind is int)
    for wrong, allowed in bad:
        with pytest.raises(ParameterError) as refusal:
            built({key: [wrong, *value[1:]] if field.is_array else wrong})
        assert f"'{field.name}' is {wrong!r}" in str(refusal.value)
        assert f"allowed: {allowed}" in str(refusal.value)


ARRAYS = [(prefix, field) for prefix, field in EVERY if field.is_array]


@pytest.mark.parametrize(("prefix", "field"), ARRAYS, ids=[field.name for _, field in ARRAYS])
def test_wrong_number_of_values_is_refused_with_a_name(prefix: str, field: Field) -> None:
    key, value = prefix + field.name, list(present(prefix, field))
    runs_over = field.name.endswith((".names", ".shafts", ".joints", ".stage_motors"))
    extra = "another" if field.name.endswith(".names") else value[0]
    for wrong in (value[:-1], [*value, extra]):
        with pytest.raises(ParameterError) as refusal:
            built({key: wrong})
        group, _, name = field.name.rpartition(".")
        said = group.rpartition(".")[2] + "." + ("" if runs_over else name + "'")
        assert said in str(refusal.value)
        assert "values; " in str(refusal.value)
        assert " need " in str(refusal.value)


@pytest.mark.parametrize(
    ("key", "message"),
    [
        (
            "driver:effects.ripples.shafts",
            "effects.ripples.shafts names 'motor9'; motors and joints: motor1, .* joint4",
        ),
        ("driver:world.springs.joints", "world.springs.joints names 'motor9'; joints: joint1, joint2, joint3, joint4"),
        ("arm.cables.stage_motors", "arm.cables.stage_motors names 'motor9'; motors: motor1, motor2, motor3, motor4"),
    ],
)
def test_shaft_that_the_arm_does_not_have_is_refused_with_those_it_has(key: str, message: str) -> None:
    node, _, name = key.rpartition(":")
    values = list(CONFIGURATION.sections[node or "/**"][name])
    with pytest.raises(ParameterError, match=message):
        built({key: ["motor9", *values[1:]]})


def test_motor_without_a_stage_and_circuit_that_gives_no_way_are_refused() -> None:
    stages = list(CONFIGURATION.sections["/**"]["arm.cables.stage_motors"])
    with pytest.raises(ParameterError, match=r"motor1 has no cable stage; name it in arm\.cables\.stage_motors"):
        built({"arm.cables.stage_motors": ["motor2", "motor2", *stages[2:]]})
    with pytest.raises(ParameterError, match="motor1: its cable stages give no way at all; give one a stage_length"):
        built({"arm.cables.stage_length": [0.0, 0.0, *CONFIGURATION.sections["/**"]["arm.cables.stage_length"][2:]]})


def test_two_springs_may_stand_under_one_joint() -> None:
    """One pushes from each side, so that both together hold the joint: 1000 N/m on 1 m, pressed by 0.1 rad each."""
    springs: dict[str, list[Any]] = {
        "joints": ["joint1", "joint1"],
        "stiffness": [1000.0, 1000.0],
        "lever": [1.0, 1.0],
        "rest": [0.1, -0.1],
        "bilateral": [True, True],
    }
    machine = built({f"driver:world.springs.{key}": value for key, value in springs.items()})
    machine.plant.brake(True)
    assert abs(machine.plant.cable_torque[0]) < 1e-9


def test_rubbing_on_the_wrong_number_of_joints_is_refused() -> None:
    machine = driver()
    with pytest.raises(ParameterError, match=r"'effects\.rubbing_friction' has 1 values; 4 names need 4"):
        machine.rub([0.1])
