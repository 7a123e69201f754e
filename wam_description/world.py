"""What the arm can touch: obstacles, springs, pushers, and what it can move."""

from dataclasses import dataclass
from typing import NamedTuple

from wam_description.movable import NO_BODIES, NO_DOORS, NO_MOTIONS, Doors, FreeBodies, Motions
from wam_description.parameters import lengths, option, parameter, require

SHAPES = {"box": 3, "cylinder": 2, "plane": 3}  # numbers that MuJoCo needs for the size of each


@dataclass(frozen=True)
class Obstacles:
    """Surfaces that the covers can touch, fixed in the base frame."""

    names: tuple[str, ...] = parameter("names of the obstacles")
    shapes: tuple[str, ...] = parameter("shape of each", choices=tuple(SHAPES))
    positions: tuple[float, ...] = parameter("centre in the base frame, x y z of each", "m", low=-100.0, high=100.0)
    rotations: tuple[float, ...] = parameter(
        "rotation from the base frame, roll pitch yaw of each", "rad", low=-6.3, high=6.3
    )
    sizes: tuple[float, ...] = parameter(
        "three numbers each: box half lengths; cylinder radius, half length, 0; plane half lengths, 0",
        "m",
        low=0.0,
        high=100.0,
    )
    stiffness: tuple[float, ...] = parameter("k_c of the surface, at the contact", "N/m", low=1.0, high=1e9)
    damping: tuple[float, ...] = parameter("damping of the surface, at the contact", "N s/m", low=0.0, high=1e6)
    hardening: tuple[float, ...] = parameter(
        "h of F = k_c x (1 + h x) with depth x; 0: linear surface", "1/m", low=0.0, high=1e6
    )
    friction: tuple[float, ...] = parameter("coefficient of friction against the covers", low=0.0, high=10.0)

    def __post_init__(self) -> None:
        one = ("shapes", "stiffness", "damping", "hardening", "friction")
        lengths("world.obstacles", self.names, {key: getattr(self, key) for key in one})
        three = ("positions", "rotations", "sizes")
        lengths("world.obstacles", self.names, {key: getattr(self, key) for key in three}, width=3)
        require("" not in self.names, "parameter 'world.obstacles.names' has an empty name; name every obstacle")
        require(
            len(set(self.names)) == len(self.names),
            f"parameter 'world.obstacles.names' has a duplicate name: {', '.join(self.names)}",
        )
        for i, (name, shape) in enumerate(zip(self.names, self.shapes, strict=True)):
            require(shape in SHAPES, f"{name}: world.obstacles.shapes is '{shape}'; allowed: {', '.join(SHAPES)}")
            needed = self.sizes[3 * i : 3 * i + SHAPES[shape]]
            require(
                shape == "plane" or min(needed) > 0.0,
                f"{name}: world.obstacles.sizes of a {shape} begins with {', '.join(f'{s:g}' for s in needed)} m; "
                "each must be above 0",
            )


@dataclass(frozen=True)
class Springs:
    """Springs that push on the lever of a joint, like the one under the tip of the testbed (section 5.6)."""

    joints: tuple[str, ...] = parameter("joint of each spring")
    stiffness: tuple[float, ...] = parameter("k_c at the end of the lever; 0: no spring", "N/m", low=0.0, high=1e9)
    lever: tuple[float, ...] = parameter("distance of the spring from the joint's axis", "m", low=1e-3, high=3.0)
    rest: tuple[float, ...] = parameter("joint angle at which the spring has no force", "rad", low=-13.0, high=13.0)
    bilateral: tuple[bool, ...] = parameter("true if it also pulls; otherwise it only pushes towards larger angles")

    def __post_init__(self) -> None:
        keys = ("stiffness", "lever", "rest", "bilateral")
        lengths("world.springs", self.joints, {key: getattr(self, key) for key in keys})


NO_SPRINGS = Springs((), (), (), (), ())


PUSHER_SHAPES = ("sphere", "box")


