"""The driver without ROS: which commands reach the motors, when it stops, what it keeps."""

import dataclasses
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from arms import BODY, CONFIGURATION, NOWHERE, SHARED, WAM, changed
from contact_truth import joint_torques

from wam_description.arm import Shared
from wam_description.effects import no_effects
from wam_description.event import fault
from wam_description.parameters import Field, ParameterError, fields
from wam_description.world import NO_SPRINGS, World
from wam_driver.driver import Driver, DriverParameters
from wam_driver.safety import Mode

PARAMETERS = dataclasses.replace(
    CONFIGURATION.node("driver", DriverParameters), world=World(NOWHERE, NO_SPRINGS), effects=no_effects(WAM)
)
PERIOD = SHARED.timing.period
MOTOR_FROM_TORQUE = np.linalg.inv(np.array([joint_torques(e) for e in np.eye(4)]).T)
START = np.array(WAM.joints.start)
SLOW = 0.05  # s; a stop must come within it
FAST_JOINTS = {"speed_limit": (1e6,) * 4}
NO_LIMITS = {"cover_speed_limit": 1e6, "tip_speed_limit": 1e6}


def driver(joints: dict[str, tuple[float, ...]] | None = None, **parameters: Any) -> Driver:
    shared = dataclasses.replace(SHARED, arm=changed(WAM, joints=joints))
    return Driver(shared, dataclasses.replace(PARAMETERS, **parameters))


def carrying(q: np.ndarray | list[float], extra: tuple[float, ...] = (0.0,) * 4) -> list[float]:
    """Currents that carry the links, with joint torques on top, A."""
    tau = MOTOR_FROM_TORQUE @ (BODY.gravity_torque(q) + extra)
    return (tau / WAM.motors.torque_constant).tolist()


def enabled(joints: dict[str, tuple[float, ...]] | None = None, **parameters: float) -> Driver:
    hardware = driver(joints, **parameters)
    assert hardware.safety.enable("").success
    return hardware


def play(hardware: Driver, seconds: float, extra: tuple[float, ...] = (0.0,) * 4) -> None:
    """Answer every state with currents that carry the links."""
    for _ in range(round(seconds / PERIOD)):
        hardware.command(hardware.stamp, carrying(hardware.plant.q, extra))
        hardware.advance(0.0)


def until_fault(hardware: Driver, extra: tuple[float, ...], seconds: float = 2.0) -> list[str]:
    """Play until a fault; returns the last warnings before it."""
    warnings: list[str] = []
    for _ in range(round(seconds / PERIOD)):
        warnings = hardware.warnings or warnings
        play(hardware, PERIOD, extra)
        if hardware.safety.mode is Mode.FAULT:
            return warnings
    return warnings


def answered(hardware: Driver, current: float) -> list[float]:
    """Currents, A, in the period after a command that answers the present state."""
    hardware.command(hardware.stamp, [current] * 4)
    hardware.advance(0.0)
    return hardware.currents


def test_starts_braked_and_does_not_sag() -> None:
    hardware = driver()
    for _ in range(2000):
        hardware.advance(0.0)
    assert hardware.safety.mode is Mode.BRAKED
    np.testing.assert_allclose(hardware.plant.q, START, atol=1e-9)


def test_commands_are_ignored_while_braked_and_in_a_fault() -> None:
    hardware = driver(amplifier=dataclasses.replace(PARAMETERS.amplifier, bandwidth=50.0, delay=1))
    assert answered(hardware, 5.0) == [0.0] * 4
    hardware.safety.enable("")
    assert any([answered(hardware, 5.0) for _ in range(3)][-1])
    hardware.safety.trip(fault("test", reason="test"))
    assert answered(hardware, 5.0) == [0.0] * 4


def test_enable_discards_every_command_before_it() -> None:
    hardware = driver()
    hardware.command(hardware.stamp, [5.0] * 4)
    hardware.safety.enable("")
    hardware.advance(0.0)
    assert hardware.currents == [0.0] * 4
    hardware.command(hardware.stamp, [5.0] * 4)
    hardware.safety.disable()
    hardware.safety.enable("")
    hardware.advance(0.0)
    assert hardware.currents == [0.0] * 4
    assert answered(hardware, 5.0) == [5.0] * 4


