"""Inner loops on torque, velocity and position: 2.1.2."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wam_bag.bag import WrenchColumns, read
from wam_control.task.scenario import ScenarioStep
from wam_control.velocity.position_loop import PositionLoop
from wam_control.velocity.torque_loop import TorqueLoop, TorqueLoopNode, TorqueLoopParameters
from wam_control.velocity.velocity_loop import VelocityLoop, VelocityLoopParameters
from wam_description.arm import Servo
from wam_description.configuration import Configuration, packaged
from wam_description.signals import ForceCommand, State
from wam_description.wiring import Inputs
from wam_sim.replay import replay
from wam_sim.simulated_bag import record
from wam_studies.figures.inner_loops import LOOPS, damped_testbed, largest_gain, on_position, on_torque, period_map
from wam_studies.plant.ideal_testbed import link_inertia


def test_velocity_loop_with_an_integral_is_a_position_loop() -> None:
    """K_i times the integral of the velocity error is a spring to the integral of the commanded velocity."""
    configuration = Configuration.load(packaged("testbed"))
    motors, servo = configuration.shared.arm.motors, configuration.shared.servo
    own = replace(configuration.node("velocity_loop", VelocityLoopParameters), acceleration_limit=1e12)
    loop, random = VelocityLoop(motors, servo, own), np.random.default_rng(2)
    dt, reference, angle = 1e-3, 0.0, 0.0
    for _ in range(200):
        wanted, speed = random.uniform(-0.5, 0.5, 2).tolist()
        reference, angle = reference + wanted * dt, angle + speed * dt
        (current,) = loop.step([speed], [1.0], [wanted], [0.0], dt)
        spring = servo.integral_gain[0] * (reference - angle)
        torque = spring + servo.proportional_gain[0] * (wanted - speed)
        assert current * motors.torque_constant[0] == pytest.approx(torque, rel=1e-9, abs=1e-12)


def test_dynamics_between_motor_and_sensor_limit_the_torque_loop_and_not_the_velocity_loop() -> None:
    """The margin is where a sampled root crosses the unit circle; an undamped cable leaves the torque loop none."""
    torque, velocity = LOOPS
    soft, stiff = damped_testbed(0.5), damped_testbed(2.0)
    ratios = [
        largest_gain(period_map(stiff), loop.gain(stiff)) / largest_gain(period_map(soft), loop.gain(soft))
        for loop in (torque, velocity)
    ]
    assert ratios[0] < 0.3
    assert ratios[1] == pytest.approx(1.0, abs=0.05)
    arm = damped_testbed()
    bare = replace(arm, cables=replace(arm.cables, damping=(0.0,)), motors=replace(arm.motors, viscous_friction=(0.0,)))
    assert largest_gain(period_map(bare), torque.gain(bare)) < 0.05 * largest_gain(period_map(arm), torque.gain(arm))


@pytest.mark.slow
def test_torque_loop_of_a_rotor_on_a_held_cable_by_hand() -> None:
    """U = -g (k theta + e theta'), late by half a period of the hold, on J theta'' + (d + b) theta' + k theta.

    The gauge also reads the friction of the joint, whose link moves J N^2/J_l as far as the rotor: that is in e.
    """
    arm = damped_testbed()
    (circuit,), rotor = arm.circuits, arm.motors.inertia[0]
    k, d = circuit.stiffness, circuit.damping
    e = d + arm.joints.viscous_friction[0] * rotor / link_inertia(arm)
    by_hand = 0.0
    for _ in range(100):
        frequency = math.sqrt(k * (1.0 + by_hand) / rotor)
        late = 0.5e-3 * frequency
        taken = k * math.sin(late) - e * frequency * math.cos(late)
        by_hand = (d + arm.motors.viscous_friction[0]) * frequency / taken
    gain = largest_gain(period_map(arm), LOOPS[0].gain(arm))
    assert gain == pytest.approx(by_hand, rel=0.05)


def test_nodes_have_the_laws_of_the_theory() -> None:
    """Their torque at a small state, which is the motor's angle and speed with the link held."""
    arm, servo, small = damped_testbed(), Servo((0.02,), (2.0,)), 1e-3
    constant, (circuit,) = arm.motors.torque_constant[0], arm.circuits
    for index in (0, 2):
        state = np.zeros(4)
        state[index] = small
        loop = PositionLoop(arm.motors, servo)
        loop.step(State([0.0], [0.0], [1.0]), [0.0], [0.0], 1e-3)
        (current,) = loop.step(State([float(state[0])], [float(state[2])], [1.0]), [0.0], [0.0], 1e-3)
        assert current * constant == pytest.approx(-float(on_position(servo) @ state), rel=1e-9)
        gauge = circuit.stiffness * state[0] + circuit.damping * state[2]
        (current,) = TorqueLoop(arm.motors, [1.0]).step([gauge], [0.0])
        assert current * constant == pytest.approx(-float(on_torque(arm) @ state), rel=1e-9)


def test_reference_of_the_position_loop_is_no_further_than_peak_torque_holds_and_at_the_motor_with_brakes() -> None:
    arm = damped_testbed()
    loop, peak = PositionLoop(arm.motors, Servo((0.0,), (2.0,))), arm.motors.peak_torque[0]

    def torque(effort: float, command: float) -> float:
        (current,) = loop.step(State([0.0], [0.0], [effort]), [command], [0.0], 1e-3)
        return current * arm.motors.torque_constant[0]

    for _ in range(1000):
        held = torque(1.0, 1.0)
    assert held == pytest.approx(2.0), "the angle that was commanded, at 2 N m/rad"
    for _ in range(5000):
        held = torque(1.0, 10.0)
    assert held == pytest.approx(peak)
    assert torque(1.0, -10.0) == pytest.approx(peak - 2.0 * 10.0 * 1e-3), "it turns back at once"
    assert abs(torque(0.0, 0.0)) < 1e-9, "brakes"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["torque-loop", "position-loop"])
