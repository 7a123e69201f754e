"""Loads on the covers: pushes that are applied to them, and the sum of everything that acts on each."""

import math
from collections.abc import Iterator, Sequence
from functools import partial, reduce
from itertools import chain
from operator import add
from struct import Struct
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco import mj_applyFT

from wam_description.arm import Arm
from wam_description.contact_pairs import folded
from wam_description.parameters import rows
from wam_description.signals import Load
from wam_description.small_matrices import cross
from wam_description.world import Springs
from wam_driver.thresholds import PLANT


class SpringOnCover(NamedTuple):
    """A spring with a lever on the link of a cover."""

    tendon: int
    cover: str
    lever: float  # m
    rest: float  # length of the tendon at which the spring is not pressed, m
    bilateral: bool


class PartialLoad(NamedTuple):
    """One of the forces that make a load, in the cover's frame."""

    force: np.ndarray  # N
    moment: np.ndarray  # about the frame's origin, N m
    position: float  # where it acts along the cover, m


class CoverFrame(NamedTuple):
    """Where a cover is; views into MuJoCo's memory: to fetch them in each step costs more than a push."""

    rotation: np.ndarray  # (3, 3)
    origin: np.ndarray  # (3,) m, in the base frame
    body: int


class AppliedPush(NamedTuple):
    """A push on a cover, as it is applied and as it is measured."""

    site: int  # the frame of the cover
    body: int
    force: list[float]  # (3,) N, in the frame of the cover
    torque: list[float]  # (3,) N m, about its origin
    load: PartialLoad
    words: str  # how hard it pushes on which cover


class CoverLoads:
    """What acts on the covers: contacts, springs and pushes.

    Parameters
    ----------
    model, data : of MuJoCo.
    arm : its covers.
    springs : those of the world.

    Attributes
    ----------
    pushes : on each cover that is pushed; the dictionary remains the same one, which the steps in C read.
    """

    def __init__(self, model: Any, data: Any, arm: Arm, springs: Springs) -> None:
        self._model, self._data = model, data
        covers = arm.covers
        self._site = {name: model.site(f"{name}_frame").id for name in covers.names}
        self._frame = {
            name: CoverFrame(data.site_xmat[site].reshape(3, 3), data.site_xpos[site], model.body(link).id)
            for (name, site), link in zip(self._site.items(), covers.links, strict=True)
        }
        self._applied = data.qfrc_applied
        present = {model.geom(i).name for i in range(model.ngeom)}
        geoms = {geom: name for name in covers.names for geom in (name, folded(name)) if geom in present}
        self._cover_of_geom = {model.geom(geom).id: name for geom, name in geoms.items()}
        self._springs = list(_springs_on_covers(model, arm, springs))
        self.pushes: dict[str, AppliedPush] = {}
        turned = np.zeros(6)
        self._turned = turned[:3], turned[3:]  # force and torque of a push in the base frame
        self._turn = partial(Struct("6d").pack_into, turned.data, 0)

    def push(self, cover: str, force: Sequence[float], torque: Sequence[float]) -> None:
        """Push on a cover, see `Plant.push`."""
        if cover not in self._frame:
            raise ValueError(f"no cover is named '{cover}'; covers: {', '.join(self._frame)}")
        if cover in self.pushes and self.pushes[cover][2:4] == (list(force), list(torque)):
            return  # most often
        if any(force) or any(torque):
            pushed, turned = np.array(force, float), np.array(torque, float)
            (_, fy, fz), (_, ty, tz) = at_frame = pushed.tolist(), turned.tolist()
            square = fy * fy + fz * fz  # a force along x passes through every position
            position = (fy * tz - fz * ty) / square if square > 0.0 else math.nan
            load = PartialLoad(pushed, turned, position)
            size, unit = (force, "N") if any(force) else (torque, "N m")
            words = f"{math.hypot(*size):.4g} {unit} on {cover}"
            self.pushes[cover] = AppliedPush(self._site[cover], self._frame[cover].body, *at_frame, load, words)
        else:
            self.pushes.pop(cover, None)

    def release(self) -> None:
        """End every push."""
        self.pushes.clear()

    def pushes_in_words(self) -> str:
        """How hard which covers are pushed; '' where none is."""
        return ", ".join([push.words for push in self.pushes.values()])

    def apply_pushes(self) -> None:
        """Add the pushes to MuJoCo's applied forces, between the two halves of a step."""
        for cover, (_, body, (x, y, z), (u, v, w), *_) in self.pushes.items():
            frame = self._frame[cover]
            (a, b, c), (d, e, f), (g, h, i) = frame.rotation.tolist()
            self._turn(
                a * x + b * y + c * z,
                d * x + e * y + f * z,
                g * x + h * y + i * z,
                a * u + b * v + c * w,
                d * u + e * v + f * w,
                g * u + h * v + i * w,
            )
            mj_applyFT(self._model, self._data, *self._turned, frame.origin, body, self._applied)

    def measure(self) -> list[Load]:
        """What the world does to each touched, sprung or pushed cover, in the order of the arm's covers."""
        if not (self._data.ncon or self.pushes or self._springs):
            return []
        parts: dict[str, list[PartialLoad]] = {name: [] for name in self._frame}
        for cover, part in chain(self._contacts(), self._pushed(), self._sprung()):
            parts[cover].append(part)
        loads = (_sum(cover, on_cover) for cover, on_cover in parts.items())
        return [load for load in loads if load is not None]

    def sunk(self) -> str:
        """Which cover is too deep in what it touches for a contact force, and what to do; '' where none is.

        Where the axis of a tube passes through an edge, MuJoCo takes the face that is nearest to the axis: the force
        jumps to one along the tube, and deeper in there is none.  What touches the side of a tube pushes across it.
        Beyond the middle of an object the nearest face is the one behind it, and the force changes its sign.
        """
        data, sizes = self._data, self._model.geom_size
        for i in range(data.ncon):
            pair = data.contact.geom[i].tolist()
            for geom, other, sign in zip(pair, reversed(pair), (1.0, -1.0), strict=True):
                depth, (radius, half, _) = -float(data.contact.dist[i]), sizes[geom].tolist()
                if geom not in self._cover_of_geom or depth <= radius:
                    continue
                deepest = radius + PLANT.middle * half_lengths(self._model, other).min()
                is_solid = self._model.geom_type[other] != mujoco.mjtGeom.mjGEOM_PLANE
                if is_solid and depth > deepest:
                    return (
                        f"{self._cover_of_geom[geom]} is {depth * 1e3:.3g} mm deep in {self._model.geom(other).name}; "
                        f"allowed: {deepest * 1e3:.3g} mm, as beyond its middle the contact force would push to the "
                        "other side; press less, or on a stiffer surface"
                    )
                normal, axis = data.contact.frame[i][:3], data.geom_xmat[geom].reshape(3, 3)[:, 2]
                nearest = data.contact.pos[i] - sign * (radius - 0.5 * depth) * normal  # point of the axis
                if (
                    abs(normal @ axis) > PLANT.least_normal
                    and abs((nearest - data.geom_xpos[geom]) @ axis) < 0.99 * half
                ):
                    return (
                        f"{self._cover_of_geom[geom]} is {depth * 1e3:.3g} mm deep in an edge, where the direction of "
                        f"the contact force is unknown; allowed: {radius * 1e3:.3g} mm, the radius of the tube; "
                        "press less, or on a stiffer surface"
                    )
        return ""

    def _contacts(self) -> Iterator[tuple[str, PartialLoad]]:
        data = self._data
        for i in range(data.ncon):
            first, second = data.contact.geom[i].tolist()
            for geom, sign in ((second, 1.0), (first, -1.0)):  # none between objects, both between links
                if geom in self._cover_of_geom:
                    cover = self._cover_of_geom[geom]
                    force = self._frame[cover].rotation.T.dot(sign * contact_force(self._model, data, i))
                    yield self._part(cover, force, data.contact.pos[i])

    def _pushed(self) -> Iterator[tuple[str, PartialLoad]]:
        for cover, push in self.pushes.items():
            yield cover, push.load

    def _sprung(self) -> Iterator[tuple[str, PartialLoad]]:
        data = self._data
        for tendon, cover, lever, rest, bilateral in self._springs:
            squeeze = rest - float(data.ten_length[tendon])
            if squeeze > 0.0 or bilateral:
                frame = self._frame[cover]
                along, across = data.xmat[frame.body].reshape(3, 3).T[:2]
                force = frame.rotation.T @ across * (squeeze * float(self._model.tendon_stiffness[tendon]))
                yield self._part(cover, force, data.xpos[frame.body] + lever * along)

    def _part(self, cover: str, force: np.ndarray, place: np.ndarray) -> tuple[str, PartialLoad]:
        """The load of a force in the frame of its cover, (3,), N, at a place in the base frame, (3,), m."""
        rotation, origin, _ = self._frame[cover]
        at = rotation.T.dot(place - origin)
        return cover, PartialLoad(force, np.array(cross(at.tolist(), force.tolist())), float(at[0]))