def test_to_enable_an_enabled_driver_changes_nothing() -> None:
    hardware = driver()
    hardware.safety.enable("")
    hardware.command(hardware.stamp, [5.0] * 4)
    for _ in range(3):
        assert hardware.safety.enable("an obstacle").success
        hardware.advance(0.0)
        assert hardware.currents == [5.0] * 4, "no period without current while the brakes are off"


def test_answer_to_a_state_before_the_release_of_the_brakes_is_ignored_when_it_comes_late() -> None:
    hardware = driver()
    before = hardware.stamp
    hardware.advance(0.0)
    hardware.safety.enable("")
    hardware.command(before, [5.0] * 4)
    hardware.advance(0.0)
    assert hardware.currents == [0.0] * 4
    assert answered(hardware, 1.0) == [1.0] * 4


def test_newer_command_is_not_undone_by_an_older_one() -> None:
    hardware = enabled()
    hardware.advance(0.0)
    hardware.advance(0.0)
    newer = hardware.stamp
    hardware.command(newer, [1.0] * 4)
    hardware.command(newer - SHARED.timing.period_ns, [2.0] * 4)
    hardware.command(newer + SHARED.timing.period_ns, [3.0] * 4)
    hardware.advance(0.0)
    assert hardware.currents == [1.0] * 4


@pytest.mark.parametrize("watchdog", [PARAMETERS.watchdog, 0.05, 0.01])
def test_stale_stamp_stops_the_arm_within_50_ms_and_brakes(watchdog: float) -> None:
    hardware = enabled(watchdog=watchdog)
    play(hardware, 0.1)
    sent = hardware.stamp
    hardware.command(sent, carrying(hardware.plant.q))
    for _ in range(100):
        began = hardware.stamp  # the period in which the last currents flow ends here
        hardware.advance(0.0)
        if not any(hardware.currents):
            break
    assert watchdog - 1e-9 <= (began - sent) * 1e-9 <= SLOW
    assert hardware.safety.mode is Mode.FAULT
    assert "stale" in hardware.safety.fault
    assert "velocity_loop" in hardware.safety.fault
    held = hardware.plant.theta
    play(hardware, 0.2, (20.0, 20.0, 20.0, 20.0))
    np.testing.assert_allclose(hardware.plant.theta, held, atol=1e-6)


def test_command_that_came_too_long_ago_stops_the_arm_whatever_its_stamp() -> None:
    hardware = enabled()
    hardware.command(hardware.stamp, carrying(START))
    hardware.advance(PARAMETERS.watchdog - 1e-3)
    assert hardware.safety.mode is Mode.ENABLED
    assert any(hardware.currents)
    hardware.command(hardware.stamp, carrying(START))
    hardware.advance(PARAMETERS.watchdog + 1e-3)
    assert hardware.safety.mode is Mode.FAULT
    assert hardware.currents == [0.0] * 4


def test_current_is_clipped_to_the_peak_of_the_motor() -> None:
    hardware = enabled(FAST_JOINTS, **NO_LIMITS)
    hardware.command(hardware.stamp, [1e3, -1e3, 0.5, 0.0])
    hardware.advance(0.0)
    peak = WAM.motors.peak_torque[0] / WAM.motors.torque_constant[0]
    assert hardware.currents == [peak, -peak, 0.5, 0.0]
    assert hardware.motor_state.effort == pytest.approx([4.85834765, -4.85834765, 0.125, 0.0])


