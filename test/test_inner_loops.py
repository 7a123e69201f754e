"""Inner loops on torque, velocity and position: 2.1.2."""

import math
from dataclasses import replace

import numpy as np
import pytest

from wam_control.velocity_loop import VelocityLoop, VelocityLoopParameters
from wam_description.configuration import Configuration, packaged
from wam_experiments.figures.inner_loops import LOOPS, damped_testbed, largest_gain, period_map


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
    bare = replace(
        arm,
        cables=replace(arm.cables, damping=(0.0,)),
        motors=replace(arm.motors, viscous_friction=(0.0,)),
    )
    assert largest_gain(period_map(bare), torque.gain(bare)) < 0.05 * largest_gain(period_map(arm), torque.gain(arm))


def test_torque_loop_of_a_rotor_on_a_held_cable_by_hand() -> None:
    """U = -g k theta on J theta'' + d theta' + k theta: the half period of the hold takes g k T/2 of the damping d."""
    arm = damped_testbed()
    (circuit,), rotor = arm.circuits, arm.motors.inertia[0]
    drag = circuit.damping + arm.motors.viscous_friction[0]
    gain = largest_gain(period_map(arm), LOOPS[0].gain(arm))
    frequency = math.sqrt((1.0 + gain) * circuit.stiffness / rotor)
    by_hand = drag * frequency / math.sin(0.5e-3 * frequency) / circuit.stiffness
    assert gain == pytest.approx(by_hand, rel=0.1)
