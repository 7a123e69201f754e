"""What the covers can touch: what all of it has, what the arm can move, and what moves by itself."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from wam_description.parameters import named, parameter, require, rows

BOX = {"box": 3}  # numbers that the size of a shape needs
BODY_SHAPES = {**BOX, "cylinder": 2, "ball": 1}


class Countable:
    """Lists of which a row counts where one of its values is above 0."""

    counted_by: ClassVar[str]

    @property
    def present(self) -> list[Any]:
        """The rows that count."""
        return [one for one in rows(self) if getattr(one, self.counted_by) > 0.0]


@dataclass(frozen=True)
class Solids:
    """Solids with a name and a surface that the covers can touch, and with a size; without a shape they are boxes."""

    names: tuple[str, ...] = parameter("name of each")
    stiffness: tuple[float, ...] = parameter("k_c of the surface, where a cover touches it", "N/m", low=1.0)
    damping: tuple[float, ...] = parameter("damping of the surface, where a cover touches it", "N s/m", high=1e6)
    friction: tuple[float, ...] = parameter("coefficient of friction against the covers", high=10.0)

    def check(self, group: str, shapes: Mapping[str, int] = BOX) -> None:
        """Refuse lists that are not `named`, and sizes that are not above 0.

        Parameters
        ----------
        group : dotted name of the parameter class, for the message.
        shapes : by name, how many numbers of a size have to be above 0.
        """
        named(group, self)
        for one in rows(self):
            shape = getattr(one, "shape", "box")
            needed = one.size[: shapes[shape]]
            require(
                all(size > 0.0 for size in needed),
                f"{one.name}: {group}.sizes of a {shape} begins with {', '.join(f'{s:g}' for s in needed)} m; "
                "each must be above 0",
            )


@dataclass(frozen=True)
class FreeBodies(Solids, Countable):
    """Rigid bodies that lie, slide, roll and tip; they touch covers, obstacles, doors and each other."""

    counted_by = "mass"
    shapes: tuple[str, ...] = parameter("shape of each", choices=tuple(BODY_SHAPES))
    sizes: tuple[float, ...] = parameter(
        "three numbers each: box half lengths; cylinder radius, half length, 0; ball radius, 0, 0",
        "m",
        high=10.0,
        width=3,
    )
    positions: tuple[float, ...] = parameter(
        "centre at power-up in the base frame, x y z of each", "m", within=100.0, width=3
    )
    rotations: tuple[float, ...] = parameter(
        "rotation from the base frame at power-up, roll pitch yaw of each", "rad", within=6.3, width=3
    )
    mass: tuple[float, ...] = parameter("mass of each, uniform; 0: no body", "kg", high=1e3)
    ground_friction: tuple[float, ...] = parameter(
        "coefficient of friction against obstacles, doors and other bodies; the larger value of two bodies is used",
        high=10.0,
    )
    ground_stiffness: tuple[float, ...] = parameter(
        "stiffness of each point of contact with obstacles, doors and other bodies; a box lies on four points",
        "N/m",
        low=1.0,
    )
    ground_damping: tuple[float, ...] = parameter("damping of each such point", "N s/m", high=1e6)

    def __post_init__(self) -> None:
        self.check("world.bodies", BODY_SHAPES)


@dataclass(frozen=True)
class Doors(Solids, Countable):
    """Flat boxes on a hinge with friction and a spring; they touch covers and free bodies.

    The hinge turns about z of a frame at `positions`; at angle 0 the panel reaches along x from there.
    """

    counted_by = "mass"
    positions: tuple[float, ...] = parameter(
        "middle of the hinge in the base frame, x y z of each", "m", within=100.0, width=3
    )
    rotations: tuple[float, ...] = parameter(
        "rotation from the base frame to the hinge's, roll pitch yaw of each", "rad", within=6.3, width=3
    )
    sizes: tuple[float, ...] = parameter(
        "three half lengths each: along the panel from the hinge, across it, along the hinge",
        "m",
        high=10.0,
        width=3,
    )
    mass: tuple[float, ...] = parameter("mass of each, uniform; 0: no door", "kg", high=1e3)
    hinge_friction: tuple[float, ...] = parameter("dry friction of the hinge", "N m", high=1e3)
    hinge_damping: tuple[float, ...] = parameter("viscous friction of the hinge", "N m s/rad", high=1e4)
    spring: tuple[float, ...] = parameter("stiffness of the hinge's spring", "N m/rad", high=1e5)
    rest: tuple[float, ...] = parameter("angle at which the spring has no torque", "rad", within=6.3)
    lower: tuple[float, ...] = parameter("smallest angle of the door", "rad", within=6.3)
    upper: tuple[float, ...] = parameter("largest angle of the door", "rad", within=6.3)

    def __post_init__(self) -> None:
        self.check("world.doors")
        for one in rows(self):
            require(
                one.lower <= 0.0 <= one.upper and one.lower < one.upper,
                f"{one.name}: world.doors.lower is {one.lower:g} rad, upper {one.upper:g} rad; 0, the angle at "
                "power-up, must be between",
            )


@dataclass(frozen=True)
class Motions(Countable):
    """Given motions of obstacles: at + amplitude sin(2 pi f (t - begin)), whatever pushes against them.

    The amplitude grows smoothly during the first quarter of a period, so that nothing is hit by a velocity that jumps.
    """

    counted_by = "frequency"
    obstacles: tuple[str, ...] = parameter("obstacles that move")
    amplitude: tuple[float, ...] = parameter(
        "direction and amplitude in the base frame, x y z of each", "m", within=10.0, width=3
    )
    frequency: tuple[float, ...] = parameter("frequency; 0: no motion", "Hz", high=100.0)
    begin: tuple[float, ...] = parameter("start, since power-up", "s", high=1e6)

    def __post_init__(self) -> None:
        named("world.motions", self)


def principal_inertia(shape: str, size: Sequence[float], mass: float) -> tuple[float, float, float]:
    """Inertia of a uniform body about its centre, kg m^2, along its x, y and z.

    Parameters
    ----------
    shape : box, cylinder or ball.
    size : as `FreeBodies.sizes`, m.
    mass : kg.
    """
    if shape == "box":
        x, y, z = (s * s for s in size)
        return mass / 3.0 * (y + z), mass / 3.0 * (x + z), mass / 3.0 * (x + y)
    radius = size[0] ** 2
    if shape == "ball":
        return (0.4 * mass * radius,) * 3
    across = mass * (0.25 * radius + size[1] ** 2 / 3.0)
    return across, across, 0.5 * mass * radius
