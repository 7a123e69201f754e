"""Contacts drawn wider than the estimator's prior: strong, rough, at ends, sliding, two at once, impacts; masses."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wam_description.arm import Arm


@dataclass(frozen=True)
class TouchRanges:
    """What is drawn of contacts and masses; forces, masses uniform in the logarithm."""

    levels: tuple[float, ...] = (5.0, 10.0, 20.0)  # N, half of the contacts of most recordings
    weakest: float = 1.0  # N, the others
    strongest: float = 60.0  # N
    roughest: float = 0.8  # coefficient of friction
    rise: float = 0.005  # s
    margin: float = 0.02  # m, from the ends of a cover
    near_elbow: float = 0.01  # m
    slide: float = 0.2  # m/s
    lightest: float = 0.1  # kg
    heaviest: float = 1.0  # kg
    holds_of_mass: tuple[float, float] = (3.0, 6.0)  # s; one that is held to the end is exchanged for the next
    hold: float = 0.5  # s
    impact: float = 0.03  # s
    harder: tuple[float, float] = (1.5, 3.0)  # times the force
    harder_after: float = 0.4  # s after the start
    harder_within: tuple[float, float] = (0.05, 0.4)  # s
    lasting: tuple[float, float] = (0.2, 10.0)  # s, of contacts of any length
    slow: float = 2.0  # s, of a rise


TOUCHES = TouchRanges()
# how often each kind is drawn
KINDS = {
    "outer": 0.44,
    "inner": 0.21,
    "tip along the tube": 0.07,
    "end cap, oblique": 0.06,
    "elbow": 0.06,
    "drag along the tube": 0.05,
    "twist": 0.03,
    "sliding": 0.05,
    "impact": 0.03,
}
# how often in the recordings of contacts that last up to 10 s, some of which rise slowly
LASTING_KINDS = {
    "outer": 0.35,
    "inner": 0.2,
    "harder": 0.15,
    "sliding": 0.1,
    "elbow": 0.05,
    "drag along the tube": 0.05,
    "tip along the tube": 0.05,
    "twist": 0.05,
}
# how often in the recordings of an arm that was identified, whose forces are all of the levels
LEVEL_KINDS = {"outer": 0.75, "inner": 0.25}
PICKING_UP = "picking up"
MASS_KINDS = {PICKING_UP: 1.0}  # in the recordings in which the tool picks up a mass, carries it and sets it down


class Touch(NamedTuple):
    """One contact, an exact force; or a mass at the tool, which is in the plant while it is carried.

    Attributes
    ----------
    kind : of `KINDS`.
    cover : name of the cover.
    position : m along the cover at the start.
    force : (3,), N, of the world on the cover, in its frame.
    arm : (3,), m, from the axis at `position` to the point of the force.
    twist : N m about the cover's x axis.
    speed : m/s, of the position.
    begin, end, rise : s.
    friction : coefficient; tangential over normal force.
    harder, within : factor by which the force grows, `TOUCHES.harder_after` the start, and s that this takes.
    mass : kg, picked up by the tool; its force is 0.
    """

    kind: str
    cover: str
    position: float
    force: tuple[float, float, float]
    arm: tuple[float, float, float]
    twist: float
    speed: float
    begin: float
    end: float
    friction: float
    harder: float = 1.0
    within: float = 0.1
    mass: float = 0.0
    rise: float = TOUCHES.rise

    def share(self, time: float) -> float:
        """Fraction of the force that acts at a time, s."""
        rise = min(self.rise, 0.5 * (self.end - self.begin))
        grown = min(max((time - self.begin - TOUCHES.harder_after) / self.within, 0.0), 1.0)
        share = max(0.0, min(1.0, (time - self.begin) / rise, (self.end - time) / rise))
        return share * (1.0 + (self.harder - 1.0) * grown)

    def place_at(self, time: float) -> float:
        """Contact position, m."""
        return self.position + self.speed * max(0.0, time - self.begin)

    def wrench(self, time: float, axis: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
        """Force, N, and moment about the origin of the cover, N m; `axis` is the tube's axis at the contact, m."""
        share = self.share(time)
        force = share * np.array(self.force)
        return force, np.cross(np.array(axis) + np.array(self.arm), force) + np.array([share * self.twist, 0.0, 0.0])


def axis_of(arm: Arm, cover: str, place: float) -> tuple[float, float, float]:
    """Point of the tube's axis at a position along the cover, m."""
    i = arm.covers.names.index(cover)
    start, end = (np.array(ends[3 * i : 3 * i + 3]) for ends in (arm.covers.start, arm.covers.end))
    x, y, z = (start + (place - start[0]) / (end[0] - start[0]) * (end - start)).tolist()
    return x, y, z


