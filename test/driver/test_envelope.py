"""What the arm cannot bear or cannot be is refused by name: commands, pushes, configurations, steps of the plant."""

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wam_control.force.force_command import CommandAdmission
from wam_control.force.force_input import ForceInput
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_description.configuration import Configuration, packaged
from wam_description.event_text import LESS, sentence
from wam_description.parameters import ParameterError
from wam_description.rigid_body import RigidBody
from wam_description.signals import BASE, ForceCommand, State, Wrench
from wam_driver.driver import Driver, DriverParameters
from wam_driver.limit_watch import LimitWatch, WatchedLimit, excess
from wam_driver.safety import Mode

WAM, TESTBED = (Configuration.load(packaged(name)) for name in ("wam", "testbed"))
ARM = WAM.shared.arm
N = len(ARM.joints.names)
DT, PERIOD = 0.005, 0.001


def driver(configuration: Configuration = WAM, **values: Any) -> Driver:
    changed = configuration.with_values({key.replace("__", "."): value for key, value in values.items()})
    return Driver(changed.shared, changed.node("driver", DriverParameters))


def enabled(**values: Any) -> Driver:
    hardware = driver(**values)
    assert hardware.safety.enable("").success
    return hardware


@pytest.mark.parametrize(("values", "text"), [
    ({"arm.joints.offset": [0.0, 0.0, 2.9, 0.0], "arm.links.mass": [70.0] * 4}, r"cannot carry the links beyond"),
    ({"arm.links.mass": [7680.0, 3.59, 1.95, 1.06]}, r"'arm.links.mass' is 7680.0 kg; allowed"),
    ({"arm.links.mass": [7.68, 3.59, 195.0, 1.06]}, r"the motors cannot carry the links beyond joint1: .* 1.52e\+03 N"),
    ({"arm.links.centre": [0.0] * 9 + [1.36, 0.0, 0.0]}, r"link4: arm.links.centre is 1.36 m .* arm is 0.965 m long"),
    (
        {"arm.links.inertia": [20.0] * 12},
        r"link1: arm.links.inertia is 20 kg m\^2; allowed: up to .* kg m\^2, that of 7.68 kg at the",
    ),
    (
        {"arm.links.inertia": [0.01, 0.02, 0.04] * 4},
        r"link1: .* inertias 0.01, 0.02 and 0.04 kg m\^2; of no body .* above the sum of the others, 0.03 kg m\^2",
    ),
    ({"arm.gravity": [0.0, 0.0, 9.80665]}, r"arm.gravity points upwards in the base frame: z is 9.80665"),
    ({"arm.covers.links": ["link4", "link2"]}, r"is link4, link2; list the covers from the base to the tool"),
])  # fmt: skip
def test_an_arm_that_cannot_be_is_refused(values: dict[str, Any], text: str) -> None:
    with pytest.raises(ParameterError, match=text):
        WAM.with_values(values).shared  # noqa: B018 - it is built here


def test_an_arm_that_hangs_from_a_ceiling_has_its_base_turned_and_gravity_pulls_as_it_should() -> None:
    hanging = WAM.with_values({"arm.joints.twist": [math.pi, *ARM.joints.twist[1:]]})
    upright, turned = driver(), driver(hanging, **{"driver:world.obstacles.positions": [0.0, 0.0, -9.0]})
    assert turned.plant.cable_torque == pytest.approx([-t for t in upright.plant.cable_torque], abs=1e-6)


@pytest.mark.parametrize(("configuration", "values", "text"), [
    (WAM, {"driver:world.obstacles.stiffness": [1e7]}, "too long for obstacle 'foam_box' on"),
    (WAM, {"driver:world.obstacles.damping": [20000.0]}, "too long for obstacle 'foam_box' on"),
    (WAM, {"driver:world.obstacles.hardening": [1e6]}, "too long for obstacle 'foam_box' on"),
    (WAM, {"driver:world.pushers.force": [5.0], "driver:world.pushers.stiffness": [1e8]}, "pusher 'hand' on outer"),
    (WAM, {"arm.motors.inertia": [4e-6] * 4}, "too long for cables, rotors, springs and hinges"),
    (WAM, {"arm.cables.damping": [0.5] * 4}, "too long for cables, rotors, springs and hinges"),
    (TESTBED, {"driver:world.springs.stiffness": [1e8]}, "too long for cables, rotors, springs and hinges"),
])  # fmt: skip
def test_a_step_that_does_not_fit_is_refused_and_the_one_it_names_is_taken(
    configuration: Configuration, values: dict[str, Any], text: str
) -> None:
    with pytest.raises(ParameterError, match=text) as refusal:
        driver(configuration, **values)
    factor = int(str(refusal.value).partition("multiply timing.substeps by ")[2].partition(" ")[0])
    substeps = factor * configuration.shared.timing.substeps
    if substeps <= 1000:
        driver(configuration, **values, timing__substeps=substeps)


