"""Effects of the transmission besides its stiffness; each can be switched off."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from wam_description.arm import Arm
from wam_description.parameters import aligned, each, empty, parameter, require, rows
from wam_description.parts import Motors


@dataclass(frozen=True)
class Ripples:
    """Torque that depends on a shaft's angle: cogging of a motor, eccentric pulleys (6.23).

    tau = ratio amplitude sin(cycles ratio theta + phase) on the shaft.  An eccentric pulley has
    amplitude 2 epsilon T_0, (6.23), and one cycle.
    """

    shafts: tuple[str, ...] = parameter("motor or joint that turns the pulley of each ripple, directly or by a gear")
    ratio: tuple[float, ...] = parameter("turns of the pulley per turn of the shaft", within=1e3)
    amplitude: tuple[float, ...] = parameter("torque amplitude at the pulley; 0: none", "N m", high=100.0)
    cycles: tuple[int, ...] = parameter("cycles per turn of the pulley", low=1, high=1e4)
    phase: tuple[float, ...] = parameter("phase at angle zero", "rad", within=6.3)

    def __post_init__(self) -> None:
        aligned("effects.ripples", self.shafts, self)


@dataclass(frozen=True)
class Effects:
    """Which effects the plant has, and their size."""

    ripples: Ripples
    creep: bool = parameter(
        "true if cables creep on their pulleys (6.19); the creep also causes the power loss of (6.15)"
    )
    backlash: tuple[float, ...] = parameter(
        "play of each circuit at its motor, one value for all or one each; with play the circuit is a gear or shaft "
        "without pretension (2.2)",
        "rad",
        high=10.0,
        is_common=True,
    )
    slack: bool = parameter("true if a strand can become slack; false: as with infinite pretension")
    pretension_share: tuple[float, ...] = parameter(
        "active pretension (6.5) as a fraction of arm.cables.pretension, one value for all or one each; a new value "
        "acts at once",
        high=10.0,
        live=True,
        is_common=True,
    )
    tension_friction: tuple[float, ...] = parameter(
        "friction torque of bearings and cable bending at each motor, per sum of both tensions (6.5)",
        "N m/N",
        high=1.0,
    )
    included_in_friction: bool = parameter(
        "true: the friction in arm.motors is measured and includes friction by tension and ripples (7.2.2); the "
        "plant's dry friction is the rest. false: friction by tension and ripples are added",
    )
    added_coulomb_friction: tuple[float, ...] = parameter(
        "added Coulomb friction at each joint, like the Teflon rod of section 5.6", "N m", high=100.0, live=True
    )
    terminated: bool = parameter(
        "true if the cables end on both pulleys, which limits their creep (6.4.3); see docs/plant.md",
        default=False,
    )
    capstan: float = parameter(
        "friction coefficient times angle of wrap on the pinion: at tensions beyond (6.16) the whole cable slips; 0: "
        "it never slips",
        high=50.0,
        default=0.0,
    )

    def require_fit(self, arm: Arm) -> None:
        """Refuse effects that do not fit the arm, as a pretension that leaves a cable no margin up to its strength.

        The load at full torque is that for which the configured pretension was chosen, half of it on each strand.

        Raises
        ------
        ParameterError
            naming motor, value and what is allowed.
        """
        motors, cables = arm.motors.names, arm.cables
        require(
            not (self.terminated and self.capstan),
            f"effects.capstan is {self.capstan:g}, and effects.terminated is true; a cable that ends on its pulleys "
            "does not slip as a whole: set effects.capstan to 0 or effects.terminated to false",
        )
        aligned("effects", motors, self)
        shares = each(self.pretension_share, len(motors))
        for name, share, pretension, strength in zip(
            motors, shares, cables.pretension, cables.breaking_strength, strict=True
        ):
            most = max(strength / pretension - 1.0, 1.0) if pretension else math.inf
            require(
                share <= most,
                f"effects.pretension_share of {name} is {share:.4g}; allowed: up to {most:.4g}, or at full "
                f"torque its cable would be above its breaking strength, {strength:g} N",
            )

    def dry(self, arm: Arm) -> Motors:
        """The motors with the friction that is neither by tension nor a ripple.

        Raises
        ------
        ParameterError
            if `included_in_friction` and they are more than the friction of a motor.
        """
        motors = arm.motors
        if not self.included_in_friction:
            return motors
        left = []
        for i, (name, whole) in enumerate(zip(motors.names, motors.static_friction, strict=True)):
            others = self._tension_torque(arm, i) + self.ripple(name)
            require(
                others <= whole,
                f"friction by tension and ripples of {name} are {others:.4g} N m; allowed: up to its static friction, "
                f"{whole:.4g} N m, which includes them, or set driver: effects.included_in_friction: false",
            )
            left.append(1.0 - others / whole if others else 1.0)
        return _with_friction(motors, left, [0.0] * len(left))

    def smooth(self, arm: Arm) -> Motors:
        """The motors with the friction that does not depend on their angle: dry, and by the pretension."""
        motors = self.dry(arm)
        shares = each(self.pretension_share, len(motors.names))
        by_tension = [self._tension_torque(arm, i) * share for i, share in enumerate(shares)]
        return _with_friction(motors, [1.0] * len(by_tension), by_tension)

    def _tension_torque(self, arm: Arm, motor: int) -> float:
        """Friction of a motor, N m, by the whole pretension of both strands of its circuit."""
        return 2.0 * arm.cables.pretension[motor] * self.tension_friction[motor]

    def ripple(self, shaft: str) -> float:
        """Largest torque of the ripples on a motor or joint, N m."""
        return sum(abs(one.ratio * one.amplitude) for one in rows(self.ripples) if one.shaft == shaft)

    def play(self, motor: int) -> float:
        """Backlash of the circuit of this motor, rad."""
        return self.backlash[motor if len(self.backlash) > 1 else 0]


def _with_friction(motors: Motors, shares: Sequence[float], more: Sequence[float]) -> Motors:
    """Motors with these shares of their dry friction, and more of it, N m, each (n,)."""
    static, dynamic = (
        tuple(value * share + added for value, share, added in zip(values, shares, more, strict=True))
        for values in (motors.static_friction, motors.dynamic_friction)
    )
    return replace(motors, static_friction=static, dynamic_friction=dynamic)


def no_effects(arm: Arm) -> Effects:
    """An ideal transmission: elastic, and nothing else."""
    return Effects(
        ripples=empty(Ripples),
        creep=False,
        backlash=(0.0,),
        slack=False,
        pretension_share=(1.0,),
        tension_friction=(0.0,) * arm.n,
        included_in_friction=False,
        added_coulomb_friction=(0.0,) * arm.n,
    )