SPIN = (6.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize(("limit", "joints", "parameters", "fault"), [
    (1.0, {"speed_limit": (1.0, 1e6, 1e6, 1e6)}, NO_LIMITS, "speed of joint1"),
    (0.8, FAST_JOINTS, NO_LIMITS | {"tip_speed_limit": 0.8}, "speed of the tip"),
    (0.4, FAST_JOINTS, NO_LIMITS | {"cover_speed_limit": 0.4}, "speed of outer_link at the end nearer the base"),
])  # fmt: skip
def test_too_fast_is_a_fault_and_nearly_too_fast_a_warning(
    limit: float, joints: dict[str, tuple[float, ...]], parameters: dict[str, float], fault: str, direction: float
) -> None:
    hardware = enabled(joints, **parameters)
    spin = (direction * SPIN[0], 0.0, 0.0, 0.0)
    warnings = until_fault(hardware, spin)
    assert hardware.safety.fault.startswith(fault)
    assert f"above its limit of {limit:g}" in hardware.safety.fault
    assert len(warnings) == 1
    assert abs(hardware.plant.thetad[0]) > 0.0, "the arm still turns"
    assert warnings[0].startswith(fault)
    assert hardware.currents == [0.0] * 4
    allowed = enabled(FAST_JOINTS, **NO_LIMITS)
    assert not until_fault(allowed, spin, 0.4)
    assert allowed.safety.mode is Mode.ENABLED


def test_warning_ends_when_the_arm_is_braked() -> None:
    hardware = enabled({"speed_limit": (1.0, 1e6, 1e6, 1e6)}, **NO_LIMITS)
    for _ in range(2000):
        if not hardware.warnings:
            play(hardware, PERIOD, SPIN)
    assert hardware.warnings
    hardware.safety.disable()
    assert hardware.warnings == []


def test_hot_motor_is_a_warning_and_reset_cools_it() -> None:
    hardware = enabled(FAST_JOINTS, **NO_LIMITS, amplifier=dataclasses.replace(PARAMETERS.amplifier, thermal_time=0.1))
    play(hardware, 0.05, (0.0, 0.0, 0.0, -60.0))
    assert any("motor4 is hot" in warning for warning in hardware.warnings)
    assert hardware.safety.mode is Mode.ENABLED
    hardware.reset()
    hardware.safety.enable("")
    play(hardware, 0.01)
    assert hardware.warnings == []


def _braked(hardware: Driver) -> None:
    hardware.safety.disable()


def _stopped(hardware: Driver) -> None:
    hardware.safety.trip(fault("emergency_stop"))


def _faulty(hardware: Driver) -> None:
    hardware.safety.trip(fault("test", reason="another"))


def _running(hardware: Driver) -> None:
    play(hardware, 0.05)


@pytest.mark.parametrize("prepare", [_braked, _running, _faulty])
def test_estop_works_in_every_state(prepare: Callable[[Driver], None]) -> None:
    hardware = enabled()
    prepare(hardware)
    _stopped(hardware)
    assert hardware.safety.mode is Mode.FAULT
    assert hardware.safety.fault == ("another" if prepare is _faulty else "emergency stop")
    assert hardware.currents == [0.0] * 4
    held = hardware.plant.theta
    play(hardware, 0.1, (20.0,) * 4)
    np.testing.assert_allclose(hardware.plant.theta, held, atol=1e-6)
    assert not hardware.safety.enable("").success
    hardware.reset_fault()
    assert hardware.safety.mode is Mode.BRAKED
    assert hardware.safety.enable("").success


@pytest.mark.parametrize("prepare", [_braked, _running, _faulty])
def test_reset_puts_the_arm_back_braked_while_time_goes_on(prepare: Callable[[Driver], None]) -> None:
    hardware = enabled()
    play(hardware, 0.1, (5.0, 0.0, 0.0, 0.0))
    prepare(hardware)
    before = hardware.stamp
    hardware.reset()
    assert hardware.safety.mode is (Mode.FAULT if prepare is _faulty else Mode.BRAKED)
    assert hardware.stamp == before
    np.testing.assert_array_equal(hardware.plant.q, START)
    hardware.advance(0.0)
    assert hardware.stamp == before + SHARED.timing.period_ns
    np.testing.assert_allclose(hardware.plant.q, START, atol=1e-12)


def test_time_is_counted_in_periods_from_one() -> None:
    hardware = driver()
    assert hardware.stamp == SHARED.timing.period_ns
    assert hardware.is_outer
    outer = []
    for _ in range(10):
        hardware.advance(0.0)
        outer.append(hardware.is_outer)
    assert [k for k, is_outer in enumerate(outer, 1) if is_outer] == [5, 10]


def test_true_contact_is_the_greatest_load() -> None:
    hardware = driver()
    hardware.plant.push("inner_link", np.array([0.0, 2.0, 0.0]), np.zeros(3))
    hardware.plant.push("outer_link", np.array([0.0, 3.0, 0.0]), np.array([0.0, 0.0, 0.6]))
    hardware.advance(0.0)
    assert hardware.true_contact.cover == "outer_link"
    assert hardware.true_contact.position == pytest.approx(0.2)
    assert hardware.true_contact.force == (0.0, 3.0, 0.0)


def hardware_with_cables(parameters: DriverParameters = PARAMETERS, **cables: tuple[float, ...]) -> Driver:
    hardware = Driver(dataclasses.replace(SHARED, arm=changed(WAM, cables=cables)), parameters)
    assert hardware.safety.enable("").success
    return hardware


def tight_tensions() -> np.ndarray:
    """T_0 + tau/(2 r) of each motor that carries the links, N; 57 lb and 0.375 in."""
    torque = MOTOR_FROM_TORQUE @ BODY.gravity_torque(START)
    return 57 * 4.4482216 + np.abs(torque) / (2 * 0.375 * 0.0254)


@pytest.mark.parametrize("i", [0, 3])
@pytest.mark.parametrize(("share", "warns", "faults"), [(0.89, False, False), (0.91, True, False), (1.01, True, True)])
def test_cable_near_its_breaking_strength_is_a_warning_and_above_a_fault_that_names_it(
    i: int, share: float, warns: bool, faults: bool
) -> None:
    strength = [1e6] * 4
    strength[i] = tight_tensions()[i] / share
    hardware = hardware_with_cables(breaking_strength=tuple(strength))
    play(hardware, 0.03)
    what = f"cable tension of motor{i + 1} is {tight_tensions()[i]:.0f}"
    assert [warning for warning in hardware.warnings if warning.startswith(what[:-2])] == hardware.warnings
    assert (hardware.safety.mode is Mode.FAULT) is faults
    if faults:
        assert what[:-2] in hardware.safety.fault
        assert f"above its limit of {strength[i]:g} N" in hardware.safety.fault
        assert hardware.currents == [0.0] * 4
    else:
        assert bool(hardware.warnings) is warns
        assert hardware.safety.mode is Mode.ENABLED


def test_pull_of_one_period_breaks_a_cable_too() -> None:
    """A blow between two checks of the limits, 5 ms apart, is over at the second."""
    hardware = hardware_with_cables(breaking_strength=(320.0,) * 4)
    play(hardware, 0.021)
    assert hardware.safety.mode is Mode.ENABLED
    hardware.plant.data.qpos[3] += 0.2  # as a blow on the link winds up its cable: 120 N more
    play(hardware, 0.001)
    hardware.plant.data.qpos[3] -= 0.2
    play(hardware, 0.02)
    assert "cable tension of motor4" in hardware.safety.fault


def noisy(**sensors: tuple[float, ...]) -> DriverParameters:
    return dataclasses.replace(
        PARAMETERS,
        amplifier=dataclasses.replace(PARAMETERS.amplifier, current_noise=(0.05,) * 4, torque_ripple=(0.02,) * 4),
        sensors=dataclasses.replace(PARAMETERS.sensors, **sensors),
    )


NOISY = noisy(
    encoder_resolution=(1e-3,) * 4, encoder_noise=(1e-3,) * 4, joint_encoder_noise=(1e-3,) * 4, strain_noise=(0.1,) * 4
)


def published(parameters: DriverParameters) -> list[object]:
    hardware = hardware_with_cables(parameters)
    values: list[object] = []
    for _ in range(200):
        play(hardware, PERIOD)
        values += [hardware.motor_state, hardware.joint_sensors, hardware.currents, hardware.true_joint_state]
    assert hardware.safety.mode is Mode.ENABLED
    return values


def test_noise_repeats_bit_for_bit_with_its_seed_and_differs_with_another() -> None:
    assert published(NOISY) == published(NOISY)
    assert published(NOISY) != published(dataclasses.replace(NOISY, seed=NOISY.seed + 1))
    assert published(noisy()) != published(PARAMETERS)


def test_reset_of_an_arm_with_real_encoders_reads_no_speed() -> None:
    hardware = hardware_with_cables(noisy(encoder_resolution=(1e-3,) * 4, joint_encoder_noise=(1e-9,) * 4))
    play(hardware, 0.2, (10.0, 0.0, 0.0, 0.0))
    assert abs(hardware.motor_state.position[0]) > 0.5
    hardware.reset()
    hardware.advance(0.0)
    np.testing.assert_allclose(hardware.motor_state.velocity, 0.0, atol=1.0)
    np.testing.assert_allclose(hardware.joint_sensors.velocity, 0.0, atol=1e-4)


GROUPS = ("effects.", "friction.", "world.", "amplifier.", "sensors.", "arm.cables.")
EVERY = [  # every sixth
    (prefix, field)
    for prefix, cls in (("driver:", DriverParameters), ("", Shared))
    for field in fields(cls)
    if field.name.startswith(GROUPS)
][::6]


def built(values: dict[str, Any]) -> Driver:
    configuration = CONFIGURATION.with_values(values)
    return Driver(configuration.shared, configuration.node("driver", DriverParameters))


def present(prefix: str, field: Field) -> Any:
    return CONFIGURATION.sections["driver" if prefix else "/**"][field.name]


ARRAYS = [(prefix, field) for prefix, field in EVERY if field.is_array]


@pytest.mark.slow
@pytest.mark.parametrize(("prefix", "field"), ARRAYS, ids=[field.name for _, field in ARRAYS])
def test_wrong_number_of_values_is_refused_with_a_name(prefix: str, field: Field) -> None:
    key, value = prefix + field.name, list(present(prefix, field))
    runs_over = field.name.endswith((".names", ".shafts", ".joints", ".stage_motors", ".obstacles"))
    extra = "another" if field.name.endswith(".names") else value[0]
    for wrong in (value[:-1], [*value, extra]):
        with pytest.raises(ParameterError) as refusal:
            built({key: wrong})
        group, _, name = field.name.rpartition(".")
        said = group.rpartition(".")[2] + "." + ("" if runs_over else name + "'")
        assert said in str(refusal.value)
        assert re.search(" values?; ", str(refusal.value))
        assert re.search(" needs? ", str(refusal.value))


@pytest.mark.parametrize(("key", "message"), [
    (
        "driver:effects.ripples.shafts",
        "effects.ripples.shafts names 'motor9'; motors and joints: motor1, .* joint4",
    ),
    ("driver:world.springs.joints", "world.springs.joints names 'motor9'; joints: joint1, joint2, joint3, joint4"),
    ("arm.cables.stage_motors", "arm.cables.stage_motors names 'motor9'; motors: motor1, motor2, motor3, motor4"),
])  # fmt: skip
def test_shaft_that_the_arm_does_not_have_is_refused_with_those_it_has(key: str, message: str) -> None:
    node, _, name = key.rpartition(":")
    values = list(CONFIGURATION.sections[node or "/**"][name])
    with pytest.raises(ParameterError, match=message):
        built({key: ["motor9", *values[1:]]})


def test_motor_without_a_stage_and_circuit_without_compliance_are_refused() -> None:
    stages = list(CONFIGURATION.sections["/**"]["arm.cables.stage_motors"])
    with pytest.raises(ParameterError, match=r"motor1 has no cable stage; name it in arm\.cables\.stage_motors"):
        built({"arm.cables.stage_motors": ["motor2", "motor2", *stages[2:]]})
    with pytest.raises(ParameterError, match="motor1: its cable stages have zero compliance; give one a stage_length"):
        built({"arm.cables.stage_length": [0.0, 0.0, *CONFIGURATION.sections["/**"]["arm.cables.stage_length"][2:]]})


def test_one_joint_may_have_two_springs() -> None:
    """One pushes from each side, so that both together hold the joint: 1000 N/m on 1 m, pressed by 0.1 rad each."""
    springs: dict[str, list[Any]] = {
        "joints": ["joint3", "joint3"],
        "stiffness": [1000.0, 1000.0],
        "lever": [1.0, 1.0],
        "rest": [0.1, -0.1],
        "bilateral": [True, True],
    }
    hardware = built({f"driver:world.springs.{key}": value for key, value in springs.items()})
    hardware.plant.brake(True)
    assert abs(hardware.plant.cable_torque[2]) < 1e-9


def test_a_spring_whose_force_no_message_could_contain_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"acts on joint1, whose link has no cover, .* joint3, joint4, or"):
        built({"driver:world.springs.stiffness": [10.0]})