def test_a_message_without_a_push_ends_those_of_messages_and_not_that_of_the_program() -> None:
    hardware = driver()
    none, force = (0.0, 0.0, 0.0), (0.0, 5.0, 0.0)
    hardware.disturb(Wrench("inner_link", force, none))
    hardware.plant.push("outer_link", force, none)
    assert [load.cover for load in hardware.plant.loads()] == ["inner_link", "outer_link"]
    hardware.disturb(Wrench(BASE, none, none))
    assert [load.cover for load in hardware.plant.loads()] == ["outer_link"]


def test_a_message_is_the_one_push_of_messages_so_that_one_on_another_cover_ends_it() -> None:
    hardware = driver()
    none, force = (0.0, 0.0, 0.0), (0.0, 5.0, 0.0)
    hardware.disturb(Wrench("inner_link", force, none))
    hardware.disturb(Wrench("outer_link", force, none))
    assert [load.cover for load in hardware.plant.loads()] == ["outer_link"]
    with pytest.raises(ValueError, match="frame_id is 'base'; push on one of inner_link, outer_link"):
        hardware.disturb(Wrench(BASE, force, none))
    assert [load.cover for load in hardware.plant.loads()] == ["outer_link"]


def test_a_push_that_nobody_repeats_ends_after_the_age_of_a_command_and_no_other() -> None:
    hardware = driver()
    periods = round(WAM.shared.ages.command / WAM.shared.timing.period)
    push = (0.0, 5.0, 0.0), (0.0, 0.0, 1.0)
    hardware.plant.push("inner_link", *push)
    for repeated in [True] * periods + [False] * periods:
        if repeated:
            hardware.disturb(Wrench("outer_link", *push))
        assert len(hardware.plant.loads()) == 2
        hardware.advance(0.0)
    for _ in range(2):
        hardware.advance(0.0)
    assert [load.cover for load in hardware.plant.loads()] == ["inner_link"]


