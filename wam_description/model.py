"""What the controllers know of the arm: their model, apart from the plant, whose parameters are in `arm`.

The values that a configuration does not give are those of `arm`.  ``wam identify`` writes them from a recording, with
their covariance.
"""

from dataclasses import dataclass
from typing import Final

from wam_description.parameters import aligned, lengths, like, parameter, require
from wam_description.parts import Joints, Links, Motors

UNKNOWN: Final = "none"  # in place of the names of identified parameters, where there are none


@dataclass(frozen=True)
class LinkModel:
    """The links as the controllers model them; of identified ones only the base set counts."""

    mass: tuple[float, ...] = like(Links, "arm.links.mass")
    centre: tuple[float, ...] = like(Links, "arm.links.centre")
    inertia: tuple[float, ...] = like(Links, "arm.links.inertia")
    product: tuple[float, ...] = like(Links, "arm.links.product", "elements xy xz yz of the same inertia tensor")


@dataclass(frozen=True)
class MotorModel:
    """Inertia and friction of the rotors.

    Friction against positive motion v is F_d + (F_s - F_d) exp(-(v/v_s)^2) + k |tau| + b v with the torque tau that the
    cables transmit; F_d, F_s and k have a value for each direction.
    """

    inertia: tuple[float, ...] = like(Motors, "arm.motors.inertia")
    coulomb_positive: tuple[float, ...] = like(
        Motors, "arm.motors.dynamic_friction", "dynamic friction F_d in positive motion"
    )
    coulomb_negative: tuple[float, ...] = like(Motors, "arm.motors.dynamic_friction", "the same in negative motion")
    static_positive: tuple[float, ...] = like(
        Motors, "arm.motors.static_friction", "friction F_s at very low speed, in positive motion"
    )
    static_negative: tuple[float, ...] = like(Motors, "arm.motors.static_friction", "the same in negative motion")
    viscous: tuple[float, ...] = like(Motors, "arm.motors.viscous_friction", "viscous friction b")
    stribeck_velocity: tuple[float, ...] = parameter("Stribeck velocity v_s", "rad/s", low=1e-6, high=1e3)
    load_positive: tuple[float, ...] = parameter(
        "friction k per transmitted torque, in positive motion",
        high=0.9,
    )
    load_negative: tuple[float, ...] = parameter("the same in negative motion", high=0.9)


@dataclass(frozen=True)
class JointModel:
    """Pulleys and friction that a joint adds; the friction law is that of `MotorModel`, alike in both directions."""

    armature: tuple[float, ...] = like(Joints, "arm.joints.armature")
    coulomb: tuple[float, ...] = like(
        Joints,
        "arm.joints.dynamic_friction",
        "dynamic friction F_d; after the identification 0 at a joint with its own motor, because the motor's friction "
        "includes it",
    )
    static: tuple[float, ...] = like(Joints, "arm.joints.static_friction", "friction F_s at very low speed")
    viscous: tuple[float, ...] = like(Joints, "arm.joints.viscous_friction", "viscous friction b")
    stribeck_velocity: tuple[float, ...] = parameter("Stribeck velocity v_s", "rad/s", low=1e-6, high=1e3)
    load: tuple[float, ...] = parameter("friction k per transmitted torque", high=0.9)


@dataclass(frozen=True)
class ModelCovariance:
    """Covariance of what was identified."""

    parameters: tuple[str, ...] = parameter(
        "names of the identified parameters, as motors.coulomb_positive.motor1; none: nothing was identified"
    )
    values: tuple[float, ...] = parameter(
        "covariance of these parameters, row by row", "products of their units", low=-1e9
    )

    def __post_init__(self) -> None:
        count = len(self.parameters)
        lengths("model.covariance", self.parameters, {"values": self.values}, width=count)
        diagonal = self.values[:: count + 1]
        require(
            min(diagonal) >= 0.0,
            f"parameter 'model.covariance.values' has a variance of {min(diagonal):g}; give 0 or more",
        )


@dataclass(frozen=True)
class ArmModel:
    """The arm as the controllers model it."""

    links: LinkModel
    motors: MotorModel
    joints: JointModel
    covariance: ModelCovariance
    source: str = parameter("recording from which the values were identified; arm: the values are those of arm")

    def __post_init__(self) -> None:
        for name, part in (("links", self.links), ("motors", self.motors), ("joints", self.joints)):
            aligned(f"model.{name}", self.motors.inertia, part)
        pairs = {
            "motors.static_positive": (self.motors.static_positive, self.motors.coulomb_positive),
            "motors.static_negative": (self.motors.static_negative, self.motors.coulomb_negative),
            "joints.static": (self.joints.static, self.joints.coulomb),
        }
        for name, (static, coulomb) in pairs.items():
            for f_static, f_coulomb in zip(static, coulomb, strict=True):
                require(
                    f_coulomb <= f_static,
                    f"model.{name} {f_static:g} N m is below dynamic friction, {f_coulomb:g} N m",
                )

    @property
    def is_identified(self) -> bool:
        """Whether the values come from a recording, with their covariance."""
        return self.covariance.parameters != (UNKNOWN,)
