"""How the true arm and its signals differ from what the estimator states, one degradation at a time and mixed.

Nothing here is read by the estimator, and nothing is read from its parameters: what it states is in the section
`contact_estimator` of the configuration, what is drawn is this table.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from wam_description.arm import Arm
from wam_studies.identification.plants import EXACT, DrawnArm, MeasuredSignals, Values


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
    arms, motors = DrawnArm(random, arm), arm.n
    stated = arms.level(0.9, 1.1) | arms.masses(0.02)
    signs = random.choice((-1.0, 1.0), motors + arm.n)
    forty = {
        "driver:mismatch.motor_friction": (1.0 + 0.4 * signs[:motors]).tolist(),
        "driver:mismatch.joint_friction": (1.0 + 0.4 * signs[motors:]).tolist(),
    }
    presliding = {
        "driver:friction.motor_presliding_stiffness": [4.0],
        "driver:friction.joint_presliding_stiffness": [500.0],
    }
    gaussian = {"driver:friction.stribeck_exponent": 2.0}  # with presliding: LuGre's model, undamped bristles
    cogging, heavy = arms.cogging(0.004), arms.masses(0.05)
    plants: dict[str, Values] = {
        "friction 0.8 to 1.3": arms.level(0.8, 1.3),
        "friction 40 %": forty,
        "asymmetric 25 %": arms.asymmetric(0.25),
        "Stribeck, F_s + 20 %": arms.stribeck(1.2),
        "presliding": presliding,
        "LuGre, F_s + 20 %": arms.stribeck(1.2) | gaussian | presliding,
        "load-dependent 6 %": _load(0.06),
        "mass 5 %, centre 5 mm": heavy,
        "payload 0.1 kg": {"driver:mismatch.payload": 0.1},
        "payload 0.3 kg": {"driver:mismatch.payload": 0.3},
        "encoder 4096": arms.encoder(4096),
        "encoder 16384": arms.encoder(16384),
        "encoder 65536": arms.encoder(65536),
        "torque noise, ripple, cogging": cogging | arms.noise(0.04),
    }
    models = {"mass 5 %, centre 5 mm": arms.centre(0.005)}
    signals = {
        "torque constant 3 %": MeasuredSignals(arms.constant(0.03)),
        "torque noise, ripple, cogging": MeasuredSignals(noise=0.01),
        "delay 2 ms": MeasuredSignals(delay=2),
        "10 % dropped": MeasuredSignals(dropped=0.1),
    }
    mix = arms.level(0.8, 1.3) | arms.stribeck(1.1) | arms.asymmetric(0.1) | _load(0.03) | arms.encoder(16384)
    mix |= arms.cogging(0.003) | arms.masses(0.02) | arms.noise(0.02)
    if name == "realistic mix":
        centre, constant = arms.centre(0.003), arms.constant(0.02)
        return Degradation(mix, centre, MeasuredSignals(constant, noise=0.005, delay=1, dropped=0.02), 0.1)
    drift = 0.2 if name == "friction drifts 20 %" else 0.0
    return Degradation(stated | plants.get(name, {}), models.get(name, {}), signals.get(name, EXACT), drift)
