"""The scenarios of the benchmark: drawn from a seed, plain data, equal for every way to play them.

The true arm of each scenario has its own model mismatch within the declared range.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from wam_control.task.scenario import Push, ScenarioStep
from wam_description.arm import Arm
from wam_description.configuration import Configuration
from wam_description.parameters import fields
from wam_description.world import Obstacles
from wam_studies.contact.moves import MoveGenerator
from wam_studies.identification.plants import drawn_cover, mismatch


@dataclass(frozen=True)
class ScenarioRanges:
    """What is drawn of a scenario; a number of the model mismatch is the largest error, uniform in +- this."""

    friction: float = 0.10  # of each motor and joint
    mass: float = 0.02  # of each link
    stiffness: float = 0.10  # of each cable
    payload: float = 0.05  # kg, unmodelled, in free motion only
    release: float = 0.05  # s, to release the brakes
    settle: float = 0.3  # s, before the first move
    hold: float = 0.32  # s of contact in motion
    rest: float = 0.6  # s at rest before a contact
    rest_hold: float = 0.6  # s of contact at rest
    free_seconds: float = 12.0  # length of one scenario without contact
    levels: tuple[float, ...] = (5.0, 10.0, 20.0)  # N, in the table
    weakest: float = 1.0  # N
    strongest: float = 20.0  # N
    rough: float = 0.8  # the greatest coefficient of friction, of every fifth pusher
    margin: float = 0.02  # m at the ends of a link without contacts
    dither_cycle: float = 0.04  # s: 25 Hz
    beyond_first: float = 0.7  # of the contacts are not on the first cover


RANGES = ScenarioRanges()
KINDS = ("push", "sphere", "flat")
GROUPS = ("moving", "dither", "free")

# what the estimator states of an arm that was identified to this range, as standard deviations
IDENTIFIED = {
    "contact_estimator:observer.moving_uncertainty": 0.06,
    "contact_estimator:observer.mass_uncertainty": 0.012,
    "contact_estimator:observer.asymmetry_uncertainty": 0.0,
    "contact_estimator:observer.load_uncertainty": 0.0,
    "contact_estimator:observer.payload_uncertainty": 0.0,
    "contact_estimator:observer.motor_noise": 0.05,
}


class PlannedContact(NamedTuple):
    """A planned contact; the simulation decides whether it happens."""

    kind: str
    cover: str
    position: float  # m along the link
    angle: float  # rad, of the force around the cover
    force: float  # N
    begin: float  # s since power-up
    end: float
    friction: float  # coefficient


class BenchmarkScenario(NamedTuple):
    """Values of a configuration and steps of a scenario.

    Attributes
    ----------
    group : 'moving', 'dither' or 'free'.
    values : override the configuration.
    steps : of the scenario.
    planned : contacts.
    """

    name: str
    group: str
    values: Mapping[str, Any]
    steps: tuple[ScenarioStep, ...]
    planned: tuple[PlannedContact, ...]


def dither_values(configuration: Configuration) -> dict[str, Any]:
    """Values that switch on the dither at rest; empty if the configuration has none."""
    shared = configuration.sections["/**"]
    return (
        {"timing.dither_cycle": round(RANGES.dither_cycle / shared["timing.period"])}
        if "timing.dither_cycle" in shared
        else {}
    )


def base_values(configuration: Configuration, joint_sensors: bool) -> dict[str, Any]:
    """Values of every scenario: no obstacle within reach, fast moves allowed, the estimator's model as configured."""
    return {
        **{f"driver:world.obstacles.{field.name}": [] for field in fields(Obstacles)},
        "force_loop:joint_speed_limit": 3.5,
        "contact_estimator:use_joint_sensors": joint_sensors,
        "contact_estimator:observer.mass_scale": [1.0] * configuration.shared.arm.n,
        "contact_estimator:observer.friction_scale": 1.0,
    }


