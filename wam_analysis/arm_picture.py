"""The arm and what surrounds it from the side: orthographic, in metres of the picture plane."""

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Polygon

from wam_analysis.drawing import BLOCK_COLOUR, OBJECT_COLOUR, PEDESTAL_COLOUR, TUBE_COLOURS
from wam_analysis.thresholds import LAYOUT
from wam_bag.arrays import Numbers
from wam_description.arm import Arm
from wam_description.mjcf import rotation_xyz
from wam_description.parameters import rows
from wam_description.rigid_body import RigidBody
from wam_description.signals import Contact, ObjectState
from wam_description.world import World

OUTLINE = "#3b4148"
LIGHT = np.array([-0.35, -0.55, 0.76])  # direction to the light, base frame


class Tube(NamedTuple):
    """A cover: a cylinder with rounded ends between two points of the base frame, m."""

    start: Numbers
    end: Numbers
    radius: float
    colour: str


class Face(NamedTuple):
    """A flat face: corners (k, 3) in m and outward normal (3,), base frame, the shape that has it, and its colour."""

    corners: Numbers
    normal: Numbers
    shape: str
    colour: str


class SideScene(NamedTuple):
    """What is drawn: covers and balls as tubes, everything else as faces; height of the floor, m."""

    tubes: list[Tube]
    faces: list[Face]
    floor: float


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


def tubes(arm: Arm, q: Sequence[float]) -> list[Tube]:
    """The covers of the arm in a pose, q in rad."""
    body, colours = RigidBody(arm), itertools.cycle(TUBE_COLOURS)
    return [
        Tube(body.point(q, one.name, one.start), body.point(q, one.name, one.end), one.radius, colour)
        for one, colour in zip(rows(arm.covers), colours, strict=False)
    ]


def contact_on_surface(arm: Arm, q: Sequence[float], contact: Contact) -> tuple[Numbers, Numbers]:
    """Point of a contact on the surface of its cover, and its force, base frame, m and N.

    Parameters
    ----------
    arm : the arm.
    q : joint angles, rad.
    contact : force of the world on a cover, N, and its position, m.
    """
    covers = arm.covers
    i = covers.names.index(contact.cover)
    begin, end = (np.array(point[3 * i : 3 * i + 3]) for point in (covers.start, covers.end))
    along = (contact.position - begin[0]) / (end[0] - begin[0]) if end[0] != begin[0] else 0.0
    across = np.array([0.0, contact.force[1], contact.force[2]])
    size = float(np.linalg.norm(across))
    point = begin + along * (end - begin) - (covers.radius[i] * across / size if size > 0.0 else 0.0)
    body = RigidBody(arm)
    return body.point(q, contact.cover, point), body.cover_pose(q, contact.cover).rotation @ np.array(contact.force)


def scene(arm: Arm, q: Sequence[float], world: World, states: Sequence[ObjectState] = ()) -> SideScene:
    """The arm in a pose, q in rad, and its world; without the states of its objects the obstacles alone."""
    balls: list[Tube] = []
    faces: list[Face] = []
    for fixed in rows(world.obstacles):
        if not (states and fixed.name in world.moving):
            rotation, centre = rotation_xyz(*fixed.rotation), np.array(fixed.position)
            faces += _faces(fixed.shape, np.array(fixed.size), rotation, centre, BLOCK_COLOUR)
    floor = min([float(face.corners[:, 2].min()) for face in faces], default=-0.2)  # at the lowest obstacle
    for one, state in zip(world.solids, states, strict=False):
        rotation = pin.Quaternion(state.qw, state.qx, state.qy, state.qz).matrix()
        centre = np.array((state.x, state.y, state.z)) + rotation @ one.centre
        colour = BLOCK_COLOUR if one.name in world.moving else OBJECT_COLOUR
        if one.shape == "ball":
            balls.append(Tube(centre, centre, one.size[0], colour))
        else:
            faces += _faces(one.shape, np.array(one.size), rotation, centre, colour)
    return SideScene([*tubes(arm, q), *balls], faces, floor)


def _faces(shape: str, size: Numbers, rotation: Numbers, centre: Numbers, colour: str) -> Iterator[Face]:
    """The faces of a solid; round ones in facets."""
    for corners, normal in _corners(shape, size):
        yield Face(corners @ rotation.T + centre, rotation @ normal, shape, colour)


def _corners(shape: str, size: Numbers) -> Iterator[tuple[Numbers, Numbers]]:
    """Corners and outward normal of each face: a plane, or a prism over a square or a circle."""
    square = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]) * size[:2]
    angles = np.linspace(0.0, 2.0 * math.pi, 48, endpoint=False)
    round_ring = size[0] * np.column_stack([np.cos(angles), np.sin(angles)])
    ring, half = (round_ring, size[1]) if shape == "cylinder" else (square, 0.0 if shape == "plane" else size[2])
    for sign in (1.0,) if shape == "plane" else (-1.0, 1.0):
        yield np.column_stack([ring, np.full(len(ring), sign * half)]), np.array([0.0, 0.0, sign])
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True) if half else ():
        along = (b - a) / np.linalg.norm(b - a)
        yield np.array([[*a, -half], [*b, -half], [*b, half], [*a, half]]), np.array([along[1], -along[0], 0.0])


