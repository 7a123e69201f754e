"""The arm and its obstacles from the side: rendered by MuJoCo, or drawn if OpenGL does not work.

Both are orthographic, in metres of the picture plane, so that arrows and labels fit both.
"""

import itertools
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from wam_analysis.drawing import BLOCK_COLOUR, OBJECT_COLOUR, PEDESTAL_COLOUR, TUBE_COLOURS
from wam_analysis.thresholds import LAYOUT
from wam_description.arm import Arm
from wam_description.effects import no_effects
from wam_description.mjcf import mjcf, rotation_xyz
from wam_description.mjcf_objects import hinge_name
from wam_description.rigid_body import RigidBody
from wam_description.signals import Contact, ObjectState
from wam_description.world import NO_SPRINGS, Obstacles, World

Array = NDArray[np.float64]

GL = ("egl", "osmesa")
OUTLINE = "#3b4148"
LIGHT = np.array([-0.35, -0.55, 0.76])  # direction to the light, base frame


class Tube(NamedTuple):
    """A cover: a cylinder with rounded ends between two points of the base frame, m."""

    start: Array
    end: Array
    radius: float
    colour: str


class Face(NamedTuple):
    """A flat face: corners (k, 3) in m and outward normal (3,), base frame, and its shape."""

    corners: Array
    normal: Array
    shape: str


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
    centre: Array
    width: float
    height: float

    @property
    def axes(self) -> Array:
        """Right, up and forward as rows, (3, 3), base frame."""
        azimuth, elevation = math.radians(self.azimuth), math.radians(self.elevation)
        cos, sin = math.cos(azimuth), math.sin(azimuth)
        forward = [math.cos(elevation) * cos, math.cos(elevation) * sin, math.sin(elevation)]
        right = [sin, -cos, 0.0]
        return np.array([right, np.cross(right, forward), forward])

    def project(self, points: Array) -> Array:
        """Picture coordinates (..., 2), m from the middle, of points (..., 3) of the base frame."""
        projected: Array = (points - self.centre) @ self.axes[:2].T
        return projected


def tubes(arm: Arm, q: Sequence[float]) -> list[Tube]:
    """The covers of the arm in a pose, q in rad."""
    body = RigidBody(arm)
    covers = arm.covers
    return [
        Tube(
            body.point(q, name, covers.start[3 * i : 3 * i + 3]),
            body.point(q, name, covers.end[3 * i : 3 * i + 3]),
            covers.radius[i],
            TUBE_COLOURS[i % len(TUBE_COLOURS)],
        )
        for i, name in enumerate(covers.names)
    ]


def contact_on_surface(arm: Arm, q: Sequence[float], contact: Contact) -> tuple[Array, Array]:
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


def faces(obstacles: Obstacles) -> Iterator[Face]:
    """The faces of all obstacles; round ones in facets."""
    for i, shape in enumerate(obstacles.shapes):
        triple = slice(3 * i, 3 * i + 3)
        rotation, centre = rotation_xyz(*obstacles.rotations[triple]), np.array(obstacles.positions[triple])
        for corners, normal in _faces(shape, np.array(obstacles.sizes[triple])):
            yield Face(corners @ rotation.T + centre, rotation @ normal, shape)


def _faces(shape: str, size: Array) -> Iterator[tuple[Array, Array]]:
    square = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    if shape == "plane":
        yield np.column_stack([square * size[:2], np.zeros(4)]), np.array([0.0, 0.0, 1.0])
    elif shape == "box":
        for axis in range(3):
            others = [k for k in range(3) if k != axis]
            for sign in (-1.0, 1.0):
                corners = np.full((4, 3), sign * size[axis])
                corners[:, others] = square * size[others]
                yield corners, sign * np.eye(3)[axis]
    else:
        angles = np.linspace(0.0, 2.0 * math.pi, 49)
        ring = np.column_stack([np.cos(angles), np.sin(angles)]) * size[0]
        for sign in (-1.0, 1.0):
            yield np.column_stack([ring, np.full(49, sign * size[1])]), np.array([0.0, 0.0, sign])
        for a, b in itertools.pairwise(ring):
            corners = np.array([[*a, -size[1]], [*b, -size[1]], [*b, size[1]], [*a, size[1]]])
            yield corners, np.array([*(a + b), 0.0]) / np.linalg.norm(a + b)


