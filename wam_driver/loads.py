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


class PartialLoad(NamedTuple):
    """One of the forces that make a load, in the cover's frame."""

    force: np.ndarray  # N
    moment: np.ndarray  # about the frame's origin, N m
    position: float  # where it acts along the cover, m


class CoverFrame(NamedTuple):
    """Where a cover is; views into MuJoCo's memory: to fetch them in each step costs more than a push."""

    site: int
    rotation: np.ndarray  # (3, 3)
    origin: np.ndarray  # (3,) m, in the base frame
    body: int


class AppliedPush(NamedTuple):
    """A push on a cover."""

    site: int  # the frame of the cover
    body: int
    force: list[float]  # (3,) N, in the frame of the cover
    torque: list[float]  # (3,) N m, about its origin


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
        self._frame: dict[str, CoverFrame] = {}
        for name, link in zip(arm.covers.names, arm.covers.links, strict=True):
            site = model.site(f"{name}_frame").id
            rotation, origin = data.site_xmat[site].reshape(3, 3), data.site_xpos[site]
            self._frame[name] = CoverFrame(site, rotation, origin, model.body(link).id)
        self._applied = data.qfrc_applied
        owners = {geom: name for name in arm.covers.names for geom in (name, folded(name))}
        geoms = {i: model.geom(i).name for i in range(model.ngeom)}
        self._cover_of_geom = {i: owners[geom] for i, geom in geoms.items() if geom in owners}
        tendons = enumerate(springs.present, 2 * arm.n)  # after the strands of the cables
        self._springs = [(tendon, sprung_cover(arm, spring.joint), spring) for tendon, spring in tendons]
        self.pushes: dict[str, AppliedPush] = {}
        turned = np.zeros(6)
        self._turned = turned[:3], turned[3:]  # force and torque of a push in the base frame
        self._turn = partial(Struct("6d").pack_into, turned.data, 0)

    def push(self, cover: str, force: Sequence[float], torque: Sequence[float]) -> None:
        """Push on a cover, see `Plant.push`."""
        if cover not in self._frame:
            raise ValueError(f"no cover is named '{cover}'; covers: {', '.join(self._frame)}")
        if any(force) or any(torque):
            frame = self._frame[cover]
            self.pushes[cover] = AppliedPush(frame.site, frame.body, list(map(float, force)), list(map(float, torque)))
        else:
            self.pushes.pop(cover, None)

    def release(self) -> None:
        """End every push."""
        self.pushes.clear()

    def pushes_in_words(self) -> list[str]:
        """How hard each cover is pushed that is pushed."""
        each = self.pushes.items()
        sizes = {cover: (push.force, "N") if any(push.force) else (push.torque, "N m") for cover, push in each}
        return [f"{math.hypot(*size):.4g} {unit} on {cover}" for cover, (size, unit) in sizes.items()]

    def apply_pushes(self) -> None:
        """Add the pushes to MuJoCo's applied forces, between the two halves of a step."""
        for cover, (_, body, (x, y, z), (u, v, w)) in self.pushes.items():
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
        return list(filter(None, map(_sum, parts, parts.values())))

    def sunk(self) -> str:
        """Which cover is too deep in what it touches for a contact force, and what to do; '' where none is.

        Where the axis of a tube passes through an edge, MuJoCo takes the face that is nearest to the axis: the force
        jumps to one along the tube, and deeper in there is none.  What touches the side of a tube pushes across it.
        Beyond the middle of an object the nearest face is the one behind it, and the force changes its sign.
        """
        data, model = self._data, self._model
        for i, geom, other, sign in sides(data):
            depth, (radius, half, _) = -float(data.contact.dist[i]), model.geom_size[geom].tolist()
            if geom not in self._cover_of_geom or depth <= radius:
                continue
            found = f"{self._cover_of_geom[geom]} is {depth * 1e3:.3g} mm deep in"
            deepest = radius + PLANT.middle * model.geom_aabb[other, 3:].min()  # half sizes, huge for a plane
            if depth > deepest:
                return (
                    f"{found} {model.geom(other).name}; allowed: {deepest * 1e3:.3g} mm, as beyond its middle the "
                    "contact force would push to the other side; press less, or on a stiffer surface"
                )
            normal, axis = data.contact.frame[i][:3], data.geom_xmat[geom].reshape(3, 3)[:, 2]
            nearest = data.contact.pos[i] + sign * (radius - 0.5 * depth) * normal  # point of the axis
            if abs(normal @ axis) > PLANT.least_normal and abs((nearest - data.geom_xpos[geom]) @ axis) < 0.99 * half:
                return (
                    f"{found} an edge, where the direction of the contact force is unknown; allowed: "
                    f"{radius * 1e3:.3g} mm, the radius of the tube; keep off it, press less, or use a stiffer surface"
                )
        return ""

    def _contacts(self) -> Iterator[tuple[str, PartialLoad]]:
        data = self._data
        for i, geom, _, sign in sides(data):
            if geom in self._cover_of_geom:
                cover = self._cover_of_geom[geom]
                force = self._frame[cover].rotation.T.dot(sign * contact_force(self._model, data, i))
                yield self._part(cover, force, data.contact.pos[i])

    def _pushed(self) -> Iterator[tuple[str, PartialLoad]]:
        for cover, (_, _, force, torque) in self.pushes.items():
            (_, fy, fz), (_, ty, tz) = force, torque
            square = fy * fy + fz * fz  # a force along x passes through every position
            position = (fy * tz - fz * ty) / square if square > 0.0 else math.nan
            yield cover, PartialLoad(np.array(force), np.array(torque), position)

    def _sprung(self) -> Iterator[tuple[str, PartialLoad]]:
        data = self._data
        for tendon, cover, spring in self._springs:
            squeeze = spring.lever * spring.rest - float(data.ten_length[tendon])
            if cover and (squeeze > 0.0 or spring.bilateral):
                frame = self._frame[cover.name]
                along, across = data.xmat[frame.body].reshape(3, 3).T[:2]
                force = frame.rotation.T @ across * (squeeze * float(self._model.tendon_stiffness[tendon]))
                yield self._part(cover.name, force, data.xpos[frame.body] + spring.lever * along)

    def _part(self, cover: str, force: np.ndarray, place: np.ndarray) -> tuple[str, PartialLoad]:
        """The load of a force in the frame of its cover, (3,), N, at a place in the base frame, (3,), m."""
        _, rotation, origin, _ = self._frame[cover]
        at = rotation.T.dot(place - origin)
        return cover, PartialLoad(force, np.array(cross(at.tolist(), force.tolist())), float(at[0]))


