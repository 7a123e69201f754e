"""Free bodies and doors in the MuJoCo model."""

from xml.etree.ElementTree import Element

from wam_description.movable import BODY_SHAPES, Doors, FreeBodies, principal_inertia
from wam_description.signals import ZERO
from wam_description.xml_element import add

DOOR_COLOUR, BODY_COLOUR = "0.70 0.52 0.34 1", "0.36 0.56 0.72 1"


def hinge_name(door: str) -> str:
    """Name of the joint of a door."""
    return f"{door}_hinge"


def add_doors(parent: Element, doors: Doors) -> None:
    """A body on a hinge for each door that has a mass."""
    for door in doors.present:
        centre = (door.size[0], 0.0, 0.0)
        body = add(parent, "body", name=door.name, pos=door.position, euler=door.rotation)
        inertia = principal_inertia("box", door.size, door.mass)
        add(body, "inertial", pos=centre, mass=door.mass, diaginertia=inertia)
        add(
            body, "joint", name=hinge_name(door.name), range=(door.lower, door.upper), damping=door.hinge_damping,
            frictionloss=door.hinge_friction, stiffness=door.spring, springref=door.rest,
        )  # fmt: skip
        add(body, "geom", name=door.name, type="box", pos=centre, size=door.size, rgba=DOOR_COLOUR)


def add_bodies(parent: Element, bodies: FreeBodies) -> None:
    """A free body for each one that has a mass."""
    for one in bodies.present:
        size = one.size[: BODY_SHAPES[one.shape]]
        body = add(parent, "body", name=one.name, pos=one.position, euler=one.rotation)
        add(body, "inertial", pos=ZERO, mass=one.mass, diaginertia=principal_inertia(one.shape, size, one.mass))
        add(body, "freejoint", name=f"{one.name}_pose")
        kind = "sphere" if one.shape == "ball" else one.shape
        add(body, "geom", name=one.name, type=kind, size=size, rgba=BODY_COLOUR)