class ScenarioGenerator:
    """Scenarios of one seed.

    Parameters
    ----------
    configuration : under test.
    seed : of the random numbers.
    joint_sensors : whether the estimator uses the joint sensors.
    """

    def __init__(self, configuration: Configuration, seed: int, joint_sensors: bool = False) -> None:
        self._seed, self._dither = seed, dither_values(configuration)
        self._arm: Arm = configuration.shared.arm
        self._moves = MoveGenerator(self._arm)
        self._base = base_values(configuration, joint_sensors) | IDENTIFIED

    def contacts(self, count: int) -> list[BenchmarkScenario]:
        """Scenarios with `count` contacts in motion, two per scenario."""
        return [self._touched("moving", i) for i in range((count + 1) // 2)]

    def resting(self, count: int) -> list[BenchmarkScenario]:
        """Scenarios with `count` contacts at rest with dither, two per scenario; none without it."""
        return [self._touched("dither", i) for i in range((count + 1) // 2)] if self._dither else []

    def free(self, seconds: float) -> list[BenchmarkScenario]:
        """Motion with stops and reversals and an unmodelled payload, without contact."""
        return [self._free(i) for i in range(math.ceil(seconds / RANGES.free_seconds - 1e-9))]

    def _drawn(self, group: str, i: int) -> tuple[str, np.random.Generator, tuple[float, ...]]:
        """Name, random numbers and start pose, rad, of a scenario."""
        random = np.random.default_rng((self._seed, GROUPS.index(group), i))
        return f"seed {self._seed} {group} {i}", random, self._moves.pose(random)

    def _touched(self, group: str, i: int) -> BenchmarkScenario:
        """A scenario with a contact in each of two moves, or in each of two rests after a move with dither."""
        name, random, start = self._drawn(group, i)
        if group == "moving":
            before, moves, after = [], self._moves.moves(random, start, 2), [ScenarioStep("end", 0.1)]
            legs = [(move._replace(name=f"move {k}"), 0.3 * move.seconds) for k, move in enumerate(moves, 1)]
            hold, dither = RANGES.hold, {}
        else:
            before, after = self._moves.moves(random, start, 1), []
            seconds = RANGES.rest + RANGES.rest_hold + 0.2
            legs = [(ScenarioStep(f"rest {k}", seconds), RANGES.rest) for k in (1, 2)]
            hold, dither = RANGES.rest_hold, self._dither
        steps, planned = [*_opening(), *before], []
        for step, wait in legs:
            now = sum(one.seconds for one in steps)
            contact = self._contact(random, now + wait, now + wait + hold)
            planned.append(contact)
            steps.append(step._replace(push=self._push(contact, now) if contact.kind == "push" else None))
        values = self._values(random, start, planned) | dither
        return BenchmarkScenario(name, group, values, (*steps, *after), tuple(planned))

    def _free(self, i: int) -> BenchmarkScenario:
        name, random, start = self._drawn("free", i)
        steps = moves_and_stops(self._moves, random, start, RANGES.free_seconds, (0.0, 0.0, 0.1, 0.4))
        values = self._values(random, start, [])
        if i % 2:  # no payload in the others, as in the scenarios with contact
            values["driver:mismatch.payload"] = float(random.uniform(0.0, RANGES.payload))
            values["contact_estimator:observer.payload"] = [0.0, RANGES.payload]
        return BenchmarkScenario(name, "free", values, tuple(steps), ())

    def _contact(self, random: np.random.Generator, begin: float, end: float) -> PlannedContact:
        covers = self._arm.covers
        cover = drawn_cover(random.random(), RANGES.beyond_first, len(covers.names))
        kind = str(random.choice(("push", "sphere", "flat"), p=(0.4, 0.3, 0.3)))
        level = float(random.choice((*RANGES.levels, 0.0), p=(0.35, 0.25, 0.2, 0.2)))
        force = (
            level * float(random.uniform(0.95, 1.05))
            if level
            else float(random.uniform(RANGES.weakest, RANGES.strongest))
        )
        friction = RANGES.rough if random.random() < 0.2 else float(random.uniform(0.0, 0.5))
        return PlannedContact(
            kind=kind,
            cover=covers.names[cover],
            position=float(random.uniform(RANGES.margin, covers.length[cover] - RANGES.margin)),
            angle=float(random.uniform(-math.pi, math.pi)),
            force=force,
            begin=round(begin, 3),
            end=round(end, 3),
            friction=friction if kind != "push" else 0.0,
        )

    def _push(self, contact: PlannedContact, step_begins: float) -> Push:
        cover, position = contact.cover, contact.position
        force = (0.0, contact.force * math.cos(contact.angle), contact.force * math.sin(contact.angle))
        begin, end = contact.begin - step_begins, contact.end - step_begins
        return Push(cover, position, force, begin, end)

    def _values(
        self, random: np.random.Generator, start: Sequence[float], planned: list[PlannedContact]
    ) -> dict[str, Any]:
        drawn = mismatch(random, self._arm, RANGES.mass, RANGES.friction, RANGES.stiffness)
        return {
            **self._base,
            "arm.joints.start": list(start),
            **{f"driver:mismatch.{name}": factors for name, factors in drawn.items()},
            **_pushers(random, [contact for contact in planned if contact.kind in ("sphere", "flat")]),
        }


def _opening() -> list[ScenarioStep]:
    return [ScenarioStep("release", RANGES.release, request="enable"), ScenarioStep("settle", RANGES.settle)]


def moves_and_stops(
    moves: MoveGenerator, random: np.random.Generator, start: Sequence[float], seconds: float, stops: Sequence[float]
) -> list[ScenarioStep]:
    """Steps of a motion from a pose, for at least some seconds; a stop, s, that is drawn follows each move."""
    steps, left, here = _opening(), seconds - RANGES.release - RANGES.settle, start
    while left > 0.0:
        (move,) = moves.moves(random, here, 1, before=steps[-1].posture)
        steps.append(move)
        stop = float(random.choice(stops))
        if stop:
            steps.append(ScenarioStep("stop", stop))
        left -= move.seconds + stop
        here = move.posture
    return steps


def _pushers(random: np.random.Generator, contacts: list[PlannedContact]) -> dict[str, Any]:
    if not contacts:
        return {}
    sliding = [float(random.choice((0.0, 1.0))) for _ in contacts]
    columns: dict[str, list[Any]] = {
        "names": [f"hand{i}" for i in range(len(contacts))],
        "shapes": ["sphere" if contact.kind == "sphere" else "box" for contact in contacts],
        "sizes": [size for contact in contacts for size in _size(random, contact.kind)],
        "covers": [contact.cover for contact in contacts],
        "positions": [contact.position for contact in contacts],
        "angles": [contact.angle for contact in contacts],
        "force": [contact.force for contact in contacts],
        "begin": [contact.begin for contact in contacts],
        "end": [contact.end for contact in contacts],
        "rise": [float(random.uniform(0.01, 0.03)) for _ in contacts],
        "clearance": [0.01 for _ in contacts],
        "slide": [slides * float(random.uniform(-0.03, 0.03)) for slides in sliding],
        "turn": [slides * float(random.uniform(-0.5, 0.5)) for slides in sliding],
        "stiffness": [float(random.uniform(1000.0, 4000.0)) for _ in contacts],
        "damping": [10.0 for _ in contacts],
        "friction": [contact.friction for contact in contacts],
    }
    return {f"driver:world.pushers.{key}": column for key, column in columns.items()}


def _size(random: np.random.Generator, kind: str) -> tuple[float, float, float]:
    if kind == "sphere":
        return float(random.uniform(0.02, 0.06)), 0.0, 0.0
    return float(random.uniform(0.01, 0.03)), 0.04, 0.02
