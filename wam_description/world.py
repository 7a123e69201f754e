"""What the arm can touch: obstacles, springs, pushers, and what it can move."""

from dataclasses import dataclass
from typing import NamedTuple

from wam_description.movable import BOX, Countable, Doors, FreeBodies, Motions, Solids
from wam_description.parameters import aligned, empty, parameter, require, rows

SHAPES = {"box": 3, "cylinder": 2, "plane": 3}  # numbers that MuJoCo needs for the size of each
NEEDED = {**SHAPES, "plane": 0}  # of these that have to be above 0


@dataclass(frozen=True)
class Obstacles(Solids):
    """Surfaces that the covers can touch, fixed in the base frame."""

    shapes: tuple[str, ...] = parameter("shape of each", choices=tuple(SHAPES))
    positions: tuple[float, ...] = parameter("centre in the base frame, x y z of each", "m", within=100.0, width=3)
    rotations: tuple[float, ...] = parameter(
        "rotation from the base frame, roll pitch yaw of each", "rad", within=6.3, width=3
    )
    sizes: tuple[float, ...] = parameter(
        "three numbers each: box half lengths; cylinder radius, half length, 0; plane half lengths, 0",
        "m",
        high=100.0,
        width=3,
    )
    hardening: tuple[float, ...] = parameter(
        "h of F = k_c x (1 + h x) with depth x; 0: linear surface", "1/m", high=1e6
    )

    def __post_init__(self) -> None:
        self.check("world.obstacles", NEEDED)


@dataclass(frozen=True)
class Springs(Countable):
    """Springs that push on the lever of a joint, like the one under the tip of the testbed (section 5.6)."""

    counted_by = "stiffness"
    joints: tuple[str, ...] = parameter("joint of each spring")
    stiffness: tuple[float, ...] = parameter("k_c at the end of the lever; 0: no spring", "N/m")
    lever: tuple[float, ...] = parameter("distance of the spring from the axis of the joint", "m", low=1e-3, high=3.0)
    rest: tuple[float, ...] = parameter("joint angle at which the spring has no force", "rad", within=13.0)
    bilateral: tuple[bool, ...] = parameter(
        "true if the spring also pulls; false: it only pushes towards larger angles"
    )

    def __post_init__(self) -> None:
        aligned("world.springs", self.joints, self)


NO_SPRINGS = empty(Springs)


PUSHER_SHAPES = {"sphere": 1, **BOX}


@dataclass(frozen=True)
class Pushers(Solids, Countable):
    """Hands that follow a moving link and press on it: rigid bodies with a soft surface, moved by the simulator.

    Each approaches from `clearance`, presses with its force from `begin` to `end` (s since power-up), moves
    with the link, slides over it if configured, and leaves.  `force` is k_c times depth; the true
    contact force is on `sim/contact/wrench`.
    """

    counted_by = "force"
    shapes: tuple[str, ...] = parameter("shape of each; a box presses with its flat side", choices=tuple(PUSHER_SHAPES))
    sizes: tuple[float, ...] = parameter(
        "three numbers each: radius of a sphere, 0, 0; or half lengths of a box along the link, across "
        "it, along the force",
        "m",
        high=10.0,
        width=3,
    )
    covers: tuple[str, ...] = parameter("cover that each presses on")
    positions: tuple[float, ...] = parameter("position along the cover where each touches first", "m", high=3.0)
    angles: tuple[float, ...] = parameter(
        "direction of the force: angle about the x axis of the cover, from y towards z", "rad", within=6.3
    )
    force: tuple[float, ...] = parameter("force at right angles to the link; 0: no pusher", "N", high=1e3)
    begin: tuple[float, ...] = parameter("time of first contact, since power-up", "s", high=1e6)
    end: tuple[float, ...] = parameter("time of release, since power-up", "s", high=1e6)
    rise: tuple[float, ...] = parameter("time in which the force rises and falls", "s", low=1e-3, high=1e3)
    clearance: tuple[float, ...] = parameter(
        "distance from the link before and after contact", "m", low=1e-3, high=10.0
    )
    slide: tuple[float, ...] = parameter("speed at which each slides along the link", "m/s", within=10.0)
    turn: tuple[float, ...] = parameter("speed at which each moves about the link", "rad/s", within=100.0)

    def __post_init__(self) -> None:
        self.check("world.pushers", PUSHER_SHAPES)
        for one in rows(self):
            least = one.begin + 2.0 * one.rise
            require(
                least <= one.end,
                f"{one.name}: world.pushers.end is {one.end:g} s; it must be at least twice the rise after "
                f"begin, {least:g} s",
            )


@dataclass(frozen=True)
class Folding:
    """Contact between the tubes of links that follow each other, as of a folded elbow."""

    stiffness: float = parameter("stiffness of the contact of inner and outer tube; 0: they never touch", "N/m")
    damping: float = parameter("damping", "N s/m", high=1e6)
    friction: float = parameter("friction coefficient", high=10.0)
    clearance: float = parameter(
        "length of the outer tube, from the joint, that never makes contact",
        "m",
        high=10.0,
    )


NO_PUSHERS, NO_BODIES, NO_DOORS, NO_MOTIONS = empty(Pushers), empty(FreeBodies), empty(Doors), empty(Motions)


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
    folding: Folding = Folding(0.0, 0.0, 0.0, 0.0)
    cover_stiffness: float = parameter(
        "stiffness of the covers, in series with what they touch (1.1.1), except pushers and springs; 0: rigid",
        "N/m",
        default=0.0,
    )

    def __post_init__(self) -> None:
        known = self.obstacles.names
        for motion in self.motions.present:
            require(
                motion.obstacle in known,
                f"world.motions.obstacles names '{motion.obstacle}'; obstacles: {', '.join(known) or 'none'}",
            )
        movable = [one.name for one in (*self.bodies.present, *self.doors.present)]
        named = [*known, *(pusher.name for pusher in self.pushers.present), *movable]
        doubled = sorted({name for name in movable if named.count(name) > 1})
        require(
            not doubled,
            f"several of obstacles, pushers, bodies and doors are named {', '.join(doubled)}; "
            "give each a name of its own",
        )

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of the obstacles that move."""
        return tuple(motion.obstacle for motion in self.motions.present)

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the free bodies, doors and moving obstacles, in the order of `sim/objects`."""
        return tuple(solid.name for solid in self.solids)

    @property
    def solids(self) -> tuple[Solid, ...]:
        """The free bodies, doors and moving obstacles, in the order of `sim/objects`."""
        obstacles = {one.name: one for one in rows(self.obstacles)}
        return (
            *(Solid(one.name, one.shape, one.size) for one in self.bodies.present),
            *(Solid(one.name, "box", one.size, (one.size[0], 0.0, 0.0)) for one in self.doors.present),
            *(Solid(name, obstacles[name].shape, obstacles[name].size) for name in self.moving),
        )