def side_view(
    shown: SideScene,
    aspect: float,
    margin: float = 0.08,
    azimuth: float = 112.0,
    elevation: float = -14.0,
    more: Sequence[Numbers] = (),
) -> View:
    """A view from the side and a little from above that shows a scene and points; aspect: width by height."""
    points = [point for tube in shown.tubes for point in (tube.start, tube.end)]
    points += [corner for face in shown.faces for corner in face.corners if face.shape != "plane"]
    points += [np.array([0.0, 0.0, shown.floor]), *more]
    view = View(azimuth=azimuth, elevation=elevation, centre=np.zeros(3), width=1.0, height=1.0)
    projected = view.project(np.array(points))
    low, high = projected.min(axis=0), projected.max(axis=0)
    centre = ((low + high) / 2.0) @ view.axes[:2]
    width, height = high - low + 2.0 * margin
    width = max(width, height * aspect)
    return view._replace(centre=centre, width=float(width), height=float(width / aspect))


def draw(axes: Axes, shown: SideScene, view: View) -> None:
    """A scene: faces shaded, the farthest first, then the tubes with their true radii."""
    axes.set_axis_off()
    axes.set(xlim=(-view.width / 2.0, view.width / 2.0), ylim=(-view.height / 2.0, view.height / 2.0), aspect="equal")
    for tube in shown.tubes:
        shadow = [np.array([*end[:2], shown.floor]) for end in (tube.start, tube.end)]
        _stadium(axes, view.project(np.array(shadow)), tube.radius, facecolor="#e9ebee", edgecolor="none", zorder=1)
    forward = view.axes[2]
    for face in sorted(shown.faces, key=lambda face: -float(np.mean(face.corners @ forward))):
        if face.normal @ forward < 0.0:
            shade = 0.78 + 0.22 * max(float(face.normal @ LIGHT), 0.0)
            colour = tuple(shade * channel for channel in to_rgb(face.colour))
            corners = view.project(face.corners)
            edge = colour if face.shape == "cylinder" and len(corners) == 4 else "#8a6f3a"
            zorder = 2 if face.shape == "plane" else 3
            axes.add_patch(Polygon(corners, facecolor=colour, edgecolor=edge, linewidth=0.6, zorder=zorder))
    pillar = np.array([0.0, 0.0, shown.floor + LAYOUT.pedestal])
    _draw_tube(axes, view, Tube(pillar, np.zeros(3), LAYOUT.pedestal, PEDESTAL_COLOUR), 4.0)
    order = sorted(shown.tubes, key=lambda tube: -float((tube.start + tube.end) @ forward))
    for depth, tube in enumerate(order):
        _draw_tube(axes, view, tube, 4.1 + 0.1 * depth)


def arrow(axes: Axes, tail: Numbers, tip: Numbers, colour: str, width: float) -> None:
    """An arrow in the picture plane, (2,) each, above the arm; a thin one is above a thick one."""
    style = {"arrowstyle": "-|>,head_width=0.35,head_length=0.7", "color": colour, "linewidth": width}
    axes.annotate(
        "", (tip[0], tip[1]), (tail[0], tail[1]), arrowprops={**style, "shrinkA": 0, "shrinkB": 0}, zorder=30.0 - width
    )


def _draw_tube(axes: Axes, view: View, tube: Tube, zorder: float) -> None:
    """A tube with the shading of a cylinder: nested stadiums, brighter towards the light."""
    ends = view.project(np.array([tube.start, tube.end]))
    light = view.axes[:2] @ LIGHT
    colour = np.array(to_rgb(tube.colour))
    rim = {"facecolor": colour * 0.82, "edgecolor": OUTLINE, "linewidth": 0.9}
    _stadium(axes, ends, tube.radius, zorder=zorder, **rim)
    for part in np.linspace(0.05, 0.9, 18):
        bright = colour * (0.82 + 0.18 * part) + (1.0 - colour) * 0.35 * part**2
        at = ends + 0.55 * part * tube.radius * light
        _stadium(axes, at, tube.radius * (1.0 - part), facecolor=bright, edgecolor="none", zorder=zorder)


def _stadium(axes: Axes, ends: Numbers, radius: float, **style: Any) -> None:
    begin, end = ends
    angle = math.atan2(end[1] - begin[1], end[0] - begin[0])
    half = np.linspace(-math.pi / 2.0, math.pi / 2.0, 25)
    caps = [
        point + radius * np.column_stack([np.cos(angle + half + turn), np.sin(angle + half + turn)])
        for point, turn in ((end, 0.0), (begin, math.pi))
    ]
    axes.add_patch(Polygon(np.vstack(caps), **style))
