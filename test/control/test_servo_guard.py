"""The guard of the velocity loop against MuJoCo: what it calls stable rests, what it refuses oscillates."""

import re
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from wam_control.velocity.servo_guard import ServoGuard, ServoGuardParameters
from wam_control.velocity.velocity_loop import VelocityLoop, VelocityLoopParameters
from wam_description.arm import Arm, Servo
from wam_description.configuration import Configuration, packaged
from wam_description.effects import no_effects
from wam_description.parameters import ParameterError
from wam_description.world import NO_SPRINGS, Obstacles, World
from wam_driver.plant import Plant
from wam_theory.velocity_servo import is_stable, largest_scale, locked_rotors, servo_period

WAM, TESTBED = (Configuration.load(packaged(name)) for name in ("wam", "testbed"))
GUARD = ServoGuardParameters("refuse", 1.0, 1, False)
EMPTY = World(Obstacles((), (), (), (), (), (), (), (), ()), NO_SPRINGS)


def smooth(arm: Arm, held: bool = False) -> Arm:
    """The arm without dry friction and weight, so that MuJoCo is linear near rest; `held`: with heavy links."""
    none = (0.0,) * arm.n
    heavy = (1e3,) * len(none) if held else arm.joints.armature
    return replace(
        arm,
        motors=replace(arm.motors, static_friction=none, dynamic_friction=none),
        joints=replace(arm.joints, static_friction=none, dynamic_friction=none, armature=heavy),
        gravity=(0.0, 0.0, 0.0),
    )


class SampledPlant:
    """MuJoCo under the velocity loop itself, as a function of its state from period to period."""

    def __init__(
        self, configuration: Configuration, held: bool, delay: int, by_difference: bool, substeps: int
    ) -> None:
        shared = configuration.shared
        self.arm, self._timing = smooth(shared.arm, held), shared.timing
        self.plant = Plant(self.arm, EMPTY, no_effects(self.arm), shared.timing.period / substeps)
        self.plant.brake(False)
        self._own = configuration.node("velocity_loop", VelocityLoopParameters)
        self._n, self._substeps = self.arm.n, substeps
        self._delay, self._by_difference = delay, by_difference
        self.rest = np.concatenate([self.plant.data.qpos, np.zeros(2 * self._n)])

    def period(self, state: np.ndarray, servo: Servo) -> np.ndarray:
        """State after a period: MuJoCo's, integrals, angles before, torques still to be used."""
        n, data = self._n, self.plant.data
        mechanism, (integral, before, *late) = state[: 4 * n], np.reshape(state[4 * n :], (-1, n))
        data.qpos[:], data.qvel[:] = self.rest[: 2 * n] + mechanism[: 2 * n], mechanism[2 * n :]
        loop = VelocityLoop(self.arm.motors, servo, self._own)
        loop._integral = integral.tolist()
        speed = (mechanism[:n] - before) / self._timing.period if self._by_difference else mechanism[2 * n : 3 * n]
        currents = loop.step(speed.tolist(), [1.0] * n, [0.0] * n, [0.0] * n, self._timing.period)
        torques = [*late, np.array(currents) * self.arm.motors.torque_constant]
        for _ in range(self._substeps):
            self.plant.step(torques[0].tolist())
        after = np.concatenate([data.qpos - self.rest[: 2 * n], data.qvel])
        return np.concatenate([after, loop._integral, mechanism[:n], *torques[1:]])

    def map(self, servo: Servo) -> np.ndarray:
        """Its Jacobian at rest, by central differences."""
        size, step = (6 + self._delay) * self._n, 1e-7
        return np.column_stack(
            [(self.period(step * e, servo) - self.period(-step * e, servo)) / (2.0 * step) for e in np.eye(size)]
        )


def scaled(servo: Servo, scale: float) -> Servo:
    return Servo(*(tuple(scale * gain for gain in gains) for gains in vars(servo).values()))


def grows(plant: SampledPlant, servo: Servo) -> bool:
    """Whether a mode of MuJoCo's map grows; differences of a free arm's position show 1 within 1e-6."""
    return bool(np.abs(np.linalg.eigvals(plant.map(servo))).max() > 1.0 + 1e-5)


def predicted_limit(configuration: Configuration, held: bool, delay: int, by_difference: bool) -> Servo:
    """The configured gains, scaled to the limit that the guard computes."""
    shared = configuration.shared
    guard = ServoGuard(shared.arm, shared.timing, replace(GUARD, velocity_by_difference=by_difference))
    (mechanism,) = (m for m in guard._mechanisms if held == ("held" in m.what) and "joints at 0" not in m.what)
    gains = np.array([shared.servo.proportional_gain, shared.servo.integral_gain])
    scale = largest_scale(lambda scale: is_stable(guard._period(mechanism, *(scale * gains), delay)), 100.0)
    return scaled(shared.servo, scale)


@pytest.mark.slow
@pytest.mark.parametrize("configuration", [WAM, TESTBED], ids=["wam", "testbed"])
@pytest.mark.parametrize(("held", "delay", "by_difference"), product((False, True), (0, 1), (True,)))
def test_predicted_limit_is_that_of_mujocos_own_linearisation(
    configuration: Configuration, held: bool, delay: int, by_difference: bool
) -> None:
    limit = predicted_limit(configuration, held, delay, by_difference)
    plant = SampledPlant(configuration, held, delay, by_difference, substeps=100)
    assert not grows(plant, scaled(limit, 0.97))
    assert grows(plant, scaled(limit, 1.03))