@dataclass(frozen=True)
class Pushers:
    """Hands that follow a moving link and press on it: rigid bodies with a soft surface, moved by the simulator.

    Each approaches from `clearance`, presses with its force from `begin` to `end` (s since power-up), moves
    with the link, slides over it if configured, and leaves.  `force` is k_c times depth; the true
    contact force is on `sim/contact/wrench`.
    """

    names: tuple[str, ...] = parameter("names of the pushers")
    shapes: tuple[str, ...] = parameter("shape of each; a box presses with its flat side", choices=PUSHER_SHAPES)
    sizes: tuple[float, ...] = parameter(
        "three numbers each: radius of a sphere, 0, 0; or half lengths of a box along the link, across "
        "it, along the force",
        "m",
        low=0.0,
        high=10.0,
    )
    covers: tuple[str, ...] = parameter("cover that each presses on")
    positions: tuple[float, ...] = parameter(
        "position along the cover where each touches first", "m", low=0.0, high=3.0
    )
    angles: tuple[float, ...] = parameter(
        "direction of the force about the cover, from its y to its z axis", "rad", low=-6.3, high=6.3
    )
    force: tuple[float, ...] = parameter("force at right angles to the link; 0: no pusher", "N", low=0.0, high=1e3)
    begin: tuple[float, ...] = parameter("time of first contact, since power-up", "s", low=0.0, high=1e6)
    end: tuple[float, ...] = parameter("time of release, since power-up", "s", low=0.0, high=1e6)
    rise: tuple[float, ...] = parameter("time in which the force rises and falls", "s", low=1e-3, high=1e3)
    clearance: tuple[float, ...] = parameter(
        "distance from the link before and after contact", "m", low=1e-3, high=10.0
    )
    slide: tuple[float, ...] = parameter("speed at which each slides along the link", "m/s", low=-10.0, high=10.0)
    turn: tuple[float, ...] = parameter("speed at which each moves about the link", "rad/s", low=-100.0, high=100.0)
    stiffness: tuple[float, ...] = parameter("k_c of the surface, at the contact", "N/m", low=1.0, high=1e9)
    damping: tuple[float, ...] = parameter("damping of the surface, at the contact", "N s/m", low=0.0, high=1e6)
    friction: tuple[float, ...] = parameter("coefficient of friction against the cover", low=0.0, high=10.0)

    def __post_init__(self) -> None:
        single = {key: value for key, value in vars(self).items() if key not in ("names", "sizes")}
        lengths("world.pushers", self.names, single)
        lengths("world.pushers", self.names, {"sizes": self.sizes}, width=3)
        require(
            "" not in self.names and len(set(self.names)) == len(self.names),
            f"parameter 'world.pushers.names' is {', '.join(self.names)}; give each pusher a name of its own",
        )
        for i, name in enumerate(self.names):
            needed = self.sizes[3 * i : 3 * i + (1 if self.shapes[i] == "sphere" else 3)]
            require(
                min(needed) > 0.0,
                f"{name}: world.pushers.sizes of a {self.shapes[i]} are {needed}; each must be above 0",
            )
            require(
                self.begin[i] + 2.0 * self.rise[i] <= self.end[i],
                f"{name}: world.pushers.end is {self.end[i]:g} s; it must be at least twice the rise after "
                f"begin, {self.begin[i] + 2.0 * self.rise[i]:g} s",
            )


@dataclass(frozen=True)
class Folding:
    """Contact between the tubes of links that follow each other, as of a folded elbow."""

    stiffness: float = parameter("stiffness; 0: the tubes never touch", "N/m", low=0.0, high=1e9)
    damping: float = parameter("damping", "N s/m", low=0.0, high=1e6)
    friction: float = parameter("friction coefficient", low=0.0, high=10.0)
    clearance: float = parameter(
        "length of the outer tube from the joint on that touches nothing: near it the tubes overlap",
        "m",
        low=0.0,
        high=10.0,
    )


NO_FOLDING = Folding(0.0, 0.0, 0.0, 0.0)
NO_PUSHERS = Pushers((), (), (), (), (), (), (), (), (), (), (), (), (), (), (), ())


class Solid(NamedTuple):
    """An object: its name, shape, size as the parameters have it, and centre in its own frame, m."""

    name: str
    shape: str
    size: tuple[float, ...]
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class World:
    """The surroundings of the arm."""

    obstacles: Obstacles
    springs: Springs
    pushers: Pushers = NO_PUSHERS
    bodies: FreeBodies = NO_BODIES
    doors: Doors = NO_DOORS
    motions: Motions = NO_MOTIONS
    folding: Folding = NO_FOLDING
    cover_stiffness: float = option(
        "stiffness of the covers, in series with what they touch (1.1.1), except pushers and springs; 0: rigid", "N/m"
    )

    def __post_init__(self) -> None:
        known = self.obstacles.names
        for i, name in enumerate(self.motions.obstacles):
            require(
                name in known or self.motions.frequency[i] == 0.0,
                f"world.motions.obstacles names '{name}'; obstacles: {', '.join(known) or 'none'}",
            )
        pushing = [name for name, force in zip(self.pushers.names, self.pushers.force, strict=True) if force > 0.0]
        bodies = [self.bodies.names[i] for i in self.bodies.present]
        doors = [self.doors.names[i] for i in self.doors.present]
        named = [*known, *pushing, *bodies, *doors]
        doubled = sorted({name for name in (*bodies, *doors) if named.count(name) > 1})
        require(
            not doubled,
            f"several of obstacles, pushers, bodies and doors are named {', '.join(doubled)}; "
            "give each a name of its own",
        )

    @property
    def moving(self) -> dict[str, int]:
        """Obstacles that move, each with the index of its motion."""
        return {self.motions.obstacles[i]: i for i in self.motions.present}

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the free bodies, doors and moving obstacles, in the order of `sim/objects`."""
        return tuple(solid.name for solid in self.solids)

    @property
    def solids(self) -> tuple[Solid, ...]:
        """The free bodies, doors and moving obstacles, in the order of `sim/objects`."""
        bodies, doors, obstacles = self.bodies, self.doors, self.obstacles
        free = [Solid(bodies.names[i], bodies.shapes[i], bodies.sizes[3 * i : 3 * i + 3]) for i in bodies.present]
        hung = [(doors.names[i], doors.sizes[3 * i : 3 * i + 3]) for i in doors.present]
        moving = [(name, obstacles.names.index(name)) for name in self.moving]
        return (
            *free,
            *(Solid(name, "box", size, (size[0], 0.0, 0.0)) for name, size in hung),
            *(Solid(name, obstacles.shapes[i], obstacles.sizes[3 * i : 3 * i + 3]) for name, i in moving),
        )
