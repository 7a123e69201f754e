"""Laws of dry friction of a rotor or joint, and their parameters.

A law is a class with the methods of `FrictionLaw`.  To add one, write it here, name it in `LAWS` and give its
parameters, if it has any, fields in `FrictionParameters` and values in ``config/``.

Presliding is Dahl's model, which drifts where a load below breakaway is joined by vibration (0.5 +- 0.3 of the
friction at 20 Hz: 0.07 rad of a rotor in 5 s); without presliding, a stuck shaft stays where it is.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import repeat
from typing import Protocol

from wam_description.parameters import each, parameter


class FrictionLaw(Protocol):
    """Dry friction of one rotor or joint.

    Attributes
    ----------
    is_steady : True if the level changes only when the shaft starts, stops or reverses; it is then not computed in
        every step.
    """

    is_steady: bool

    def level(self, velocity: float) -> float:
        """Magnitude of the friction torque, N m, not negative, at a velocity, rad/s, exactly 0 while it is stuck."""
        ...


class CoulombStiction:
    """F_s while stuck, F_d in motion (section 5.1, figure 5.1.b)."""

    is_steady = True

    def __init__(self, static: float, dynamic: float) -> None:
        self._static, self._dynamic = static, dynamic

    def level(self, velocity: float) -> float:
        """F_s or F_d, N m."""
        return self._dynamic if velocity else self._static


class Stribeck:
    """Falls from F_s to F_d with the velocity: F_d + (F_s - F_d) exp(-(|v|/v_s)^delta)."""

    is_steady = False

    def __init__(self, static: float, dynamic: float, velocity: float, exponent: float) -> None:
        self._dynamic, self._drop = dynamic, static - dynamic
        self._velocity, self._exponent = velocity, exponent

    def level(self, velocity: float) -> float:
        """Level at this velocity, N m."""
        return self._dynamic + self._drop * math.exp(-((abs(velocity) / self._velocity) ** self._exponent))


class Presliding:
    """Elastic displacement before sliding: dF/dx = sigma (1 - sgn(dx) F/level).

    With a constant level this is Dahl's model, with one that falls with the velocity LuGre's without its damping.
    The equation is integrated exactly over each displacement.  It is passive for every positive level.

    Attributes
    ----------
    torque : friction torque against positive motion, N m.
    """

    def __init__(self, stiffness: float) -> None:
        self._stiffness = stiffness
        self.torque = 0.0

    def advance(self, displacement: float, level: float) -> float:
        """Torque after a displacement, rad, with friction up to `level`, N m."""
        if level <= 0.0:
            self.torque = 0.0
        elif displacement:
            limit = math.copysign(level, displacement)
            self.torque = limit + (self.torque - limit) * math.exp(-self._stiffness * abs(displacement) / level)
        return self.torque


def each_shaft(motors: tuple[float, ...], joints: tuple[float, ...], size: int) -> list[float]:
    """Values of all motors, then of all joints, from lists that hold one value or one each."""
    return [*each(motors, size // 2), *each(joints, size // 2)]


LAWS: dict[str, Callable[[Sequence[float], Sequence[float], "FrictionParameters"], Iterable[FrictionLaw]]] = {
    "coulomb_stiction": lambda static, dynamic, given: map(CoulombStiction, static, dynamic),
    "stribeck": lambda static, dynamic, given: map(
        Stribeck,
        static,
        dynamic,
        each_shaft(given.motor_stribeck_velocity, given.joint_stribeck_velocity, len(static)),
        repeat(given.stribeck_exponent),
    ),
}


@dataclass(frozen=True)
class FrictionParameters:
    """How dry friction depends on velocity, direction and load.  A list has one value for all shafts, or one for each.

    F_s and F_d are `static_friction` and `dynamic_friction` of `arm.motors` and `arm.joints`.
    """

    aligned_with = "friction", "motors"
    law: str = parameter(
        "how static friction becomes dynamic friction; coulomb_stiction: as soon as the shaft moves; stribeck: "
        "gradually, as the velocity rises to about v_s",
        choices=tuple(LAWS),
    )
    motor_stribeck_velocity: tuple[float, ...] = parameter(
        "v_s of each motor (law stribeck)", "rad/s", low=1e-6, high=1e3, is_common=True
    )
    joint_stribeck_velocity: tuple[float, ...] = parameter(
        "v_s of each joint (law stribeck)", "rad/s", low=1e-6, high=1e3, is_common=True
    )
    stribeck_exponent: float = parameter("delta of exp(-(v/v_s)^delta) (law stribeck)", low=0.1, high=10.0)
    motor_asymmetry: tuple[float, ...] = parameter(
        "a of each motor: friction is 1 + a times as large in positive and 1 - a in negative motion",
        within=0.9,
        is_common=True,
    )
    joint_asymmetry: tuple[float, ...] = parameter("the same for each joint", within=0.9, is_common=True)
    motor_load_factor: tuple[float, ...] = parameter(
        "friction of each motor per torque that the cables transmit to it", high=0.9, is_common=True
    )
    joint_load_factor: tuple[float, ...] = parameter("the same for each joint", high=0.9, is_common=True)
    motor_presliding_stiffness: tuple[float, ...] = parameter(
        "elastic stiffness of each motor's friction before it slides; 0: it sticks rigidly",
        "N m/rad",
        is_common=True,
    )
    joint_presliding_stiffness: tuple[float, ...] = parameter("the same for each joint", "N m/rad", is_common=True)
    warm_drop: float = parameter(
        "fraction by which the dry friction of a motor is smaller when its winding is at the thermal limit; "
        "proportionally less with less heat. 0: friction does not depend on temperature",
        high=0.9,
        default=0.0,
    )


COULOMB_STICTION = FrictionParameters(
    law="coulomb_stiction",
    motor_stribeck_velocity=(1.0,),
    joint_stribeck_velocity=(1.0,),
    stribeck_exponent=2.0,
    motor_asymmetry=(0.0,),
    joint_asymmetry=(0.0,),
    motor_load_factor=(0.0,),
    joint_load_factor=(0.0,),
    motor_presliding_stiffness=(0.0,),
    joint_presliding_stiffness=(0.0,),
)
