"""The arm and what surrounds it from the side: orthographic, in metres of the picture plane."""

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb

from wam_analysis.drawing import BLOCK_COLOUR, OBJECT_COLOUR, PEDESTAL_COLOUR, TUBE_COLOURS
from wam_analysis.thresholds import LAYOUT
from wam_bag.arrays import Numbers
from wam_description.arm import Arm
from wam_description.parameters import rows
from wam_description.rigid_body import RigidBody
from wam_description.signals import Contact, ObjectState
from wam_description.small_matrices import rotation_xyz
from wam_description.world import World

LIGHT = np.array([-0.35, -0.55, 0.76])  # direction to the light, base frame
PLANES, SOLIDS, PEDESTAL, ARM = range(4)  # layers: what is drawn over what
ANGLES = np.linspace(0.0, 2.0 * math.pi, 20, endpoint=False)
CIRCLE, SQUARE = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)]), np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
CAP = np.linspace(0.08, 0.5, 4) * math.pi  # elevations of the rings on a rounded end


class Face(NamedTuple):
    """A flat face: corners (k, 3) in m, base frame, counter-clockwise from outside; its colour and layer."""

    corners: Numbers
    colour: str
    layer: int


class View(NamedTuple):
    """An orthographic camera, angles in degrees as MuJoCo has them, lengths in m.

    Attributes
    ----------
    azimuth, elevation : viewing direction; a negative elevation looks down.
    centre : (3,), centre of the picture, base frame.
    width, height : of the picture.
    """

    azimuth: float
    elevation: float
    centre: Numbers
    width: float
    height: float

    @property
    def axes(self) -> Numbers:
        """Right, up and forward as rows, (3, 3), base frame."""
        azimuth, elevation = math.radians(self.azimuth), math.radians(self.elevation)
        cos, sin = math.cos(azimuth), math.sin(azimuth)
        forward = [math.cos(elevation) * cos, math.cos(elevation) * sin, math.sin(elevation)]
        right = [sin, -cos, 0.0]
        return np.array([right, np.cross(right, forward), forward])

    def project(self, points: Numbers) -> Numbers:
        """Picture coordinates (..., 2), m from the middle, of points (..., 3) of the base frame."""
        return (points - self.centre) @ self.axes[:2].T


def contact_on_surface(arm: Arm, q: Sequence[float], contact: Contact) -> tuple[Numbers, Numbers]:
    """Point of a contact on the surface of its cover, and its force, base frame, m and N.

    Parameters
    ----------
    arm : the arm.
    q : joint angles, rad.
    contact : force of the world on a cover, N, and its position, m.
    """
    covers = arm.covers
    across = np.array([0.0, contact.force[1], contact.force[2]])
    size = float(np.linalg.norm(across))
    point = np.array(covers.on_axis(contact.cover, contact.position))
    if size > 0.0:
        point -= covers.radius_of(contact.cover) * across / size
    body = RigidBody(arm)
    return body.point(q, contact.cover, point), body.cover_pose(q, contact.cover).rotation @ np.array(contact.force)


def scene(arm: Arm, q: Sequence[float], world: World, states: Sequence[ObjectState] = ()) -> list[Face]:
    """The arm in a pose, q in rad, and its world; without the states of its objects the obstacles alone."""
    faces: list[Face] = []
    for fixed in rows(world.obstacles):
        if not (states and fixed.name in world.moving):
            solid = _solid(fixed.shape, fixed.size, rotation_xyz(*fixed.rotation), np.array(fixed.position))
            faces += [Face(corners, BLOCK_COLOUR, SOLIDS if fixed.shape != "plane" else PLANES) for corners in solid]
    floor = min([float(face.corners[:, 2].min()) for face in faces], default=-0.2)  # at the lowest obstacle
    for one, state in zip(world.solids, states, strict=False):
        rotation = pin.Quaternion(state.qw, state.qx, state.qy, state.qz).matrix()
        solid = _solid(one.shape, one.size, rotation, np.array((state.x, state.y, state.z)) + rotation @ one.centre)
        colour = BLOCK_COLOUR if one.name in world.moving else OBJECT_COLOUR
        faces += [Face(corners, colour, SOLIDS) for corners in solid]
    pillar = _tube(np.array([0.0, 0.0, floor + LAYOUT.pedestal]), np.zeros(3), LAYOUT.pedestal)
    faces += [Face(corners, PEDESTAL_COLOUR, PEDESTAL) for corners in pillar]
    body = RigidBody(arm)
    for one, colour in zip(rows(arm.covers), itertools.cycle(TUBE_COLOURS), strict=False):
        start, end = (body.point(q, one.name, point) for point in (one.start, one.end))
        faces += [Face(corners, colour, ARM) for corners in _tube(start, end, one.radius)]
    return faces


