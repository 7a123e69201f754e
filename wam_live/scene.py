"""The three-dimensional picture of the page: links, surroundings, contacts, and links that can be dragged.

It is drawn from the parameters of the driver alone, so that every configuration draws itself.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
import trimesh
import viser
from viser.transforms import SO3

from wam_analysis.drawing import (
    BLOCK_COLOUR,
    COLOURS,
    HAND,
    LIKELY,
    OBJECT_COLOUR,
    PEDESTAL_COLOUR,
    TUBE_COLOURS,
    channels,
)
from wam_analysis.thresholds import LAYOUT
from wam_bag.arrays import Numbers
from wam_description.arm import Arm
from wam_description.parameters import rows
from wam_description.rigid_body import RigidBody
from wam_description.signals import Contact, LikelyRange, Wrench
from wam_description.world import Solid, World
from wam_live.snapshot import Snapshot, size
from wam_live.thresholds import LIVE

ARROWS = {"true": (0.011, 0.02), "estimated": (0.006, 0.026)}  # m, radii of shaft and head: both are seen at one point

Quaternion = tuple[float, float, float, float]  # w x y z


class Grip(NamedTuple):
    """Where a drag holds a cover, m, in its frame: the point, and the ends of the axis of its tube, (3,) each."""

    cover: str
    point: Numbers
    start: Numbers
    end: Numbers


class Drag(NamedTuple):
    """A drag as a browser, by its number, reports it: what it holds, and its pointer in the base frame, (3,), m."""

    client: int
    grip: Grip
    pointer: Numbers


class Scene:
    """The arm in its surroundings.

    Parameters
    ----------
    server : that shows it.
    arm, world : as the driver's parameters have them.
    draggable : whether links can be dragged; in a recording they cannot.

    Attributes
    ----------
    links, objects : frames of the covers by name, and of the objects of the world in their order.
    """

    def __init__(self, server: viser.ViserServer, arm: Arm, world: World, draggable: bool) -> None:
        self._scene, self._arm, self._draggable = server.scene, arm, draggable
        self._body = RigidBody(arm)
        self._q = list(arm.joints.start)
        self._drag: Drag | None = None  # of the browser: its thread replaces it as one, the drawing reads it once
        self._scene.set_up_direction("+z")
        # shadows and the environment map take most of the time of a browser that draws by software
        self._scene.configure_default_lights(cast_shadow=False)
        self._scene.configure_environment_map(hdri=None)
        self._scene.add_light_ambient("/light", intensity=1.2)
        self.links = {name: self._add_link(i, name) for i, name in enumerate(arm.covers.names)}
        self.objects = [self._scene.add_frame(f"/world/{name}", show_axes=False) for name in world.objects]
        self._add_surroundings(world)
        self._arrows = {name: self._add_arrow(name) for name in ("true", "estimated")}
        self._place = self._scene.add_icosphere(
            "/contact/place", 0.02, lit(COLOURS["estimated"]), visible=False, cast_shadow=False
        )
        self._bands = [
            self._scene.add_cylinder(
                f"/contact/likely{i}", 0.055, 1.0, channels(LIKELY), opacity=0.35, visible=False, cast_shadow=False
            )
            for i in range(len(arm.covers.names))
        ]
        self._band = self._scene.add_arrows(
            "/hand", np.zeros((1, 2, 3)), channels(HAND), shaft_radius=0.006, head_radius=0.016, head_length=0.04,
            visible=False,
        )  # fmt: skip
        self.show(Snapshot(q=tuple(self._q)))

    def show(self, snapshot: Snapshot) -> None:
        """Draw an instant; a change of the drawing, none of the run."""
        if len(snapshot.q) == len(self._arm.joints.names):
            self._q = list(snapshot.q)
            for name, frame in self.links.items():
                pose = self._body.cover_pose(self._q, name)
                frame.position, frame.wxyz = pose.position, quaternion(pose.rotation)
        for frame, state in zip(self.objects, snapshot.objects, strict=False):
            frame.position = (state.x, state.y, state.z)
            frame.wxyz = (state.qw, state.qx, state.qy, state.qz)
        self._show_arrow("true", snapshot.true)
        self._show_arrow("estimated", snapshot.estimated)
        self._show_likely(snapshot.likely)
        self._show_hand()

    def point(self, cover: str, place: float) -> Numbers:
        """Base coordinates, (3,), m, of a position along a cover."""
        return self._body.point(self._q, cover, (place, 0.0, 0.0))

    # drawn once

    def _add_link(self, i: int, name: str) -> Any:
        covers = self._arm.covers
        start, end = (np.array(ends[3 * i : 3 * i + 3]) for ends in (covers.start, covers.end))
        frame = self._scene.add_frame(f"/arm/{name}", show_axes=False)
        length = float(np.linalg.norm(end - start))
        capsule = trimesh.creation.capsule(length, covers.radius[i], count=(24, 24))
        capsule.apply_translation((0.0, 0.0, -capsule.bounds.mean(axis=0)[2]))  # about its middle in every version
        tube = self._scene.add_mesh_simple(
            f"/arm/{name}/tube",
            np.asarray(capsule.vertices),
            np.asarray(capsule.faces),
            color=channels(TUBE_COLOURS[i % len(TUBE_COLOURS)]),
            position=tuple(0.5 * (start + end)),
            wxyz=quaternion(turn_from_z(end - start)),
            cast_shadow=False,
        )
        if self._draggable:
            tube.on_drag("left")(self._dragged(name, (start, end)))
        return frame

    def _add_surroundings(self, world: World) -> None:
        for one in rows(world.obstacles):
            if one.name not in world.moving:
                turn = quaternion(pin.rpy.rpyToMatrix(*one.rotation))
                solid = Solid(one.name, one.shape, one.size, one.position)
                self._add_solid(f"/world/{one.name}", solid, BLOCK_COLOUR, turn)
        for solid in world.solids:
            colour = BLOCK_COLOUR if solid.name in world.moving else OBJECT_COLOUR
            self._add_solid(f"/world/{solid.name}/mesh", solid, colour)
        self._scene.add_cylinder(
            "/world/pedestal", LAYOUT.pedestal, -LAYOUT.floor, channels(PEDESTAL_COLOUR),
            position=(0, 0, 0.5 * LAYOUT.floor), cast_shadow=False,
        )  # fmt: skip
        self._scene.add_grid("/world/floor", 4.0, 4.0, position=(0.0, 0.0, LAYOUT.floor), cell_size=0.2)

    def _add_solid(self, path: str, solid: Solid, colour: str, turn: Quaternion = (1.0, 0.0, 0.0, 0.0)) -> None:
        look, size = channels(colour), solid.size
        place: dict[str, Any] = {"position": solid.centre, "wxyz": turn, "cast_shadow": False}
        if solid.shape == "ball":
            self._scene.add_icosphere(path, size[0], look, **place)
        elif solid.shape == "cylinder":
            self._scene.add_cylinder(path, size[0], 2.0 * size[1], look, **place)
        else:
            thick = size[2] if solid.shape == "box" else 0.002
            self._scene.add_box(path, look, (2.0 * size[0], 2.0 * size[1], 2.0 * thick), **place)

    def _add_arrow(self, name: str) -> Any:
        shaft, head = ARROWS[name]
        return self._scene.add_arrows(
            f"/contact/{name}", np.zeros((1, 2, 3)), lit(COLOURS[name]), shaft_radius=shaft, head_radius=head,
            head_length=0.05, visible=False,
        )  # fmt: skip

    # drawn at each instant

    def _show_arrow(self, name: str, contact: Contact) -> None:
        """An arrow from where the world pushes, in the direction in which it pushes the arm."""
        arrow = self._arrows[name]
        length = LAYOUT.metres_per_newton * size(contact.force)
        known = contact.cover in self.links and math.isfinite(contact.position) and length > 1e-3
        if known:
            pose = self._body.cover_pose(self._q, contact.cover)
            start = self.point(contact.cover, contact.position)
            scale = min(length, LIVE.longest_arrow) / length * LAYOUT.metres_per_newton
            end = start + scale * pose.rotation @ np.array(contact.force)
            arrow.points = np.array([[start, end]], dtype=np.float32)
            if name == "estimated":
                self._place.position = start
        arrow.visible = known
        if name == "estimated":
            self._place.visible = known

    def _show_likely(self, likely: Sequence[LikelyRange]) -> None:
        parts = [part for part in likely if part.cover in self.links and part.high > part.low]
        for band, part in itertools.zip_longest(self._bands, parts[: len(self._bands)]):
            band.visible = part is not None
            if part is None:
                continue
            ends = self.point(part.cover, part.low), self.point(part.cover, part.high)
            band.position, band.height = 0.5 * (ends[0] + ends[1]), part.high - part.low
            band.wxyz = quaternion(turn_from_z(ends[1] - ends[0]))

    # dragging

    def _dragged(self, cover: str, axis: tuple[Numbers, Numbers]) -> Callable[[Any], Any]:
        async def take(event: Any) -> None:  # an async callback: others run in a pool, out of order
            drag = self._drag
            is_own = drag is not None and (drag.client, drag.grip.cover) == (event.client_id, cover)
            if event.phase == "end":  # viser reports it where the browser is gone, too
                self._drag = None if is_own else drag
                return
            if event.phase == "start" and drag is None:
                pose = self._body.cover_pose(self._q, cover)
                point = pose.rotation.T @ (np.array(event.start_position) - pose.position)
                grip = Grip(cover, point, *axis)
            elif drag is not None and is_own:
                grip = drag.grip
            else:
                return  # late, of a drag that is over, or another browser holds a link
            self._drag = Drag(event.client_id, grip, np.array(event.end_position))

        return take

    def push(self) -> Wrench | None:
        """Return the push of the present drag, None where nobody drags."""
        drag = self._drag
        if drag is None:
            return None
        pose = self._body.cover_pose(self._q, drag.grip.cover)
        return band_push(drag.grip, pose.rotation.T @ (drag.pointer - pose.position))

    def _show_hand(self) -> None:
        drag = self._drag
        self._band.visible = drag is not None
        if drag is not None:
            point = self._body.point(self._q, drag.grip.cover, drag.grip.point)
            self._band.points = np.array([[point, drag.pointer]], dtype=np.float32)
            # viser draws an arrow of its own in another colour at the pointer that drags; this one is around it
            length = min(float(np.linalg.norm(drag.pointer - point)), LIVE.longest_head)
            self._band.head_length, self._band.head_radius = 0.22 * length, 0.06 * length


def band_push(grip: Grip, pointer: Numbers) -> Wrench:
    """Push of a rubber band between where a cover is gripped and the pointer, (3,), m, in the cover's frame.

    It acts at the cover's axis, at the position of the grip along it, and across the axis only, as contacts do that the
    estimator is made for: no torque about the axis, no force along it.
    """
    along = (grip.end - grip.start) / np.linalg.norm(grip.end - grip.start)
    at = grip.start + along * np.clip(along @ (grip.point - grip.start), 0.0, along @ (grip.end - grip.start))
    stretch = pointer - grip.point
    force = LIVE.stiffness * (stretch - along * (along @ stretch))
    force *= min(1.0, LIVE.strongest / max(float(np.linalg.norm(force)), 1e-9))
    fx, fy, fz = force.tolist()
    tx, ty, tz = np.cross(at, force).tolist()
    return Wrench(grip.cover, (fx, fy, fz), (tx, ty, tz))


def lit(colour: str) -> tuple[int, int, int]:
    """Red, green and blue of a thing that is to be seen in a colour under the lights of the page."""
    red, green, blue = (round(255.0 * (part / 255.0) ** LIVE.deeper) for part in channels(colour))
    return red, green, blue


def quaternion(rotation: Numbers) -> Quaternion:
    """Quaternion w x y z of a rotation matrix; pinocchio's would lose 40 bytes of memory in each call."""
    w, x, y, z = SO3.from_matrix(rotation).wxyz.tolist()
    return w, x, y, z


def turn_from_z(direction: Numbers) -> Numbers:
    """A rotation matrix that turns z into a direction."""
    unit = np.asarray(direction, dtype=float) / float(np.linalg.norm(direction))
    turned: Numbers = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), unit).toRotationMatrix()
    return turned
