"""How the true arm and its signals differ from what the estimator states, one degradation at a time and mixed.

Nothing here is read by the estimator, and nothing is read from its parameters: what it states is in the section
`contact_estimator` of the configuration, what is drawn is this table.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from wam_description.arm import Arm
from wam_studies.identification.plants import EXACT, MeasuredSignals

Random = np.random.Generator
Values = tuple[tuple[str, Any], ...]  # of a configuration, by name
TURN = 2.0 * math.pi


class Degradation(NamedTuple):
    """One drawn arm and its signals.

    Attributes
    ----------
    plant : values of the configuration that is simulated.
    model : values of the configuration of which the estimator has its arm.
    signals : how the torques of the motors are measured.
    drift : Coulomb friction that joints gain from the start to the end of a recording, per nominal friction.
    """

    plant: Values
    model: Values = ()
    signals: MeasuredSignals = EXACT
    drift: float = 0.0


def _degraded(
    plant: dict[str, Any], model: dict[str, Any] | None = None, drift: float = 0.0, **signals: Any
) -> Degradation:
    return Degradation(tuple(plant.items()), tuple((model or {}).items()), MeasuredSignals(**signals), drift)


def _around(random: Random, low: float, high: float, count: int) -> list[float]:
    return random.uniform(low, high, count).tolist()


def _level(random: Random, arm: Arm, low: float, high: float) -> dict[str, Any]:
    return {
        "driver:mismatch.motor_friction": _around(random, low, high, len(arm.motors.names)),
        "driver:mismatch.joint_friction": _around(random, low, high, len(arm.joints.names)),
    }


def _stribeck(arm: Arm, excess: float) -> dict[str, Any]:
    return {
        "driver:friction.law": "stribeck",
        "arm.motors.static_friction": [excess * f for f in arm.motors.static_friction],
        "arm.joints.static_friction": [excess * f for f in arm.joints.static_friction],
    }


def _asymmetric(random: Random, arm: Arm, size: float) -> dict[str, Any]:
    keys, shafts = ("motor_asymmetry", "joint_asymmetry"), len(arm.motors.names)
    return {f"driver:friction.{key}": (size * random.choice((-1.0, 1.0), shafts)).tolist() for key in keys}


def _load(factor: float) -> dict[str, Any]:
    return {"driver:friction.motor_load_factor": [factor], "driver:friction.joint_load_factor": [factor]}


def _encoder(arm: Arm, counts: int) -> dict[str, Any]:
    return {"driver:sensors.encoder_resolution": [TURN / counts] * len(arm.motors.names)}


def _cogging(random: Random, arm: Arm, amplitude: float) -> dict[str, Any]:
    motors = len(arm.motors.names)
    return {
        "driver:effects.ripples.amplitude": [amplitude] * motors,
        "driver:effects.ripples.phase": _around(random, -math.pi, math.pi, motors),
    }


def _masses(random: Random, arm: Arm, width: float) -> dict[str, Any]:
    return {"driver:mismatch.mass": _around(random, 1.0 - width, 1.0 + width, len(arm.links.names))}


def _centre(random: Random, arm: Arm, metres: float) -> dict[str, Any]:
    return {
        "arm.links.centre": (
            np.array(arm.links.centre) + random.uniform(-metres, metres, len(arm.links.centre))
        ).tolist()
    }


def _constant(random: Random, arm: Arm, width: float) -> tuple[float, ...]:
    return tuple(_around(random, 1.0 - width, 1.0 + width, len(arm.motors.names)))


def _noise(arm: Arm, ripple: float, noise: float) -> dict[str, Any]:
    motors = len(arm.motors.names)
    return {"driver:amplifier.torque_ripple": [ripple] * motors, "driver:amplifier.current_noise": [noise] * motors}


def _mix(random: Random, arm: Arm) -> Degradation:
    plant = {
        **_level(random, arm, 0.8, 1.3),
        **_stribeck(arm, 1.1),
        **_asymmetric(random, arm, 0.1),
        **_load(0.03),
        **_encoder(arm, 16384),
        **_cogging(random, arm, 0.003),
        **_masses(random, arm, 0.02),
        **_noise(arm, 0.02, 0.02),
    }
    return _degraded(
        plant,
        _centre(random, arm, 0.003),
        scale=_constant(random, arm, 0.02),
        noise=0.005,
        delay=1,
        dropped=0.02,
        drift=0.1,
    )


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


def drawn(name: str, arm: Arm, random: Random) -> Degradation:
    """The degradation of this name, its size fixed, its directions drawn.

    `as stated` draws friction within 10 % and masses within 2 %, which is what the configured estimator states.
    """
    stated = {**_level(random, arm, 0.9, 1.1), **_masses(random, arm, 0.02)}
    motors = len(arm.motors.names)
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
    noisy = {**stated, **_cogging(random, arm, 0.004), **_noise(arm, 0.04, 0.04)}
    heavy = {**stated, **_masses(random, arm, 0.05)}
    of = {
        "as stated": _degraded(stated),
        "friction 0.8 to 1.3": _degraded({**stated, **_level(random, arm, 0.8, 1.3)}),
        "friction 40 %": _degraded({**stated, **forty}),
        "asymmetric 25 %": _degraded({**stated, **_asymmetric(random, arm, 0.25)}),
        "Stribeck, F_s + 20 %": _degraded({**stated, **_stribeck(arm, 1.2)}),
        "presliding": _degraded({**stated, **presliding}),
        "LuGre, F_s + 20 %": _degraded({**stated, **_stribeck(arm, 1.2), **gaussian, **presliding}),
        "load-dependent 6 %": _degraded({**stated, **_load(0.06)}),
        "friction drifts 20 %": _degraded(stated, drift=0.2),
        "mass 5 %, centre 5 mm": _degraded(heavy, _centre(random, arm, 0.005)),
        "torque constant 3 %": _degraded(stated, scale=_constant(random, arm, 0.03)),
        "payload 0.1 kg": _degraded({**stated, "driver:mismatch.payload": 0.1}),
        "payload 0.3 kg": _degraded({**stated, "driver:mismatch.payload": 0.3}),
        "encoder 4096": _degraded({**stated, **_encoder(arm, 4096)}),
        "encoder 16384": _degraded({**stated, **_encoder(arm, 16384)}),
        "encoder 65536": _degraded({**stated, **_encoder(arm, 65536)}),
        "torque noise, ripple, cogging": _degraded(noisy, noise=0.01),
        "delay 2 ms": _degraded(stated, delay=2),
        "10 % dropped": _degraded(stated, dropped=0.1),
        "realistic mix": _mix(random, arm),
    }
    return of[name]