def _sum(cover: str, parts: Sequence[PartialLoad]) -> Load | None:
    """All forces on a cover as one load, at their mean position weighted by force; None if there is no force."""
    weights = [math.sqrt(part.force.dot(part.force)) for part in parts]
    if not sum(weights) > 0.0:
        return None
    # a force along the tube is anywhere, a torque alone nowhere
    placed = [(w, one.position) for w, one in zip(weights, parts, strict=True) if w and not math.isnan(one.position)]
    place = sum((w * x for w, x in placed), 0.0) / sum((w for w, _ in placed), 0.0) if placed else math.nan
    force, moment = reduce(add, (part.force for part in parts)), reduce(add, (part.moment for part in parts))
    return Load(cover, place, tuple(force.tolist()), tuple(moment.tolist()))


def sides(data: Any) -> Iterator[tuple[int, int, int, float]]:
    """Both sides of every contact of MuJoCo: its index, the geom, the other geom, the sign of the force on the geom."""
    for i, (first, second) in enumerate(data.contact.geom.tolist()):
        yield i, first, second, -1.0
        yield i, second, first, 1.0


def contact_force(model: Any, data: Any, i: int) -> np.ndarray:
    """Force of contact i on its second geom, (3,), N, in the base frame."""
    wrench = np.zeros(6)
    mujoco.mj_contactForce(model, data, i, wrench)
    force: np.ndarray = data.contact.frame[i].reshape(3, 3).T.dot(wrench[:3])
    return force


def sprung_cover(arm: Arm, joint: str) -> Any:
    """The first cover of the link of a joint; None where it has none."""
    link = arm.links.names[arm.joints.names.index(joint)]
    return next((cover for cover in rows(arm.covers) if cover.link == link), None)
