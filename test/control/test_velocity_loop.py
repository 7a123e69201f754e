"""The inner loop on a rotor that is integrated here, against the closed form of its equation."""

import cmath

import pytest

from wam_control.velocity.dither import DitherParameters
from wam_control.velocity.servo_guard import ServoGuardParameters
from wam_control.velocity.velocity_loop import VelocityLoop, VelocityLoopParameters
from wam_description.arm import Servo
from wam_description.configuration import Configuration, packaged
from wam_description.parts import Motors

INERTIA, CONSTANT, PEAK = 4.0e-5, 0.25, 4.0
KP, KI = 0.015, 0.8
ONE = Motors(("motor1",), (INERTIA,), (CONSTANT,), (PEAK,), (1.0,), (0.0,), (0.0,), (0.0,))
STILL = DitherParameters(0.0, (0.0,))
SERVO = Servo((KP,), (KI,))
OFF = ServoGuardParameters("off", 1.0, 0, False)
OWN = VelocityLoopParameters(STILL, OFF, 1e12, 1e12)
DT = 1e-3


class Rotor:
    """Inertia under the torque of a motor and a constant load; the loop closed around it."""

    def __init__(self, load: float = 0.0, dt: float = DT, law: "VelocityLoop | Naive | None" = None) -> None:
        self.loop = law or VelocityLoop(ONE, SERVO, OWN)
        self.load, self.dt = load, dt
        self.speed = self.torque = 0.0
        self.blocked = False

    def step(self, command: list[float], feedforward: float = 0.0) -> float:
        (current,) = self.loop.step([self.speed], [self.torque], command, [feedforward], self.dt)
        self.torque = current * CONSTANT
        self.speed = 0.0 if self.blocked else self.speed + (self.torque - self.load) / INERTIA * self.dt
        return self.torque


class Naive:
    """The law without its protections: PI and clip."""

    def __init__(self) -> None:
        self.integral = 0.0

    def step(
        self, speed: list[float], _: list[float], command: list[float], feed: list[float], dt: float
    ) -> list[float]:
        self.integral += KI * (command[0] - speed[0]) * dt
        torque = KP * (command[0] - speed[0]) + self.integral + feed[0]
        return [min(max(torque, -PEAK), PEAK) / CONSTANT]


def blocked(law: VelocityLoop | Naive, command: float) -> Rotor:
    """A rotor that was blocked under a command until the law gave its peak torque."""
    rotor = Rotor(law=law)
    rotor.blocked = True
    for _ in range(500):
        rotor.step([command])
    assert rotor.torque == PEAK
    return rotor


def closed_form(time: float, command: float, surplus: float) -> float:
    """Speed error of J e'' + K_p e' + K_i e = 0 with e(0) = command and J e'(0) = -(K_p command + surplus)."""
    root = cmath.sqrt(KP * KP - 4.0 * INERTIA * KI)
    s1, s2 = (-KP + root) / (2.0 * INERTIA), (-KP - root) / (2.0 * INERTIA)
    slope = -(KP * command + surplus) / INERTIA
    a = (slope - s2 * command) / (s1 - s2)
    return (a * cmath.exp(s1 * time) + (command - a) * cmath.exp(s2 * time)).real


@pytest.mark.parametrize(("load", "feedforward"), [(0.0, 0.0), (0.3, 0.0), (0.3, 0.3), (0.0, 0.2)])
def test_speed_follows_the_closed_form_of_pi_control_with_feedforward(load: float, feedforward: float) -> None:
    dt, command = 1e-6, 50.0
    rotor = Rotor(load, dt)
    worst = 0.0
    for k in range(20_000):
        rotor.step([command], feedforward)
        error = command - rotor.speed
        worst = max(worst, abs(error - closed_form((k + 1) * dt, command, feedforward - load)))
    assert worst < 2e-3 * command
    assert abs(closed_form(0.02, command, feedforward - load)) < 0.2 * command


def test_feedforward_that_equals_the_load_keeps_the_rotor_at_rest() -> None:
    carried, fallen = Rotor(load=0.5), Rotor(load=0.5)
    for _ in range(100):
        carried.step([0.0], feedforward=0.5)
        fallen.step([0.0])
    assert carried.speed == pytest.approx(0.0, abs=1e-12)
    assert fallen.torque == pytest.approx(0.5, rel=1e-3), "the integral alone carries it in the end"


def test_a_blocked_motor_does_not_wind_up_and_recovers_at_once() -> None:
    speeds = []
    for law in (VelocityLoop(ONE, SERVO, OWN), Naive()):
        rotor = blocked(law, 400.0)
        rotor.blocked = False
        fastest = 0.0
        for _ in range(200):
            rotor.step([0.0])
            fastest = max(fastest, abs(rotor.speed))
        speeds.append(fastest)
    with_it, without = speeds
    assert with_it < 1.0
    assert without > 1000.0, "plain PI runs away after the same block: the protection is what is tested"


def test_a_motor_that_creeps_into_its_limit_leaves_it_when_the_error_turns() -> None:
    torques = []
    for law in (VelocityLoop(ONE, SERVO, OWN), Naive()):
        rotor = blocked(law, 100.0)  # 1.5 N m from K_p, the rest up to 4 N m from the integral
        torques.append([rotor.step([-1.0]) for _ in range(20)])
    with_it, without = torques
    assert with_it[0] < PEAK - KP * 100.0 + 0.1
    assert with_it == sorted(with_it, reverse=True)
    assert without == [PEAK] * 20


