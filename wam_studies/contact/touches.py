"""Contacts drawn wider than the estimator's prior: strong, rough, at ends, sliding, two at once, impacts; masses."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wam_description.arm import Arm, Covers
from wam_studies.identification.plants import log_uniform


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


class DrawnContacts(NamedTuple):
    """How often each kind is drawn, s from one to the next, share of forces of the levels, whether any length is."""

    kinds: Mapping[str, float]
    spacing: float = 1.9
    of_levels: float = 0.5
    are_lasting: bool = False


CONTACTS = {
    "wide": DrawnContacts(KINDS),
    "lasting": DrawnContacts(LASTING_KINDS, 11.0, are_lasting=True),
    "level": DrawnContacts(LEVEL_KINDS, of_levels=1.0),
    "masses": DrawnContacts(MASS_KINDS, 6.0),
}


class Touch(NamedTuple):
    """One contact, an exact force; or a mass at the tool, which is in the plant while it is carried.

    Attributes
    ----------
    kind : of `KINDS`.
    cover : name of the cover.
    position : m along the cover at the start.
    begin, end : s.
    force : (3,), N, of the world on the cover, in its frame.
    arm : (3,), m, from the axis at `position` to the point of the force.
    friction : coefficient; tangential over normal force.
    twist : N m about the cover's x axis.
    speed : m/s, of the position.
    rise : s.
    harder, within : factor by which the force grows, `TOUCHES.harder_after` the start, and s that this takes.
    mass : kg, picked up by the tool; its force is 0.
    """

    kind: str
    cover: str
    position: float
    begin: float
    end: float
    force: tuple[float, ...] = (0.0, 0.0, 0.0)
    arm: tuple[float, ...] = (0.0, 0.0, 0.0)
    friction: float = 0.0
    twist: float = 0.0
    speed: float = 0.0
    rise: float = TOUCHES.rise
    harder: float = 1.0
    within: float = 0.1
    mass: float = 0.0

    def share(self, time: float) -> float:
        """Fraction of the force that acts at a time, s."""
        rise = min(self.rise, 0.5 * (self.end - self.begin))
        grown = min(max((time - self.begin - TOUCHES.harder_after) / self.within, 0.0), 1.0)
        share = max(0.0, min(1.0, (time - self.begin) / rise, (self.end - time) / rise))
        return share * (1.0 + (self.harder - 1.0) * grown)

    def place_at(self, time: float) -> float:
        """Contact position, m."""
        return self.position + self.speed * max(0.0, time - self.begin)

    def wrench(self, time: float, covers: Covers) -> np.ndarray:
        """Force, N, and moment about the origin of the cover, N m, (6,)."""
        share, place = self.share(time), self.place_at(time)
        force, axis = share * np.array(self.force), covers.on_axis(self.cover, place)
        twist = np.array((share * self.twist, 0.0, 0.0))
        return np.concatenate((force, np.cross(np.add(axis, self.arm), force) + twist))


def touches(arm: Arm, random: np.random.Generator, times: Sequence[float], given: DrawnContacts) -> list[Touch]:
    """A contact at each time, s."""
    found: list[Touch] = []
    shares = np.array(list(given.kinds.values()))
    for begin in times:
        kind = str(random.choice(list(given.kinds), p=shares / sum(given.kinds.values())))
        drawn = _drawn(arm, random, kind, begin, given.of_levels)
        if given.are_lasting:
            hold = log_uniform(random, *TOUCHES.lasting)
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
    size, length = _size(random, of_levels), arm.covers.length_of(outer)
    if kind == PICKING_UP:
        mass, hold = log_uniform(random, TOUCHES.lightest, TOUCHES.heaviest), random.choice(TOUCHES.holds_of_mass)
        return Touch(kind, outer, length, begin, begin + float(hold), mass=mass)
    end = begin + TOUCHES.hold
    if kind in ("tip along the tube", "end cap, oblique"):
        lean = 0.0 if kind == "tip along the tube" else float(random.uniform(0.1, 1.0))
        angle = float(random.uniform(-math.pi, math.pi))
        across = size * math.sin(lean)
        force = (-size * math.cos(lean), across * math.cos(angle), across * math.sin(angle))
        return Touch(kind, outer, length, begin, end, force)
    cover = str(random.choice((inner, outer))) if kind == "elbow" else inner if kind == "inner" else outer
    touch = _side(arm, random, cover, size, begin)._replace(kind=kind)
    if kind == "elbow":
        place = float(random.uniform(0.0, TOUCHES.near_elbow))
        return touch._replace(position=place if cover == outer else arm.covers.length_of(inner) - place)
    if kind == "drag along the tube":
        return touch._replace(force=(float(random.choice((-1.0, 1.0))) * size, 0.0, 0.0), friction=math.inf)
    if kind == "twist":
        return touch._replace(twist=float(random.choice((-0.5, 0.5))))
    if kind == "sliding":
        return touch._replace(speed=TOUCHES.slide if touch.position < 0.5 * length else -TOUCHES.slide)
    if kind == "harder":
        factor, within = (float(random.uniform(*ends)) for ends in (TOUCHES.harder, TOUCHES.harder_within))
        return touch._replace(force=tuple(x / factor for x in touch.force), harder=factor, within=within)
    return touch._replace(end=begin + TOUCHES.impact) if kind == "impact" else touch


def _size(random: np.random.Generator, of_levels: float) -> float:
    if random.random() < of_levels:
        return float(random.choice(TOUCHES.levels)) * float(random.uniform(0.95, 1.05))
    return log_uniform(random, TOUCHES.weakest, TOUCHES.strongest)


def _side(arm: Arm, random: np.random.Generator, cover: str, size: float, begin: float) -> Touch:
    """A normal force with friction in any direction, at the surface of the tube."""
    i = arm.covers.names.index(cover)
    angle, way = random.uniform(-math.pi, math.pi, 2)
    friction = TOUCHES.roughest if random.random() < 0.2 else float(random.uniform(0.0, 0.5))
    normal = np.array([0.0, math.cos(angle), math.sin(angle)])
    around = np.array([0.0, -math.sin(angle), math.cos(angle)])
    tangent = math.cos(way) * np.array([1.0, 0.0, 0.0]) + math.sin(way) * around
    force, lever = size * (normal + friction * tangent), -arm.covers.radius[i] * normal
    place = float(random.uniform(TOUCHES.margin, arm.covers.length[i] - TOUCHES.margin))
    end = begin + TOUCHES.hold
    return Touch("", cover, place, begin, end, tuple(force.tolist()), tuple(lever.tolist()), friction)