@pytest.mark.parametrize("terminated", [False, True])
@pytest.mark.parametrize("force", [1e12, 1e300, math.nan])
def test_a_simulation_that_fails_is_a_fault_with_brakes_and_a_finite_state(
    force: float, terminated: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    hardware = enabled(**{"driver:effects.terminated": terminated})
    for _ in range(20):
        hardware.command(hardware.stamp, [0.0] * N)
        hardware.advance(0.0)
    before = hardware.plant.q
    hardware.plant.push("outer_link", np.array([force, 0.0, force]), np.zeros(3))
    for _ in range(20):
        hardware.command(hardware.stamp, [0.0] * N)
        hardware.advance(0.0)
        state = [*hardware.motor_state.position, *hardware.motor_state.velocity, *hardware.joint_sensors.effort]
        assert all(map(math.isfinite, state))
    assert hardware.safety.mode is Mode.FAULT
    assert (
        "the simulation of the arm failed: " in hardware.safety.fault or "above its limit of" in hardware.safety.fault
    )
    assert not list(tmp_path.iterdir()), "MuJoCo writes no log"
    if math.isnan(force):
        assert hardware.plant.q == pytest.approx(before, abs=1e-3), "the arm does not jump to another pose"
    hardware.reset()
    hardware.reset_fault()
    for _ in range(20):
        hardware.advance(0.0)
    assert hardware.plant.q == pytest.approx(list(ARM.joints.start), abs=1e-6)


PUSHED = r"push less, or " + re.escape(LESS)


@pytest.mark.parametrize(("ended", "advice"), [
    (0.0, r"a push acts \(1.2 N on outer_link\); " + PUSHED),
    (0.05, r"a push acted until 0.\d\d s before \(1.2 N on outer_link\); " + PUSHED),
    (0.5, re.escape(LESS)),
])  # fmt: skip
def test_a_fault_names_the_push_that_acts_or_has_just_acted(ended: float, advice: str) -> None:
    hardware = enabled(**{"driver:tip_speed_limit": 0.5})
    carried = ARM.transmission.motor_torques(RigidBody(ARM).gravity_torque(ARM.joints.start).tolist())
    at_rest = [torque / k for torque, k in zip(carried, ARM.motors.torque_constant, strict=True)]

    def play(seconds: float, currents: list[float]) -> None:
        for _ in range(round(seconds / PERIOD)):
            hardware.command(hardware.stamp, currents)
            hardware.advance(0.0)

    play(0.02, at_rest)
    hardware.disturb(Wrench("outer_link", (0.0, 0.0, 1.2), (0.0, -0.3, 0.0)))
    play(0.02, at_rest)
    if ended:
        hardware.disturb(Wrench(BASE, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
        play(ended, at_rest)
    assert hardware.safety.mode is Mode.ENABLED, hardware.safety.fault
    play(0.1, [2.0 * current + 2.0 for current in at_rest])
    assert re.fullmatch("speed of the tip [^;]*; " + advice, hardware.safety.fault)


def watched(watch: LimitWatch, q: Sequence[float], currents: Sequence[float] = (0.0,) * N) -> dict[str, WatchedLimit]:
    theta = np.linalg.solve(np.reshape(ARM.joint_from_motor, (N, N)), q).tolist()
    return {limit.quantity: limit for limit in watch.watched(theta, [0.0] * N, currents, [0.0] * N)}


def test_joint_limits_and_currents_are_watched() -> None:
    watch = LimitWatch(ARM, 2.5, 4.0)
    at = list(ARM.joints.start)
    name = "travel of joint2 from the middle of its range"
    assert not watched(watch, at)
    at[1] = 0.95 * ARM.joints.lower[1]
    assert list(watched(watch, at)) == [name]
    at[1] = ARM.joints.lower[1] - 0.001
    beyond = excess(watched(watch, at).values(), "broken")
    assert beyond is not None
    assert ": joint2 is at -2.357 rad, its stop at -2.356 rad" in sentence(beyond)
    near = watched(watch, ARM.joints.start, [0.0, -0.95 * ARM.motors.peak_torque[1] / 0.25, 0.0, 0.0])
    assert list(near) == ["current of motor2"]
    assert excess([watched(watch, [math.nan] * N)[name]], "limit")


def test_an_arm_that_is_enabled_beyond_a_stop_can_come_back_and_no_further() -> None:
    watch = LimitWatch(ARM, 2.5, 4.0)
    at, name = list(ARM.joints.start), "travel of joint2 from the middle of its range"
    at[1] = ARM.joints.upper[1] + 0.02
    watch.begin(np.linalg.solve(np.reshape(ARM.joint_from_motor, (N, N)), at).tolist())
    assert not excess([watched(watch, at)[name]], "limit")
    at[1] += 0.06
    assert excess([watched(watch, at)[name]], "limit")
    for angle in (ARM.joints.lower[1] - 0.02, ARM.joints.upper[1] + 0.02):  # the other stop, and the passed one again
        at[1] = angle
        assert excess([watched(watch, at)[name]], "limit")


def test_a_position_that_no_joint_has_is_an_obstacle() -> None:
    watch, theta = LimitWatch(ARM, 2.5, 4.0), [0.0] * N
    assert not watch.obstacle(theta)
    theta[0] = -76.0 / ARM.joint_from_motor[0]
    assert watch.obstacle(theta).startswith("joint1 is at -76 rad, further beyond its stops, ")


def test_an_arm_that_is_driven_into_a_stop_is_stopped() -> None:
    hardware = enabled(
        **{"driver:cover_speed_limit": 100.0, "driver:tip_speed_limit": 100.0, "arm.joints.speed_limit": [100.0] * N}
    )
    for _ in range(2000):
        hardware.command(hardware.stamp, [0.0, 0.0, 0.0, 3.0])
        hardware.advance(0.0)
        if hardware.safety.mode is Mode.FAULT:
            break
    assert hardware.safety.fault.startswith("travel of joint4 from the middle of its range is 2.0")


OWN = WAM.node("force_loop", ForceLoopParameters)


def admitted(
    admission: CommandAdmission,
    own: ForceLoopParameters = OWN,
    force: ForceCommand | None = None,
    posture: Sequence[float] | None = None,
    torque: Sequence[float] | None = None,
) -> CommandAdmission:
    admission.step(own, ForceInput(State(ARM.joints.start, [], []), DT, command=force, posture=posture, torque=torque))
    return admission


def test_a_posture_beyond_the_joint_limits_is_refused_by_name_and_the_last_one_held() -> None:
    admission = CommandAdmission(ARM.joints, ARM.covers, math.inf)
    good = [0.1, -0.5, 0.0, 0.6]
    assert admitted(admission, posture=good).posture == good
    found = admitted(admission, posture=[0.1, -2.5, 0.0, 0.6])
    assert found.posture == good
    refused = "joint2 is commanded to -2.5 rad; allowed: -2.356 to 2.356 rad"
    assert refused in sentence(found.refusals["joint_posture_command"])
    assert admitted(admission, posture=[0.1, 1e300, 0.0, 0.6]).refusals
    assert not admitted(admission, posture=list(ARM.joints.upper)).refusals