def test_torque_commanded_against_the_brakes_is_forgotten_when_they_release() -> None:
    braked, flowing = VelocityLoop(ONE, SERVO, OWN), VelocityLoop(ONE, SERVO, OWN)
    torque = 0.0
    for _ in range(1000):
        braked.step([0.0], [0.0], [2.0], [0.1], DT)  # commanded, but no current flows
        torque = CONSTANT * flowing.step([0.0], [torque], [2.0], [0.1], DT)[0]
    (current,) = braked.step([0.0], [0.0], [2.0], [0.1], DT)
    assert current * CONSTANT == pytest.approx(KP * 2.0 + KI * 2.0 * DT + 0.1)
    assert torque == pytest.approx(KP * 2.0 + KI * 2.0 * 1.0 + 0.1)


def test_an_empty_command_is_torque_only_and_forgets_the_integral() -> None:
    rotor = Rotor()
    rotor.blocked = True
    for _ in range(100):
        rotor.step([10.0])
    assert rotor.step([], feedforward=0.2) == pytest.approx(0.2)
    rotor.speed = 77.0
    assert rotor.step([], feedforward=-0.3) == pytest.approx(-0.3), "no feedback of velocity"
    rotor.speed = 0.0
    assert rotor.step([0.0]) == 0.0, "the integral is gone"


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_current_is_clipped_to_the_peak(sign: float) -> None:
    loop = VelocityLoop(ONE, SERVO, OWN)
    assert loop.step([0.0], [0.0], [], [sign * 100.0], DT) == [sign * PEAK / CONSTANT]
    assert loop.step([0.0], [0.0], [sign * 1e6], [0.0], DT) == [sign * PEAK / CONSTANT]


def test_motors_do_not_mix() -> None:
    motors = Configuration.load(packaged("wam")).shared.arm.motors
    kp, ki = (0.01, 0.02, 0.03, 0.04), (0.1, 0.2, 0.3, 0.4)
    loop = VelocityLoop(motors, Servo(kp, ki), OWN)
    command, speed, feed = [1.0, 2.0, 3.0, 4.0], [0.5, -0.5, 0.0, 8.0], [0.1, 0.0, -0.1, 0.2]
    currents = loop.step(speed, [0.0] * 4, command, feed, DT)
    expected = [
        (p * (c - s) + i * (c - s) * DT + f) / k
        for p, i, c, s, f, k in zip(kp, ki, command, speed, feed, motors.torque_constant, strict=True)
    ]
    assert currents == pytest.approx(expected)


def test_commanded_velocity_and_feedforward_change_no_faster_than_their_limits() -> None:
    slow = VelocityLoop(ONE, Servo((KP,), (0.0,)), VelocityLoopParameters(STILL, OFF, 500.0, 200.0))
    fast = VelocityLoop(ONE, Servo((KP,), (0.0,)), OWN)

    def torque(loop: VelocityLoop, command: list[float], feedforward: float) -> float:
        (current,) = loop.step([0.0], [1.0], command, [feedforward], DT)
        return current * CONSTANT

    assert torque(fast, [2.0], 1.0) == pytest.approx(KP * 2.0 + 1.0)
    rising = [torque(slow, [2.0], 1.0) for _ in range(7)]
    steps = [min(0.5 * k, 2.0) * KP + min(0.2 * k, 1.0) for k in range(1, 8)]
    assert rising == pytest.approx(steps)
    assert torque(slow, [2.1], 1.1) == pytest.approx(KP * 2.1 + 1.1), "a command within the limits is taken as it is"
    assert torque(slow, [], 1.1) == pytest.approx(1.1)
    assert torque(slow, [2.0], 1.1) == pytest.approx(KP * 0.5 + 1.1), "it begins at the measured velocity, 0"


def test_commanded_velocity_begins_at_the_measured_one_when_the_brakes_are_released() -> None:
    loop = VelocityLoop(ONE, Servo((KP,), (0.0,)), VelocityLoopParameters(STILL, OFF, 500.0, 1e12))
    for _ in range(10):  # braked: the commanded torque does not act
        (current,) = loop.step([0.0], [0.0], [2.0], [0.0], DT)
    assert current * CONSTANT == pytest.approx(KP * 0.5)


def test_the_integral_grows_through_the_deadband_of_an_amplifier_and_not_against_brakes() -> None:
    """A torque of exactly zero is what both give: the integral must not be wiped where it is too small to act."""
    for dead, is_moved in ((0.05, True), (10.0, False)):
        loop, torque, largest = VelocityLoop(ONE, SERVO, OWN), 0.0, 0.0
        for _ in range(400):
            (current,) = loop.step([0.0], [torque], [1.0], [0.0], DT)
            torque = current * CONSTANT if abs(current * CONSTANT) > dead else 0.0
            largest = max(largest, abs(current * CONSTANT))
        assert (torque > 0.05) is is_moved
        if not is_moved:
            assert largest < 0.05 * PEAK, "against brakes nothing winds up"
