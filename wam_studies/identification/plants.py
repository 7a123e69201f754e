"""Plants that differ from the model, and what an identification has to find of them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.identification.unknowns import shared_joints
from wam_description.arm import Arm
from wam_description.configuration import Configuration
from wam_description.mismatch import true_arm
from wam_description.parameters import each
from wam_description.rigid_body import Array
from wam_driver.driver import DriverParameters

Values = dict[str, Any]  # of a configuration, by name
KINDS = ("level", "Stribeck", "asymmetry", "load", "all", "all, presliding", "all, real sensors", "all, real signals")


class MeasuredSignals(NamedTuple):
    """Errors of the measured torques.

    Attributes
    ----------
    scale : measured over true torque, of each motor or one for all.
    noise : sd of the measured torque, per torque.
    delay : samples by which measured torques are late.
    dropped : fraction of samples that do not arrive.
    """

    scale: tuple[float, ...] = (1.0,)
    noise: float = 0.0
    delay: int = 0
    dropped: float = 0.0

    def of(self, torque: Array, random: np.random.Generator) -> tuple[Array, NDArray[np.bool_]]:
        """Measured torques, (k, n), N m, of true ones, and which samples arrive, (k,)."""
        noise = 1.0 + self.noise * random.standard_normal(torque.shape)
        late = np.concatenate((np.zeros((self.delay, torque.shape[1])), torque))[: len(torque)]
        measured: Array = late * np.array(self.scale) * noise
        return measured, random.random(len(torque)) >= self.dropped


EXACT: Final = MeasuredSignals()


@dataclass(frozen=True)
class PlantRanges:
    """What is drawn of a plant, uniformly distributed; a single number is the largest error."""

    factor: tuple[float, float] = (0.8, 1.3)  # of the friction of each motor and joint
    stribeck_velocity: tuple[float, float] = (0.5, 3.0)  # rad/s, of the motors
    asymmetry: float = 0.15
    load: float = 0.06
    mass: float = 0.03
    presliding: tuple[float, float] = (4.0, 500.0)  # N m/rad, of motors and joints: a shape the regression has not
    counts: int = 16384  # of the encoder per turn
    current_noise: float = 0.02  # A
    offset: float = 0.004  # N m, of a motor's torque
    torque_constant: float = 0.02
    cogging: float = 0.003  # N m
    ripple: float = 0.02  # per torque
    centre: float = 0.003  # m, of the model's centres of mass


RANGES = PlantRanges()
SIGNALS = MeasuredSignals(noise=0.005, delay=1, dropped=0.02)


class DrawnArm(NamedTuple):
    """Random values of one arm, by parameter."""

    random: np.random.Generator
    arm: Arm

    def around(self, low: float, high: float, count: int) -> list[float]:
        """Random numbers between two ends."""
        return self.random.uniform(low, high, count).tolist()

    def each_motor(self, low: float, high: float) -> list[float]:
        """A random number between two ends for each motor."""
        return self.around(low, high, self.arm.n)

    def level(self, low: float, high: float) -> Values:
        """Levels of friction over those configured."""
        return {
            "driver:mismatch.motor_friction": self.each_motor(low, high),
            "driver:mismatch.joint_friction": self.around(low, high, self.arm.n),
        }

    def stribeck(self, excess: float) -> Values:
        """Stribeck friction with so many times the static friction."""
        return {
            "driver:friction.law": "stribeck",
            "arm.motors.static_friction": [excess * f for f in self.arm.motors.static_friction],
            "arm.joints.static_friction": [excess * f for f in self.arm.joints.static_friction],
        }

    def asymmetric(self, size: float) -> Values:
        """Friction that differs by direction."""
        keys, shafts = ("motor_asymmetry", "joint_asymmetry"), self.arm.n
        return {f"driver:friction.{key}": (size * self.random.choice((-1.0, 1.0), shafts)).tolist() for key in keys}

    def encoder(self, counts: int) -> Values:
        """Encoders of so many counts per turn."""
        return {"driver:sensors.encoder_resolution": [2.0 * math.pi / counts] * self.arm.n}

    def cogging(self, amplitude: float) -> Values:
        """Cogging of this amplitude, N m, in any phase."""
        return {
            "driver:effects.ripples.amplitude": [amplitude] * self.arm.n,
            "driver:effects.ripples.phase": self.each_motor(-math.pi, math.pi),
        }

    def masses(self, width: float) -> Values:
        """Masses within this share of those configured."""
        return {"driver:mismatch.mass": self.around(1.0 - width, 1.0 + width, self.arm.n)}

    def centre(self, metres: float) -> Values:
        """Centres of mass of the model."""
        centre = self.arm.links.centre
        return {"arm.links.centre": np.add(centre, self.around(-metres, metres, len(centre))).tolist()}

    def constant(self, width: float) -> tuple[float, ...]:
        """Torque constants: measured over true torque of each motor, within a largest error."""
        return tuple(self.each_motor(1.0 - width, 1.0 + width))

    def noise(self, level: float) -> Values:
        """Ripple of the torque and noise of the current."""
        each = [level] * self.arm.n
        return {"driver:amplifier.torque_ripple": each, "driver:amplifier.current_noise": each}


def log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    """A number between two ends, uniform in its logarithm."""
    return math.exp(random.uniform(math.log(low), math.log(high)))


def factors(random: np.random.Generator, width: float, names: Sequence[str]) -> list[float]:
    """Factors about 1 within a largest error, one for each name."""
    return (1.0 + width * random.uniform(-1.0, 1.0, len(names))).tolist()


def mismatch(random: np.random.Generator, arm: Arm, mass: float, friction: float, stiffness: float) -> Values:
    """Factors of a true arm, by parameter of `driver:mismatch`, each within a largest error."""
    return {
        "mass": factors(random, mass, arm.links.names),
        "motor_friction": factors(random, friction, arm.motors.names),
        "joint_friction": factors(random, friction, arm.joints.names),
        "stiffness": factors(random, stiffness, arm.motors.names),
    }


def drawn_cover(share: float, beyond_first: float, covers: int) -> int:
    """Index of the touched cover for a number from 0 to 1, of which a part is not the first one's."""
    return 1 + int(share / beyond_first * (covers - 1)) if share < beyond_first and covers > 1 else 0


