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
    arms, motors = DrawnArm(random, arm), len(arm.motors.names)
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