@pytest.mark.parametrize("configuration", [WAM, TESTBED], ids=["wam", "testbed"])
@pytest.mark.parametrize(("held", "delay"), product((False, True), (0, 1)))
def test_the_plants_configured_step_shifts_the_limit_by_less_than_the_fraction(
    configuration: Configuration, held: bool, delay: int
) -> None:
    limit = predicted_limit(configuration, held, delay, False)
    plant = SampledPlant(configuration, held, delay, False, configuration.shared.timing.substeps)
    own = configuration.node("velocity_loop", VelocityLoopParameters).guard
    assert not grows(plant, scaled(limit, own.stability_fraction))
    assert grows(plant, scaled(limit, 1.03))


def test_a_rotor_alone_is_stable_up_to_two_inertias_per_period_and_up_to_one_if_late() -> None:
    free = locked_rotors((4e-5,), (0.0,), (0.0,), (0.0,))
    inlet = np.array([[0.0], [1.0 / 4e-5]])
    for delay, limit in ((0, 2.0), (1, 1.0)):
        for share in (0.99, 1.01):
            found = servo_period(free, inlet, (share * limit * 4e-5 / 1e-3,), (0.0,), 1e-3, delay, False)
            assert is_stable(found) is (share < 1.0)


def guard_of(configuration: Configuration) -> ServoGuard:
    shared = configuration.shared
    return ServoGuard(shared.arm, shared.timing, configuration.node("velocity_loop", VelocityLoopParameters).guard)


@pytest.mark.slow
@pytest.mark.parametrize("configuration", [WAM, TESTBED], ids=["wam", "testbed"])
@pytest.mark.parametrize(("mode", "proportional", "integral"), [
    ("realtime", 8.0, 1.0), ("lockstep", 8.0, 1.0), ("lockstep", 1.0, 500.0), ("realtime", 1e6, 1e8),
])  # fmt: skip
def test_a_refusal_names_gains_that_are_accepted(
    configuration: Configuration, mode: str, proportional: float, integral: float
) -> None:
    configuration = configuration.with_values({"timing.mode": mode})
    guard, servo = guard_of(configuration), configuration.shared.servo
    guard.require_stable(servo)
    wild = Servo(
        tuple(proportional * gain for gain in servo.proportional_gain),
        tuple(integral * gain for gain in servo.integral_gain),
    )
    with pytest.raises(ParameterError, match="is not stable: an oscillation grows") as refusal:
        guard.require_stable(wild)
    ways = str(refusal.value).partition("allowed: ")[2].split(", or ")
    for way in ways:
        named = {name: tuple(float(x) for x in text.split(", ")) for name, text in GAINS.findall(way)}
        if "integral_gain 0" in way:
            named["integral_gain"] = (0.0,) * len(wild.integral_gain)
        guard.require_stable(replace(wild, **named))
        most = {name: tuple(1.02 * gain for gain in gains) for name, gains in named.items()}
        with pytest.raises(ParameterError):
            guard.require_stable(replace(wild, **most))


GAINS = re.compile(r"servo\.(\w+) up to \[([^]]*)\]")


@pytest.mark.parametrize("configuration", [WAM, TESTBED], ids=["wam", "testbed"])
@pytest.mark.parametrize(("proportional", "integral"), [(0.0, 0.0), (0.0, 50.0), (1e-6, 1.0)])
def test_gains_that_hold_nothing_are_refused_with_the_least_that_is_allowed(
    configuration: Configuration, proportional: float, integral: float
) -> None:
    guard, n = guard_of(configuration), configuration.shared.arm.n
    with pytest.raises(ParameterError, match=r"arm: motor1 at .* rad/s.* allowed: at least \[") as refusal:
        guard.require_stable(Servo((proportional,) * n, (integral,) * n))
    named = str(refusal.value).rpartition("at least [")[2].partition("]")[0]
    least = tuple(float(each) for each in named.split(", "))
    guard.require_stable(Servo(least, (0.0,) * n))
    with pytest.raises(ParameterError, match="cannot hold the arm"):
        guard.require_stable(Servo(tuple(0.98 * each for each in least), (0.0,) * n))


@pytest.mark.parametrize(("proportional", "integral"), [(9e-4, 1.0), (1e-3, 50.0)])
def test_a_large_integral_gain_on_gains_that_hardly_brake_is_refused(proportional: float, integral: float) -> None:
    """The integral of the velocity is a spring: with little damping the arm swings on it for long."""
    guard = guard_of(WAM)
    with pytest.raises(ParameterError, match=r"hardly decays.*allowed: servo.integral_gain up to \[") as refusal:
        guard.require_stable(Servo((proportional,) * 4, (integral,) * 4))
    named = str(refusal.value).rpartition("integral_gain up to [")[2].partition("]")[0]
    guard.require_stable(Servo((proportional,) * 4, tuple(float(each) for each in named.split(", "))))


def test_gains_are_taken_where_the_guard_is_off() -> None:
    off = WAM.with_values({"velocity_loop:guard.mode": "off"})
    guard_of(off).require_stable(scaled(off.shared.servo, 100.0))
