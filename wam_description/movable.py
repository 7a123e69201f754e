"""What the arm can move, and what moves by itself: free bodies, doors, moving obstacles."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from wam_description.parameters import lengths, parameter, require

BODY_SHAPES = {"box": 3, "cylinder": 2, "ball": 1}  # numbers that the size of each needs


@dataclass(frozen=True)
class FreeBodies:
    """Rigid bodies that lie, slide, roll and tip; they touch covers, obstacles, doors and each other."""

    names: tuple[str, ...] = parameter("names of the free bodies")
    shapes: tuple[str, ...] = parameter("shape of each", choices=tuple(BODY_SHAPES))
    sizes: tuple[float, ...] = parameter(
        "three numbers each: box half lengths; cylinder radius, half length, 0; ball radius, 0, 0",
        "m",
        low=0.0,
        high=10.0,
    )
    positions: tuple[float, ...] = parameter(
        "centre at power-up in the base frame, x y z of each", "m", low=-100.0, high=100.0
    )
    rotations: tuple[float, ...] = parameter(
        "rotation from the base frame at power-up, roll pitch yaw of each", "rad", low=-6.3, high=6.3
    )
    mass: tuple[float, ...] = parameter("mass of each, uniform; 0: no body", "kg", low=0.0, high=1e3)
    friction: tuple[float, ...] = parameter("coefficient of friction against the covers", low=0.0, high=10.0)
    ground_friction: tuple[float, ...] = parameter(
        "coefficient of friction against obstacles, doors and other bodies; of two bodies the larger one counts",
        low=0.0,
        high=10.0,
    )
    ground_stiffness: tuple[float, ...] = parameter(
        "stiffness of each point of contact with obstacles, doors and other bodies; a box lies on four",
        "N/m",
        low=1.0,
        high=1e9,
    )
    ground_damping: tuple[float, ...] = parameter("damping of each such point", "N s/m", low=0.0, high=1e6)
    stiffness: tuple[float, ...] = parameter("k_c of the surface, where a cover touches it", "N/m", low=1.0, high=1e9)
    damping: tuple[float, ...] = parameter(
        "damping of the surface, where a cover touches it", "N s/m", low=0.0, high=1e6
    )

    def __post_init__(self) -> None:
        three = ("sizes", "positions", "rotations")
        _aligned("world.bodies", self.names, vars(self), three)
        known = ", ".join(BODY_SHAPES)
        for i, (name, shape) in enumerate(zip(self.names, self.shapes, strict=True)):
            require(shape in BODY_SHAPES, f"{name}: world.bodies.shapes is '{shape}'; allowed: {known}")
            _positive(name, f"world.bodies.sizes of a {shape}", self.sizes[3 * i : 3 * i + BODY_SHAPES[shape]])

    @property
    def present(self) -> tuple[int, ...]:
        """Indices of the bodies that have a mass."""
        return tuple(i for i, mass in enumerate(self.mass) if mass > 0.0)


@dataclass(frozen=True)
class Doors:
    """Flat boxes on a hinge with friction and a spring; they touch covers and free bodies.

    The hinge turns about z of a frame at `positions`; at angle 0 the panel reaches along x from there.
    """

    names: tuple[str, ...] = parameter("names of the doors")
    positions: tuple[float, ...] = parameter(
        "middle of the hinge in the base frame, x y z of each", "m", low=-100.0, high=100.0
    )
    rotations: tuple[float, ...] = parameter(
        "rotation from the base frame to the hinge's, roll pitch yaw of each", "rad", low=-6.3, high=6.3
    )
    sizes: tuple[float, ...] = parameter(
        "three half lengths each: along the panel from the hinge, across it, along the hinge",
        "m",
        low=0.0,
        high=10.0,
    )
    mass: tuple[float, ...] = parameter("mass of each, uniform; 0: no door", "kg", low=0.0, high=1e3)
    hinge_friction: tuple[float, ...] = parameter("dry friction of the hinge", "N m", low=0.0, high=1e3)
    hinge_damping: tuple[float, ...] = parameter("viscous friction of the hinge", "N m s/rad", low=0.0, high=1e4)
    spring: tuple[float, ...] = parameter("stiffness of the hinge's spring", "N m/rad", low=0.0, high=1e5)
    rest: tuple[float, ...] = parameter("angle at which the spring has no torque", "rad", low=-6.3, high=6.3)
    lower: tuple[float, ...] = parameter("smallest angle", "rad", low=-6.3, high=6.3)
    upper: tuple[float, ...] = parameter("largest angle", "rad", low=-6.3, high=6.3)
    friction: tuple[float, ...] = parameter("coefficient of friction against the covers", low=0.0, high=10.0)
    stiffness: tuple[float, ...] = parameter("k_c of the surface, where a cover touches it", "N/m", low=1.0, high=1e9)
    damping: tuple[float, ...] = parameter(
        "damping of the surface, where a cover touches it", "N s/m", low=0.0, high=1e6
    )

    def __post_init__(self) -> None:
        _aligned("world.doors", self.names, vars(self), ("positions", "rotations", "sizes"))
        for i, name in enumerate(self.names):
            _positive(name, "world.doors.sizes", self.sizes[3 * i : 3 * i + 3])
            low, high = self.lower[i], self.upper[i]
            require(
                low <= 0.0 <= high and low < high,
                f"{name}: world.doors.lower is {low:g} rad, upper {high:g} rad; 0, the angle at power-up, must be "
                "between",
            )

    @property
    def present(self) -> tuple[int, ...]:
        """Indices of the doors that have a mass."""
        return tuple(i for i, mass in enumerate(self.mass) if mass > 0.0)


@dataclass(frozen=True)
class Motions:
    """Given motions of obstacles: at + amplitude sin(2 pi f (t - begin)), whatever pushes against them.

    The amplitude grows smoothly during the first quarter of a period, so that nothing is hit by a velocity that jumps.
    """

    obstacles: tuple[str, ...] = parameter("obstacles that move")
    amplitude: tuple[float, ...] = parameter(
        "direction and amplitude in the base frame, x y z of each", "m", low=-10.0, high=10.0
    )
    frequency: tuple[float, ...] = parameter("frequency; 0: no motion", "Hz", low=0.0, high=100.0)
    begin: tuple[float, ...] = parameter("start, since power-up", "s", low=0.0, high=1e6)

    def __post_init__(self) -> None:
        _aligned("world.motions", self.obstacles, vars(self), ("amplitude",), "obstacles")

    @property
    def present(self) -> tuple[int, ...]:
        """Indices of the motions that have a frequency."""
        return tuple(i for i, frequency in enumerate(self.frequency) if frequency > 0.0)


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


def _aligned(
    group: str, names: tuple[str, ...], every: dict[str, tuple[float, ...]], three: Sequence[str], key: str = "names"
) -> None:
    """Refuse lists of wrong lengths and names that are empty or there twice."""
    lengths(group, names, {name: array for name, array in every.items() if name not in (key, *three)})
    lengths(group, names, {name: every[name] for name in three}, width=3)
    require(
        "" not in names and len(set(names)) == len(names),
        f"parameter '{group}.{key}' is {', '.join(map(repr, names))}; give each a name of its own",
    )


def _positive(name: str, what: str, needed: Sequence[float]) -> None:
    require(
        all(math.isfinite(size) and size > 0.0 for size in needed),
        f"{name}: {what} begins with {', '.join(f'{s:g}' for s in needed)} m; each must be above 0",
    )


NO_BODIES = FreeBodies((), (), (), (), (), (), (), (), (), (), (), ())
NO_DOORS = Doors((), (), (), (), (), (), (), (), (), (), (), (), (), ())
NO_MOTIONS = Motions((), (), (), ())
