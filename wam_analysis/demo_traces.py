"""The demonstration over time: steps, forces and contacts of a bag on one time base."""

import itertools
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.bag import Bag, Messages, PointColumns, WrenchColumns
from wam_ros.topics import TOPICS

Numbers = NDArray[np.float64]
Names = NDArray[np.str_]
Times = NDArray[np.int64]
Mask = NDArray[np.bool_]

NAN = float("nan")
HELD = 100_000_000  # ns that a message stands for; older, the signal counts as unknown

RECORDED = (
    "force_command", "force_measured", "contact/wrench", "contact/point", "sim/contact/wrench", "sim/contact/point",
    "sim/disturbance", "sim/joint_states",
)  # fmt: skip
TOPICS_READ = (*RECORDED, "joint_states", "contact/hypotheses", "status", "/diagnostics")


class Step(NamedTuple):
    """A step of the scenario and when it was played, ns of the arm's time."""

    name: str
    begin: int
    end: int


class Signal(NamedTuple):
    """Forces over the k instants of a time base; NaN where nothing was recorded.

    Attributes
    ----------
    frame : (k,), frame of each force.
    force : (k, 3), N.
    place : (k,), distance along the frame's x, m; NaN also where it is not known.
    """

    frame: Names
    force: Numbers
    place: Numbers

    @property
    def size(self) -> Numbers:
        """Magnitude of each force, (k,), N."""
        return np.linalg.norm(self.force, axis=1)

    @property
    def acts(self) -> Mask:
        """Where there is a force, (k,)."""
        return self.size > 0.0

    @property
    def is_known(self) -> Mask:
        """Where it was recorded, (k,)."""
        return ~np.isnan(self.size)


class Traces(NamedTuple):
    """The demonstration over time: k instants, ns of the arm's time.

    Attributes
    ----------
    asked, measured : force of the arm on the world.
    true, felt : contact according to the simulator and to the estimator, force of the world on the arm.
    push : push that the scenario asked of the simulator.
    """

    stamp: Times
    asked: Signal
    measured: Signal
    true: Signal
    felt: Signal
    push: Signal

    def along(self, signal: Signal, sign: float = 1.0) -> Numbers:
        """Component along the force asked for, (k,), N; NaN where none is asked or on another link.

        Parameters
        ----------
        signal : one of these traces.
        sign : -1 turns a force of the world on the arm into one of the arm on the world.
        """
        size = self.asked.size
        direction = self.asked.force / np.where(size > 0.0, size, NAN)[:, np.newaxis]
        component: Numbers = sign * np.sum(signal.force * direction, axis=1)
        component[signal.acts & (signal.frame != self.asked.frame)] = NAN
        return component

    def during(self, begin: int, end: int) -> Mask:
        """The instants from begin up to end, ns."""
        return (self.stamp >= begin) & (self.stamp < end)


def find_namespace(bag: Bag) -> tuple[str, list[str]]:
    """Namespace of the arm, and a note where the bag has several arms."""
    counts: Counter[str] = Counter()
    for topic in TOPICS:
        if not topic.name.startswith("/"):
            ending = f"/{topic.name}"
            counts.update(name.removesuffix(ending) for name in sorted(bag.topics) if name.endswith(ending))
    arms = [name for name in sorted(counts) if f"{name}/status" in bag.topics]
    found = counts.most_common(1)[0][0] if counts else ""
    return found, [f"arms in this bag: {', '.join(arms)}; this is {found}"] if len(arms) > 1 else []


def length(bag: Bag, namespace: str, name: str) -> int:
    """Number of messages of a topic."""
    columns = bag.topics.get(f"{namespace}/{name}")
    return 0 if columns is None else len(columns.log_time_ns)


def messages_of(bag: Bag, topic: str) -> Sequence[Any]:
    """Decoded messages of a topic, none where it was not recorded."""
    columns = bag.topics.get(topic)
    return columns.messages if isinstance(columns, Messages) else ()


def values_of(status: Any) -> dict[str, str]:
    """Keys and values of a DiagnosticStatus."""
    return {item.key: item.value for item in status.values}


def node_of(status: Any) -> str:
    """Name of the node that sent a DiagnosticStatus."""
    return str(status.name).rsplit("/", 1)[-1]


def steps_of(bag: Bag, namespace: str) -> tuple[tuple[Step, ...], str]:
    """Steps of the scenario and its outcome: 'done', why it failed, or that the recording ended before."""
    said = [
        (int(values_of(status)["stamp"]), str(status.message), int(status.level))
        for status in messages_of(bag, f"{namespace}/status")
        if node_of(status) == "scenario" and "stamp" in values_of(status)
    ]
    ends = [i for i, (_, message, level) in enumerate(said) if message == "done" or level]
    outcome = said[ends[0]][1] if ends else "not finished: the recording ends before the scenario does"
    commands = bag.topics.get(f"{namespace}/force_command")
    last = int(commands.stamp_ns[-1]) if isinstance(commands, WrenchColumns) and len(commands.stamp_ns) else 0
    if not ends and said:
        said.append((max(last, said[-1][0]), "", 0))
    elif ends:
        said = said[: ends[0] + 1]
    steps = [Step(now[1], now[0], then[0]) for now, then in itertools.pairwise(said)]
    return tuple(steps), outcome


def traces_of(bag: Bag, namespace: str) -> Traces:
    """All signals at the instants of the simulator's truth, or of what else was recorded."""

    def signal(wrench: str, point: str = "") -> Signal:
        forces, points = (bag.topics.get(f"{namespace}/{name}") for name in (wrench, point))
        if not isinstance(forces, WrenchColumns) or not len(forces.stamp_ns):
            return Signal(np.full(len(base), ""), np.full((len(base), 3), NAN), np.full(len(base), NAN))
        row, known = _held(forces.stamp_ns, base)
        force = np.where(known[:, np.newaxis], forces.force[row], NAN)
        place = np.full(len(base), NAN)
        if isinstance(points, PointColumns) and len(points.stamp_ns):
            at, is_there = _held(points.stamp_ns, base)
            same = is_there & known & (points.stamp_ns[at] == forces.stamp_ns[row])
            place[same] = points.point[at[same], 0]
        return Signal(np.array(forces.frames, np.str_)[row], force, place)

    base = np.empty(0, np.int64)
    for name in ("sim/contact/wrench", "force_command", "contact/wrench"):
        columns = bag.topics.get(f"{namespace}/{name}")
        if isinstance(columns, WrenchColumns) and len(columns.stamp_ns):
            base = columns.stamp_ns
            break
    return Traces(
        stamp=base,
        asked=signal("force_command"),
        measured=signal("force_measured"),
        true=signal("sim/contact/wrench", "sim/contact/point"),
        felt=signal("contact/wrench", "contact/point"),
        push=signal("sim/disturbance"),
    )


def _held(stamps: Times, base: Times) -> tuple[NDArray[np.intp], Mask]:
    """Row of the last message at or before each instant, and whether there is one that is not too old."""
    row = np.searchsorted(stamps, base, side="right") - 1
    known = row >= 0
    row = np.maximum(row, 0)
    return row, known & (base - stamps[row] <= HELD)