def test_either_loop_presses_in_the_stack_and_is_replayed_bit_for_bit(name: str, tmp_path: Path) -> None:
    configuration = Configuration.load(packaged(name)).with_values({"timing.outer_divisor": 5})
    steps = [ScenarioStep("press", 0.6, request="enable", force=ForceCommand("link", (0.0, -10.0, 0.0)))]
    assert record(configuration, steps, tmp_path / "bag") == ""
    true = read(tmp_path / "bag").topics["/wam/sim/contact/wrench"]
    assert isinstance(true, WrenchColumns)
    assert np.linalg.norm(true.force[-1]) == pytest.approx({"torque-loop": 10.0, "position-loop": 8.1}[name], abs=0.5)
    (entry,) = (each for each in configuration.shared.nodes if ":" in each)
    found = replay(tmp_path / "bag", entry)
    assert found.is_same
    assert found.topics[0].compared > 500


def test_a_torque_loop_reports_a_velocity_which_it_does_not_control() -> None:
    configuration = Configuration.load(packaged("torque-loop"))
    node = TorqueLoopNode(configuration.shared, configuration.node("torque_loop", TorqueLoopParameters))
    values = {
        "motor_states": (1, State([0.0], [0.0], [1.0])),
        "joint_sensors": (1, State([0.0], [0.0], [1.4])),
        "motor_velocity_command": (1, State([], [], [])),
        "motor_effort_command": (1, State([], [], [0.1])),
    }
    (current,) = node.step(Inputs.of(1, 1e-3, values))["motor_current_command"].effort
    assert current * configuration.shared.arm.motors.torque_constant[0] == pytest.approx(0.1)
    assert not node.refusals
    node.step(Inputs.of(1, 1e-3, {**values, "motor_velocity_command": (1, State([], [0.5], []))}))
    assert "set force_loop:mode open_loop" in node.refusals["motor_velocity_command"]
