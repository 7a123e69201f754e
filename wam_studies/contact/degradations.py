"""How the true arm and its signals differ from what the estimator states, one degradation at a time and mixed.

Nothing here is read by the estimator, and nothing is read from its parameters: what it states is in the section
`contact_estimator` of the configuration, what is drawn is this table.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from wam_description.arm import Arm
from wam_studies.identification.plants import EXACT, MeasuredSignals

Values = dict[str, Any]  # of a configuration, by name


class Degradation(NamedTuple):
    """One drawn arm and its signals.

    Attributes
    ----------
    plant : values of the configuration that is simulated.
    model : values of the configuration of which the estimator has its arm.
    signals : how the torques of the motors are measured.
    drift : Coulomb friction that joints gain from the start to the end of a recording, per nominal friction.
    """

    plant: Mapping[str, Any]
    model: Mapping[str, Any] = {}
    signals: MeasuredSignals = EXACT
    drift: float = 0.0


class _DrawnArm(NamedTuple):
    """Random values of one arm, by parameter."""

    random: np.random.Generator
    arm: Arm

    def around(self, low: float, high: float, count: int) -> list[float]:
        return self.random.uniform(low, high, count).tolist()

    def each_motor(self, low: float, high: float) -> list[float]:
        return self.around(low, high, len(self.arm.motors.names))

    def level(self, low: float, high: float) -> Values:
        """Levels of friction over those configured."""
        return {
            "driver:mismatch.motor_friction": self.each_motor(low, high),
            "driver:mismatch.joint_friction": self.around(low, high, len(self.arm.joints.names)),
        }

    def stribeck(self, excess: float) -> Values:
        return {
            "driver:friction.law": "stribeck",
            "arm.motors.static_friction": [excess * f for f in self.arm.motors.static_friction],
            "arm.joints.static_friction": [excess * f for f in self.arm.joints.static_friction],
        }

    def asymmetric(self, size: float) -> Values:
        """Friction that differs by direction."""
        keys, shafts = ("motor_asymmetry", "joint_asymmetry"), len(self.arm.motors.names)
        return {f"driver:friction.{key}": (size * self.random.choice((-1.0, 1.0), shafts)).tolist() for key in keys}

    def encoder(self, counts: int) -> Values:
        return {"driver:sensors.encoder_resolution": [2.0 * math.pi / counts] * len(self.arm.motors.names)}

    def cogging(self, amplitude: float) -> Values:
        return {
            "driver:effects.ripples.amplitude": [amplitude] * len(self.arm.motors.names),
            "driver:effects.ripples.phase": self.each_motor(-math.pi, math.pi),
        }

    def masses(self, width: float) -> Values:
        return {"driver:mismatch.mass": self.around(1.0 - width, 1.0 + width, len(self.arm.links.names))}

    def centre(self, metres: float) -> Values:
        """Centres of mass of the model."""
        centre = self.arm.links.centre
        return {"arm.links.centre": np.add(centre, self.around(-metres, metres, len(centre))).tolist()}

    def constant(self, width: float) -> tuple[float, ...]:
        """Measured over true torques."""
        return tuple(self.each_motor(1.0 - width, 1.0 + width))

    def noise(self, level: float) -> Values:
        """Ripple of the torque and noise of the current."""
        each = [level] * len(self.arm.motors.names)
        return {"driver:amplifier.torque_ripple": each, "driver:amplifier.current_noise": each}


def _load(factor: float) -> Values:
    return {"driver:friction.motor_load_factor": [factor], "driver:friction.joint_load_factor": [factor]}


NAMES = (
    "as stated",
    "friction 0.8 to 1.3",
    "friction 40 %",
    "asymmetric 25 %",
    "Stribeck, F_s + 20 %",
    "presliding",
    "LuGre, F_s + 20 %",
    "load-dependent 6 %",
    "friction drifts 20 %",
    "mass 5 %, centre 5 mm",
    "torque constant 3 %",
    "payload 0.1 kg",
    "payload 0.3 kg",
    "encoder 4096",
    "encoder 16384",
    "encoder 65536",
    "torque noise, ripple, cogging",
    "delay 2 ms",
    "10 % dropped",
    "realistic mix",
)

IDENTIFIED = ("realistic mix",)  # of which arms are also identified before


def drawn(name: str, arm: Arm, random: np.random.Generator) -> Degradation:
    """The degradation of this name, its size fixed, its directions drawn.

    `as stated` draws friction within 10 % and masses within 2 %, which is what the configured estimator states.
    """
    arms, motors = _DrawnArm(random, arm), len(arm.motors.names)
    stated = arms.level(0.9, 1.1) | arms.masses(0.02)
    signs = random.choice((-1.0, 1.0), motors + len(arm.joints.names))
    forty = {
        "driver:mismatch.motor_friction": (1.0 + 0.4 * signs[:motors]).tolist(),
        "driver:mismatch.joint_friction": (1.0 + 0.4 * signs[motors:]).tolist(),
    }
    presliding = {
        "driver:friction.motor_presliding_stiffness": [4.0],
        "driver:friction.joint_presliding_stiffness": [500.0],
    }
    gaussian = {"driver:friction.stribeck_exponent": 2.0}  # with presliding: LuGre's model, undamped bristles
    noisy = stated | arms.cogging(0.004) | arms.noise(0.04)
    heavy = stated | arms.masses(0.05)
    of = {
        "as stated": Degradation(stated),
        "friction 0.8 to 1.3": Degradation(stated | arms.level(0.8, 1.3)),
        "friction 40 %": Degradation(stated | forty),
        "asymmetric 25 %": Degradation(stated | arms.asymmetric(0.25)),
        "Stribeck, F_s + 20 %": Degradation(stated | arms.stribeck(1.2)),
        "presliding": Degradation(stated | presliding),
        "LuGre, F_s + 20 %": Degradation(stated | arms.stribeck(1.2) | gaussian | presliding),
        "load-dependent 6 %": Degradation(stated | _load(0.06)),
        "friction drifts 20 %": Degradation(stated, drift=0.2),
        "mass 5 %, centre 5 mm": Degradation(heavy, arms.centre(0.005)),
        "torque constant 3 %": Degradation(stated, signals=MeasuredSignals(arms.constant(0.03))),
        "payload 0.1 kg": Degradation(stated | {"driver:mismatch.payload": 0.1}),
        "payload 0.3 kg": Degradation(stated | {"driver:mismatch.payload": 0.3}),
        "encoder 4096": Degradation(stated | arms.encoder(4096)),
        "encoder 16384": Degradation(stated | arms.encoder(16384)),
        "encoder 65536": Degradation(stated | arms.encoder(65536)),
        "torque noise, ripple, cogging": Degradation(noisy, signals=MeasuredSignals(noise=0.01)),
        "delay 2 ms": Degradation(stated, signals=MeasuredSignals(delay=2)),
        "10 % dropped": Degradation(stated, signals=MeasuredSignals(dropped=0.1)),
    }
    mix = arms.level(0.8, 1.3) | arms.stribeck(1.1) | arms.asymmetric(0.1) | _load(0.03) | arms.encoder(16384)
    mix |= arms.cogging(0.003) | arms.masses(0.02) | arms.noise(0.02)
    centre, constant = arms.centre(0.003), arms.constant(0.02)
    of["realistic mix"] = Degradation(mix, centre, MeasuredSignals(constant, noise=0.005, delay=1, dropped=0.02), 0.1)
    return of[name]