def test_a_spring_beyond_the_end_of_its_link_is_refused() -> None:
    spring = {"driver:world.springs.joints": ["joint4"], "driver:world.springs.stiffness": [10.0]}
    with pytest.raises(
        ParameterError, match=r"lever is 1 m for joint4: .* at 1 m of outer_link; allowed: 0 to 0.4064 m"
    ):
        built(spring)
    built({**spring, "driver:world.springs.lever": [0.4064]})


def test_added_friction_on_the_wrong_number_of_joints_is_refused() -> None:
    effects = dataclasses.replace(no_effects(WAM), added_coulomb_friction=(0.1,))
    with pytest.raises(ParameterError, match=r"'effects\.added_coulomb_friction' has 1 values; it needs 4"):
        driver().tune(dataclasses.replace(driver().parameters, effects=effects))


def stopped_at_speed(q: list[float], qd: list[float], stop: Callable[[Driver], Any], **parameters: float) -> Driver:
    """An enabled arm that moves at qd, (4,), rad/s, and is stopped; after 0.1 s."""
    hardware = enabled(FAST_JOINTS | {"start": tuple(q)}, **parameters)
    hardware.plant.data.qvel[:] = [*np.linalg.inv(np.reshape(WAM.joint_from_motor, (4, 4))) @ qd, *qd]
    stop(hardware)
    for _ in range(100):
        hardware.advance(0.0)
    return hardware


