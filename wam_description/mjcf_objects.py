"""Free bodies and doors in the MuJoCo model."""

from collections.abc import Sequence
from xml.etree import ElementTree

from wam_description.movable import BODY_SHAPES, Doors, FreeBodies, principal_inertia
from wam_description.parameters import require
from wam_description.world import World

DOOR_COLOUR, BODY_COLOUR = "0.70 0.52 0.34 1", "0.36 0.56 0.72 1"


def hinge_name(door: str) -> str:
    """Name of the joint of a door."""
    return f"{door}_hinge"


def require_names(world: World, taken: Sequence[str]) -> None:
    """Refuse free bodies and doors with the name of a part of the arm.

    Raises
    ------
    ParameterError
        which names it.
    """
    for name in world.objects:
        require(name not in taken, f"object '{name}' has the name of a part of the arm; rename it")


def add_doors(parent: ElementTree.Element, doors: Doors) -> None:
    """A body on a hinge for each door that has a mass."""
    for i in doors.present:
        name, size = doors.names[i], doors.sizes[3 * i : 3 * i + 3]
        body = _element(
            parent, "body", name=name, pos=_numbers(doors.positions[3 * i : 3 * i + 3]),
            euler=_numbers(doors.rotations[3 * i : 3 * i + 3]),
        )  # fmt: skip
        _inertial(body, (size[0], 0.0, 0.0), doors.mass[i], principal_inertia("box", size, doors.mass[i]))
        _element(
            body, "joint", name=hinge_name(name), range=_numbers((doors.lower[i], doors.upper[i])),
            damping=repr(doors.hinge_damping[i]), frictionloss=repr(doors.hinge_friction[i]),
            stiffness=repr(doors.spring[i]), springref=repr(doors.rest[i]),
        )  # fmt: skip
        _element(
            body, "geom", name=name, type="box", pos=_numbers((size[0], 0.0, 0.0)), size=_numbers(size),
            rgba=DOOR_COLOUR,
        )  # fmt: skip


def add_bodies(parent: ElementTree.Element, bodies: FreeBodies) -> None:
    """A free body for each one that has a mass."""
    for i in bodies.present:
        name, shape = bodies.names[i], bodies.shapes[i]
        size = bodies.sizes[3 * i : 3 * i + BODY_SHAPES[shape]]
        body = _element(
            parent, "body", name=name, pos=_numbers(bodies.positions[3 * i : 3 * i + 3]),
            euler=_numbers(bodies.rotations[3 * i : 3 * i + 3]),
        )  # fmt: skip
        _inertial(body, (0.0, 0.0, 0.0), bodies.mass[i], principal_inertia(shape, size, bodies.mass[i]))
        _element(body, "freejoint", name=f"{name}_pose")
        kind = "sphere" if shape == "ball" else shape
        _element(body, "geom", name=name, type=kind, size=_numbers(size), rgba=BODY_COLOUR)


def _inertial(body: ElementTree.Element, centre: Sequence[float], mass: float, inertia: Sequence[float]) -> None:
    _element(body, "inertial", pos=_numbers(centre), mass=repr(mass), diaginertia=_numbers(inertia))


def _element(parent: ElementTree.Element, tag: str, **attributes: str) -> ElementTree.Element:
    return ElementTree.SubElement(parent, tag, attributes)


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
