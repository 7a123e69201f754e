"""A bag with what belongs to it: the arm's namespace, its parameters, the forces that were held."""

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.bag import Bag, JointColumns, WrenchColumns
from wam_analysis.demo_summary import DemoSummary, summarize
from wam_analysis.recorded import RecordedParameters, recorded_parameters

Numbers = NDArray[np.float64]
Times = NDArray[np.int64]

SHORTEST_HOLD = 0.3  # s; a force that is asked for a shorter time is on its way
SMALL = 0.01  # N; asked forces that differ by less are one
FOREIGN = ("sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped")


class Hold(NamedTuple):
    """A constant force that was asked for.

    Attributes
    ----------
    name : of the scenario's step, or the force.
    begin, end : ns.
    frame : of the force.
    force : (3,), N, of the arm on the world, in that frame.
    asked : its size, N.
    before : force asked along the same direction before, N.
    disturbed : whether the scenario pushed the arm meanwhile.
    """

    name: str
    begin: int
    end: int
    frame: str
    force: Numbers
    asked: float
    before: float
    disturbed: bool


class Recording(NamedTuple):
    """All that the analyses take from a bag."""

    bag: Bag
    namespace: str
    summary: DemoSummary
    parameters: RecordedParameters
    holds: tuple[Hold, ...]

    def joints(self, name: str) -> JointColumns | None:
        """Columns of a JointState topic of the arm, None where nothing was recorded."""
        columns = self.bag.topics.get(f"{self.namespace}/{name}")
        return columns if isinstance(columns, JointColumns) and len(columns.stamp_ns) else None

    def wrench(self, name: str) -> WrenchColumns | None:
        """Columns of a WrenchStamped topic of the arm, None where nothing was recorded."""
        columns = self.bag.topics.get(f"{self.namespace}/{name}")
        return columns if isinstance(columns, WrenchColumns) and len(columns.stamp_ns) else None

    def lacking(self, *names: str) -> tuple[str, ...]:
        """Those of some topics of which nothing was recorded."""
        return tuple(
            name
            for name in names
            if not ((columns := self.bag.topics.get(f"{self.namespace}/{name}")) and len(columns.log_time_ns))
        )

    @property
    def mode(self) -> str:
        """'lockstep', 'realtime' or 'unknown'."""
        return self.summary.loop.mode


def recording_of(bag: Bag) -> Recording:
    """Take a bag apart, whatever is in it."""
    summary = summarize(bag)
    parameters = recorded_parameters(bag, summary.namespace)
    return Recording(bag, summary.namespace, summary, parameters, _holds(bag, summary))


def _holds(bag: Bag, summary: DemoSummary) -> tuple[Hold, ...]:
    """Stretches in which one force is asked for, within one step of the scenario."""
    commands = bag.topics.get(f"{summary.namespace}/force_command")
    if not isinstance(commands, WrenchColumns) or not len(commands.stamp_ns):
        return ()
    frames = np.array(commands.frames)
    changed = np.any(np.abs(np.diff(commands.force, axis=0)) > SMALL, axis=1) | (frames[1:] != frames[:-1])
    steps = np.searchsorted(commands.stamp_ns, [step.begin for step in summary.steps])
    inner = {*(np.flatnonzero(changed) + 1).tolist(), *steps.tolist()} - {0, len(frames)}
    bounds = [0, *sorted(inner), len(frames)]
    period = int(np.median(np.diff(commands.stamp_ns))) if len(frames) > 1 else 0
    holds: list[Hold] = []
    before = np.zeros(3)
    for a, b in itertools.pairwise(bounds):
        force = commands.force[a]
        asked = float(np.linalg.norm(force))
        begin, end = int(commands.stamp_ns[a]), int(commands.stamp_ns[b - 1]) + period
        if asked > SMALL and end - begin >= SHORTEST_HOLD * 1e9:
            name = next((step.name for step in summary.steps if step.begin <= (begin + end) // 2 < step.end), "")
            taken = [hold.name for hold in holds]
            name = name or f"{asked:.3g} N"
            name = name if name not in taken else f"{name} ({begin / 1e9:.1f} s)"
            pushed = summary.traces.during(begin, end) & summary.traces.push.acts
            along = float(before @ force) / asked
            holds.append(Hold(name, begin, end, str(frames[a]), force, asked, along, bool(np.any(pushed))))
        before = force
    return tuple(holds)


def at_stamps(columns: JointColumns, stamps: Times) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """Whether a message bears each of some stamps, and its row; columns must be sorted by stamp."""
    row = np.minimum(np.searchsorted(columns.stamp_ns, stamps), len(columns.stamp_ns) - 1)
    return columns.stamp_ns[row] == stamps, row


def by_names(columns: JointColumns, field: str, names: tuple[str, ...]) -> Numbers | None:
    """A field's columns in the order of some names, (k, n); None where one is missing."""
    values: Numbers = getattr(columns, field)
    if not values.shape[1] or any(name not in columns.names for name in names):
        return None
    order = [columns.names.index(name) for name in names]
    return values if order == list(range(values.shape[1])) else values[:, order]