def side_view(
    arm: Arm,
    q: Sequence[float],
    obstacles: Obstacles,
    aspect: float,
    margin: float = 0.08,
    azimuth: float = 112.0,
    elevation: float = -14.0,
    more: Sequence[Array] = (),
) -> View:
    """A view from the side and a little from above that shows arm, obstacles and points; aspect: width by height."""
    points = [point for tube in tubes(arm, q) for point in (tube.start, tube.end)]
    points += [corner for face in faces(obstacles) for corner in face.corners if face.shape != "plane"]
    points += [np.array([0.0, 0.0, floor_height(obstacles)]), *more]
    view = View(azimuth=azimuth, elevation=elevation, centre=np.zeros(3), width=1.0, height=1.0)
    projected = view.project(np.array(points))
    low, high = projected.min(axis=0), projected.max(axis=0)
    centre = ((low + high) / 2.0) @ view.axes[:2]
    width, height = high - low + 2.0 * margin
    width = max(width, height * aspect)
    return view._replace(centre=centre, width=float(width), height=float(width / aspect))


def floor_height(obstacles: Obstacles) -> float:
    """Height of the floor, at the bottom of the lowest obstacle, m."""
    return min([float(face.corners[:, 2].min()) for face in faces(obstacles)], default=-0.2)


def render(
    arm: Arm,
    q: Sequence[float],
    obstacles: Obstacles,
    view: View,
    gl: Sequence[str] = GL,
    moved: tuple[World, Sequence[ObjectState]] | None = None,
) -> NDArray[np.uint8] | None:
    """The scene rendered by MuJoCo in a separate process, because a broken OpenGL can crash it.

    Parameters
    ----------
    arm, q, obstacles : the scene, q in rad.
    view : the camera.
    gl : values of MUJOCO_GL to try in this order.
    moved : the world with the states of its objects; without it the obstacles alone are drawn.

    Returns
    -------
    (height, width, 3) or None
        RGB; None if none of them works.
    """
    scene = {
        "xml": mjcf(arm, 0.001, moved[0] if moved else World(obstacles, NO_SPRINGS), no_effects(arm)),
        "joints": dict(zip(arm.joints.names, map(float, q), strict=True)),
        "objects": _placed(*moved) if moved else [],
        "azimuth": view.azimuth,
        "elevation": view.elevation,
        "centre": view.centre.tolist(),
        "extent": view.height,
        "size": [round(view.width * LAYOUT.pixels_per_metre), round(view.height * LAYOUT.pixels_per_metre)],
        "floor": floor_height(obstacles),
        "pedestal": LAYOUT.pedestal,
        "colours": {
            **{name: to_rgb(TUBE_COLOURS[i % len(TUBE_COLOURS)]) for i, name in enumerate(arm.covers.names)},
            **{name: to_rgb(BLOCK_COLOUR) for name in obstacles.names},
            **{
                name: to_rgb(OBJECT_COLOUR)
                for name in (moved[0].objects if moved else ())
                if name not in obstacles.names
            },
            "pedestal": to_rgb(PEDESTAL_COLOUR),
        },
    }
    here = str(Path(__file__).resolve().parents[1])
    paths = os.pathsep.join(filter(None, [here, os.environ.get("PYTHONPATH", "")]))
    with tempfile.TemporaryDirectory() as directory:
        picture = Path(directory) / "picture.npy"
        for name in gl:
            try:
                done = subprocess.run(
                    [sys.executable, "-m", "wam_analysis.arm_render", str(picture)],
                    input=json.dumps(scene).encode(),
                    env={**os.environ, "MUJOCO_GL": name, "PYTHONPATH": paths},
                    cwd=directory,
                    capture_output=True,
                    timeout=LAYOUT.render_timeout,
                    check=False,
                )
            except (OSError, subprocess.TimeoutExpired):
                continue
            if done.returncode == 0 and picture.is_file():
                pixels: NDArray[np.uint8] = np.load(picture)
                if np.ptp(pixels) > 0:
                    return pixels
    return None