def touches(
    arm: Arm, random: np.random.Generator, times: Sequence[float], kinds: Mapping[str, float] = KINDS
) -> list[Touch]:
    """A contact at each time, s."""
    found: list[Touch] = []
    for begin in times:
        kind = str(random.choice(list(kinds), p=np.array(list(kinds.values())) / sum(kinds.values())))
        drawn = _drawn(arm, random, kind, begin, 1.0 if kinds is LEVEL_KINDS else 0.5)
        if kinds is LASTING_KINDS:
            hold = float(np.exp(random.uniform(*np.log(TOUCHES.lasting))))
            rise = TOUCHES.slow if random.random() < 0.3 else TOUCHES.rise
            drawn = drawn._replace(end=begin + hold, rise=min(rise, 0.5 * hold))
        found.append(drawn)
    return found


def _neighbours(arm: Arm, random: np.random.Generator) -> tuple[str, str]:
    """Two covers, one behind the other."""
    names = arm.covers.names
    i = int(random.integers(len(names) - 1)) if len(names) > 2 else 0
    return names[i], names[i + 1]


def _drawn(arm: Arm, random: np.random.Generator, kind: str, begin: float, of_levels: float) -> Touch:
    inner, outer = _neighbours(arm, random)
    size = _size(random, of_levels)
    if kind == PICKING_UP:
        mass = float(np.exp(random.uniform(math.log(TOUCHES.lightest), math.log(TOUCHES.heaviest))))
        none, end = (0.0, 0.0, 0.0), begin + float(random.choice(TOUCHES.holds_of_mass))
        return Touch(kind, outer, _length(arm, outer), none, none, 0.0, 0.0, begin, end, 0.0, mass=mass)
    if kind in ("tip along the tube", "end cap, oblique"):
        lean = 0.0 if kind == "tip along the tube" else float(random.uniform(0.1, 1.0))
        angle = float(random.uniform(-math.pi, math.pi))
        length = _length(arm, outer)
        force = (
            -size * math.cos(lean),
            size * math.sin(lean) * math.cos(angle),
            size * math.sin(lean) * math.sin(angle),
        )
        return Touch(kind, outer, length, force, (0.0, 0.0, 0.0), 0.0, 0.0, begin, begin + TOUCHES.hold, 0.0)
    if kind == "elbow":
        cover = str(random.choice((inner, outer)))
        touch = _side(arm, random, cover, size, begin, TOUCHES.hold)
        place = float(random.uniform(0.0, TOUCHES.near_elbow))
        return touch._replace(kind=kind, position=place if cover == outer else _length(arm, inner) - place)
    if kind == "drag along the tube":
        touch = _side(arm, random, outer, size, begin, TOUCHES.hold)
        along = float(random.choice((-1.0, 1.0))) * size
        return touch._replace(kind=kind, force=(along, 0.0, 0.0), friction=math.inf)
    touch = _side(arm, random, inner if kind == "inner" else outer, size, begin, TOUCHES.hold)
    if kind == "twist":
        touch = touch._replace(twist=float(random.choice((-0.5, 0.5))))
    if kind == "sliding":
        middle = 0.5 * _length(arm, outer)
        touch = touch._replace(speed=TOUCHES.slide if touch.position < middle else -TOUCHES.slide)
    if kind == "harder":
        low, high = TOUCHES.harder_within
        factor, within = float(random.uniform(*TOUCHES.harder)), float(random.uniform(low, high))
        x, y, z = touch.force
        touch = touch._replace(force=(x / factor, y / factor, z / factor), harder=factor, within=within)
    if kind == "impact":
        touch = touch._replace(end=begin + TOUCHES.impact)
    return touch._replace(kind=kind)


def _length(arm: Arm, cover: str) -> float:
    return arm.covers.length_of(cover)


def _size(random: np.random.Generator, of_levels: float) -> float:
    if random.random() < of_levels:
        return float(random.choice(TOUCHES.levels)) * float(random.uniform(0.95, 1.05))
    return float(np.exp(random.uniform(math.log(TOUCHES.weakest), math.log(TOUCHES.strongest))))


def _side(arm: Arm, random: np.random.Generator, cover: str, size: float, begin: float, hold: float) -> Touch:
    """A normal force with friction in any direction, at the surface of the tube."""
    i = arm.covers.names.index(cover)
    angle, way = random.uniform(-math.pi, math.pi, 2)
    friction = TOUCHES.roughest if random.random() < 0.2 else float(random.uniform(0.0, 0.5))
    normal = np.array([0.0, math.cos(angle), math.sin(angle)])
    around = np.array([0.0, -math.sin(angle), math.cos(angle)])
    tangent = math.cos(way) * np.array([1.0, 0.0, 0.0]) + math.sin(way) * around
    force = size * (normal + friction * tangent)
    lever = -arm.covers.radius[i] * normal
    return Touch(
        kind="outer" if i else "inner",
        cover=cover,
        position=float(random.uniform(TOUCHES.margin, arm.covers.length[i] - TOUCHES.margin)),
        force=(float(force[0]), float(force[1]), float(force[2])),
        arm=(float(lever[0]), float(lever[1]), float(lever[2])),
        twist=0.0,
        speed=0.0,
        begin=begin,
        end=begin + hold,
        friction=friction,
    )