class TrueFriction(NamedTuple):
    """Friction of the motors, with that of joints with a motor of their own, (n,) each; by direction (2, n)."""

    coulomb: Array  # without link load; less the torque offset of the motor in positive motion, N m
    at_joint: Array  # friction of the joints among it, which the cables transmit and which is a load, too, N m
    drop: Array  # F_s - F_c, N m
    load: Array
    viscous: Array  # N m s/rad
    stribeck_velocity: Array  # rad/s

    def level(self, way: int, speed: float, load: Array, moves: NDArray[np.bool_]) -> Array:
        """Mean friction of each motor, (n,), N m, in a direction at a speed, rad/s.

        Parameters
        ----------
        way : 0 positive, 1 negative.
        load : (k, n), transmitted torque apart from the friction of own joints, N m.
        moves : (k, n), where a motor moves in this direction.
        """
        sign = 1.0 - 2.0 * way
        transmitted = np.abs(load + sign * self.at_joint[way])
        mean = (transmitted * moves).sum(0) / moves.sum(0)
        slow = np.exp(-((speed / self.stribeck_velocity) ** 2))
        return self.coulomb[way] + self.drop[way] * slow + self.load[way] * mean + self.viscous * speed


def plant(configuration: Configuration, kind: str, seed: int) -> Configuration:
    """A plant of a kind, drawn from a seed; the controllers' model stays as it is."""
    shared, random = configuration.shared, np.random.Generator(np.random.PCG64([seed, KINDS.index(kind)]))
    arms, n = DrawnArm(random, shared.arm), shared.arm.n
    values = {"arm.joint_sensors": False, **arms.level(*RANGES.factor)}  # the sensors are not used here
    every = kind.startswith("all")
    if every or kind == "Stribeck":
        values["driver:friction.law"] = "stribeck"
        values["driver:friction.motor_stribeck_velocity"] = arms.each_motor(*RANGES.stribeck_velocity)
    for name, low, high in (("asymmetry", -RANGES.asymmetry, RANGES.asymmetry), ("load_factor", 0.0, RANGES.load)):
        if every or name.startswith(kind):
            values |= {f"driver:friction.{shaft}_{name}": arms.each_motor(low, high) for shaft in ("motor", "joint")}
    if every:
        values |= arms.masses(RANGES.mass)
    if kind == "all, presliding":
        stiffness = zip(("motor", "joint"), RANGES.presliding, strict=True)
        values |= {f"driver:friction.{shaft}_presliding_stiffness": [each] for shaft, each in stiffness}
    if kind in ("all, real sensors", "all, real signals"):
        values |= arms.encoder(RANGES.counts)
        values["driver:amplifier.current_noise"] = [RANGES.current_noise] * n
        values["driver:amplifier.torque_offset"] = arms.each_motor(-RANGES.offset, RANGES.offset)
    if kind == "all, real signals":
        centre = shared.model.links.centre
        values |= {
            "driver:mismatch.torque_constant": list(arms.constant(RANGES.torque_constant)),
            "driver:amplifier.torque_ripple": [RANGES.ripple] * n,
            **arms.cogging(RANGES.cogging),
            "model.links.centre": np.add(centre, arms.around(-RANGES.centre, RANGES.centre, len(centre))).tolist(),
        }
    return configuration.with_values(values)