def _sum(cover: str, parts: Sequence[PartialLoad]) -> Load | None:
    """All forces on a cover as one load, at their mean position weighted by force; None if there is no force."""
    weights = [math.sqrt(part.force.dot(part.force)) for part in parts]
    whole = sum(weights, 0.0)
    if not whole > 0.0:
        return None
    place = sum((w * part.position for w, part in zip(weights, parts, strict=True)), 0.0) / whole
    force, moment = reduce(add, (part.force for part in parts)), reduce(add, (part.moment for part in parts))
    return Load(cover, place, tuple(force.tolist()), tuple(moment.tolist()))


def contact_force(model: Any, data: Any, i: int) -> np.ndarray:
    """Force of contact i on its second geom, (3,), N, in the base frame."""
    wrench = np.zeros(6)
    mujoco.mj_contactForce(model, data, i, wrench)
    force: np.ndarray = data.contact.frame[i].reshape(3, 3).T.dot(wrench[:3])
    return force


def half_lengths(model: Any, geom: int) -> np.ndarray:
    """From the surface of a geom of MuJoCo to its middle along its axes, (3,), m; of a plane its size."""
    x, y, z = model.geom_size[geom].tolist()
    kind = model.geom_type[geom]
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return np.array((x, x, x))
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return np.array((x, x, x + y))
    return np.array((x, x, y) if kind == mujoco.mjtGeom.mjGEOM_CYLINDER else (x, y, z))


def _springs_on_covers(model: Any, arm: Arm, springs: Springs) -> Iterator[SpringOnCover]:
    tendons = range(2 * len(arm.motors.names), model.ntendon)  # after the strands of the cables
    for tendon, spring in zip(tendons, springs.present, strict=True):
        if cover := sprung_cover(arm, spring.joint):
            rest = spring.lever * spring.rest
            yield SpringOnCover(tendon, cover.name, spring.lever, rest, spring.bilateral)


def sprung_cover(arm: Arm, joint: str) -> Any:
    """The first cover of the link of a joint; None where it has none."""
    link = arm.links.names[arm.joints.names.index(joint)]
    return next((cover for cover in rows(arm.covers) if cover.link == link), None)