def _placed(world: World, states: Sequence[ObjectState]) -> list[dict[str, object]]:
    """Where the objects are, as `wam_analysis.arm_render` reads it."""
    return [
        {
            "name": name,
            "hinge": hinge_name(name) if math.isfinite(state.angle) else "",
            "angle": state.angle if math.isfinite(state.angle) else 0.0,
            "pose": [state.x, state.y, state.z, state.qw, state.qx, state.qy, state.qz],
        }
        for name, state in zip(world.objects, states, strict=True)
    ]


def draw(axes: Axes, arm: Arm, q: Sequence[float], obstacles: Obstacles, view: View) -> None:
    """The scene drawn by matplotlib: obstacles as shaded faces, covers with their true radii."""
    floor = floor_height(obstacles)
    for tube in tubes(arm, q):
        shadow = [np.array([*end[:2], floor]) for end in (tube.start, tube.end)]
        _stadium(axes, view.project(np.array(shadow)), tube.radius, facecolor="#e9ebee", edgecolor="none", zorder=1)
    forward = view.axes[2]
    for face in faces(obstacles):
        if face.normal @ forward < 0.0:
            shade = 0.78 + 0.22 * max(float(face.normal @ LIGHT), 0.0)
            colour = tuple(shade * channel for channel in to_rgb(BLOCK_COLOUR))
            corners = view.project(face.corners)
            edge = colour if face.shape == "cylinder" and len(corners) == 4 else "#8a6f3a"
            zorder = 2 if face.shape == "plane" else 3
            axes.add_patch(Polygon(corners, facecolor=colour, edgecolor=edge, linewidth=0.6, zorder=zorder))
    _draw_pedestal(axes, view, floor)
    order = sorted(tubes(arm, q), key=lambda tube: -float((tube.start + tube.end) @ forward))
    for depth, tube in enumerate(order):
        _draw_tube(axes, view, tube, 4.1 + 0.1 * depth)


def _draw_pedestal(axes: Axes, view: View, floor: float) -> None:
    """A rounded pillar, cut off at the floor."""
    pillar = Tube(np.array([0.0, 0.0, floor]), np.zeros(3), LAYOUT.pedestal, PEDESTAL_COLOUR)
    angles = np.linspace(0.0, 2.0 * math.pi, 73)
    ring = LAYOUT.pedestal * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(73)]) + pillar.start
    foot = view.project(ring)
    order = np.argsort(foot[:, 0])
    front = foot[order][foot[order, 1] <= float(np.mean(foot[:, 1])) + 1e-9]
    above = [[front[-1, 0], view.height], [front[0, 0], view.height]]
    _draw_tube(axes, view, pillar, 4.0, Polygon([*front, *above], transform=axes.transData))
    axes.plot(front[:, 0], front[:, 1], color=OUTLINE, lw=0.9, zorder=4.0)


def _draw_tube(axes: Axes, view: View, tube: Tube, zorder: float, inside: Polygon | None = None) -> None:
    """A tube with the shading of a cylinder: nested stadiums, brighter towards the light."""
    ends = view.project(np.array([tube.start, tube.end]))
    light = view.axes[:2] @ LIGHT
    colour = np.array(to_rgb(tube.colour))
    rim = {"facecolor": colour * 0.82, "edgecolor": OUTLINE, "linewidth": 0.9}
    _stadium(axes, ends, tube.radius, inside, zorder=zorder, **rim)
    for part in np.linspace(0.05, 0.9, 18):
        bright = colour * (0.82 + 0.18 * part) + (1.0 - colour) * 0.35 * part**2
        at = ends + 0.55 * part * tube.radius * light
        _stadium(axes, at, tube.radius * (1.0 - part), inside, facecolor=bright, edgecolor="none", zorder=zorder)


def _stadium(axes: Axes, ends: Array, radius: float, inside: Polygon | None = None, **style: Any) -> None:
    begin, end = ends
    angle = math.atan2(end[1] - begin[1], end[0] - begin[0])
    half = np.linspace(-math.pi / 2.0, math.pi / 2.0, 25)
    caps = [
        point + radius * np.column_stack([np.cos(angle + half + turn), np.sin(angle + half + turn)])
        for point, turn in ((end, 0.0), (begin, math.pi))
    ]
    patch = axes.add_patch(Polygon(np.vstack(caps), **style))
    if inside is not None:
        patch.set_clip_path(inside)