def measured_signals(kind: str) -> MeasuredSignals:
    """How the torques of a kind of plant are measured."""
    return SIGNALS if kind == "all, real signals" else EXACT


def true_friction(configuration: Configuration) -> TrueFriction:
    """What the motors of a plant resist with, as far as their reported torques show it."""
    driver = configuration.node("driver", DriverParameters)
    shared, law = configuration.shared, driver.friction
    arm = true_arm(shared.arm, driver.mismatch)
    matrix = arm.transmission.joint_from_motor
    n = len(matrix)
    own = np.abs(matrix) * [[j not in shared_joints(matrix)] for j in range(n)]
    lean, joint_lean = _each(law.motor_asymmetry, n), _each(law.joint_asymmetry, n)
    load, joint_load = _each(law.motor_load_factor, n), _each(law.joint_load_factor, n)
    motors, offset = driver.effects.dry(arm), np.array(driver.amplifier.torque_offset)
    coulomb, joint_coulomb = np.array(motors.dynamic_friction), np.array(arm.joints.dynamic_friction)
    drop = np.subtract(motors.static_friction, coulomb) * (law.law == "stribeck")
    # alike in both directions; ripples average out in motion
    by_tension = np.subtract(driver.effects.smooth(arm).dynamic_friction, coulomb)
    signs = np.array([1.0, -1.0])[:, None]
    # of an asymmetric joint: a torque that does not change with its direction, in each direction of the motor
    constant = matrix.T @ (joint_lean * joint_coulomb)
    at_joint = own.T @ joint_coulomb + signs * ((own.T * np.sign(matrix.T)) @ (joint_lean * joint_coulomb))
    factor = load * (1.0 + signs * lean) + (own.T > 0.0) @ joint_load
    factor += signs * (np.sign(own.T * matrix.T) @ (joint_lean * joint_load))
    at_motor = coulomb * (1.0 + signs * lean) + by_tension + own.T @ joint_coulomb + signs * (constant - offset)
    # torques are reported with the torque constants as configured
    scale = 1.0 / np.array(driver.mismatch.torque_constant)
    return TrueFriction(
        scale * at_motor,
        scale * at_joint,
        scale * (drop * (1.0 + signs * lean)),
        factor,
        scale * (np.array(arm.motors.viscous_friction) + (own**2).T @ arm.joints.viscous_friction),
        _each(law.motor_stribeck_velocity, n),
    )


def _each(values: tuple[float, ...], n: int) -> Array:
    return np.array(each(values, n))