def _solid(shape: str, size: Sequence[float], rotation: Numbers, centre: Numbers) -> Iterator[Numbers]:
    """Faces of a plane, or of a prism over a square or a circle, or of a ball, all with their centre."""
    if shape == "ball":
        yield from _tube(centre, centre, size[0])
        return
    ring = size[0] * CIRCLE if shape == "cylinder" else SQUARE * size[:2]
    half = size[1] if shape == "cylinder" else 0.0 if shape == "plane" else size[2]
    for corners in _between([(1.0, -half), (1.0, half)][shape == "plane" :], ring):
        yield corners @ rotation.T + centre


def _tube(start: Numbers, end: Numbers, radius: float) -> Iterator[Numbers]:
    """Faces of a cylinder with rounded ends between two points."""
    length = float(np.linalg.norm(end - start))
    caps = [(float(np.cos(at)), float(radius * np.sin(at)) + length) for at in CAP]
    profile = [*((scale, length - height) for scale, height in caps[::-1]), *caps]
    along = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end - start if length else pin.ZAxis).matrix()
    for corners in _between(profile, radius * CIRCLE):
        yield corners @ along.T + start


def _between(profile: Sequence[tuple[float, float]], ring: Numbers) -> Iterator[Numbers]:
    """Faces of a solid whose sections are a ring, (n, 2), with a scale at each height."""
    rings = [np.column_stack([scale * ring, np.full(len(ring), height)]) for scale, height in profile]
    yield rings[-1]
    yield rings[0][::-1]
    for low, high in itertools.pairwise(rings):
        yield from np.stack([low, np.roll(low, -1, axis=0), np.roll(high, -1, axis=0), high], axis=1)


def side_view(
    shown: Sequence[Face],
    aspect: float,
    margin: float = 0.08,
    azimuth: float = 112.0,
    elevation: float = -14.0,
    more: Sequence[Numbers] = (),
) -> View:
    """A view from the side and a little from above that shows a scene and points; aspect: width by height."""
    points = np.vstack([*(face.corners for face in shown if face.layer != PLANES), *more])
    view = View(azimuth=azimuth, elevation=elevation, centre=np.zeros(3), width=1.0, height=1.0)
    projected = view.project(points)
    low, high = projected.min(axis=0), projected.max(axis=0)
    centre = ((low + high) / 2.0) @ view.axes[:2]
    width, height = high - low + 2.0 * margin
    width = max(width, height * aspect)
    return view._replace(centre=centre, width=float(width), height=float(width / aspect))


def draw(axes: Axes, shown: Sequence[Face], view: View) -> None:
    """A scene: the faces that are seen, shaded, by layer and the farthest first."""
    axes.set_axis_off()
    axes.set(xlim=(-view.width / 2.0, view.width / 2.0), ylim=(-view.height / 2.0, view.height / 2.0), aspect="equal")
    forward, corners, colours = view.axes[2], [], []
    for face in sorted(shown, key=lambda face: (face.layer, -float(np.mean(face.corners @ forward)))):
        normal = np.cross(face.corners[2] - face.corners[0], face.corners[3] - face.corners[1])
        if normal @ forward < 0.0:
            light = max(float(normal @ LIGHT / np.linalg.norm(normal)), 0.0)
            corners.append(view.project(face.corners))
            colours.append((0.7 + 0.3 * light) * np.array(to_rgb(face.colour)))
    axes.add_collection(PolyCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.4))


def arrow(axes: Axes, tail: Numbers, tip: Numbers, colour: str, width: float) -> None:
    """An arrow in the picture plane, (2,) each, above the arm; a thin one is above a thick one."""
    style = {"arrowstyle": "-|>,head_width=0.35,head_length=0.7", "color": colour, "linewidth": width}
    axes.annotate(
        "", (tip[0], tip[1]), (tail[0], tail[1]), arrowprops={**style, "shrinkA": 0, "shrinkB": 0}, zorder=30.0 - width
    )