@pytest.mark.parametrize(
    ("stop", "before"), [(_stopped, "emergency stop; then "), (_braked, ""), (_faulty, "another; then ")]
)
def test_cable_that_breaks_under_the_brakes_is_named_once_after_the_fault(
    stop: Callable[[Driver], Any], before: str
) -> None:
    """Joint 2 at 3.5 of its 4 rad/s, stopped in one step: 870 to 930 N, of which nobody was told."""
    hardware = stopped_at_speed([0.0, -0.6, 0.0, 0.5], [0.0, 3.5, 0.0, 0.0], stop, brake_torque=1000.0)
    fault = hardware.safety.fault
    assert fault.startswith(before + "cable tension of motor2 ")
    assert fault.endswith(" N, above its limit of 756.198 N while the brakes hold; check the cable")
    hardware.reset_fault()
    for _ in range(20):
        hardware.advance(0.0)
    assert hardware.safety.mode is Mode.BRAKED


@pytest.mark.parametrize(("q", "qd"), [
    ([0.0, -0.6, 0.0, 0.5], [0.0, 4.0, 0.0, 0.0]),
    ([0.07, 2.03, -1.79, 2.15], [-4.0, 0.0, 6.0, -6.0]),
    ([-2.08, 1.44, 0.92, 1.53], [2.6, -2.6, 3.9, 3.9]),
    ([2.73, 1.01, 0.21, -0.41], [4.0, -2.0, -6.0, 6.0]),
])  # fmt: skip
def test_brakes_stop_an_arm_at_its_speed_limits_within_a_tenth_of_a_radian_and_break_no_cable(
    q: list[float], qd: list[float]
) -> None:
    hardware = stopped_at_speed(q, qd, _stopped)
    assert hardware.safety.fault == "emergency stop"
    assert max(map(abs, hardware.plant.thetad)) < 1e-3
    assert np.abs(np.array(hardware.plant.q) - q).max() < 0.1
