"""A bag as the source of the page: the same picture and plots, with a slider over the time."""

import math
import time
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from operator import itemgetter
from typing import Final

import numpy as np

from wam_analysis.held_messages import joint_angles, row_at
from wam_analysis.recorded import recorded_arm
from wam_analysis.recording import AnalysedRecording
from wam_bag.bag import TableColumns
from wam_control.contact.contact_table import contact_of, likely_of
from wam_description.signals import NO_CONTACT, Contact, Table
from wam_live.page import name_page, quiet, serve, url
from wam_live.panel import Controls
from wam_live.scene import Scene
from wam_live.snapshot import NAN, Snapshot, objects_of
from wam_live.thresholds import LIVE
from wam_sim.replay import tables

SPEEDS: Final = ("0.1", "0.25", "0.5", "1", "2", "5")


def stamped(columns: TableColumns | None) -> list[tuple[int, Table]]:
    """Stamps, ns, and tables of the recorded messages of a topic; none for None."""
    return [] if columns is None else list(zip(columns.stamp_ns.tolist(), tables(columns), strict=True))


def table_at(found: Sequence[tuple[int, Table]], stamp: int, held: float = math.inf) -> Table | None:
    """The last of stamped tables at or before a time, ns, if it is not older than `held`, ns."""
    row = bisect_right(found, stamp, key=itemgetter(0)) - 1
    return found[row][1] if row >= 0 and stamp - found[row][0] < held else None


class BagSource:
    """What a recorded run showed at any time of it.

    Parameters
    ----------
    recording : of a bag.

    Raises
    ------
    ValueError
        if the bag has no joint states.
    """

    def __init__(self, recording: AnalysedRecording) -> None:
        self.recorded = recorded_arm(recording.parameters)
        poses = joint_angles(recording.run, self.recorded.arm)
        if poses is None:
            raise ValueError(f"{recording.bag.path} has no joint states of this arm; nothing can be shown")
        self._stamps, self._angles = poses
        self._traces = recording.traces
        self._covers = self.recorded.arm.covers.names
        self._statuses = sorted(recording.run.stamped_statuses(), key=itemgetter(0))
        self._hypotheses = stamped(recording.run.table("contact/hypotheses"))
        self._objects = stamped(recording.run.table("sim/objects"))
        self.begin, self.end = int(self._stamps[0]), int(self._stamps[-1])

    def snapshot(self, stamp: int) -> Snapshot:
        """What there was at a time of the arm, ns."""
        at = row_at(self._stamps, stamp)
        traces, row = self._traces, int(np.searchsorted(self._traces.stamp, stamp, side="right")) - 1
        known = row >= 0
        hypotheses = table_at(self._hypotheses, stamp, LIVE.held)
        until = bisect_right(self._statuses, stamp, key=itemgetter(0))
        return Snapshot(
            stamp=stamp,
            q=tuple(self._angles[at].tolist()),
            true=traces.true.contact(row) if known else NO_CONTACT,
            estimated=contact_of(hypotheses, self._covers) if self._hypotheses else self._alone(row),
            likely=likely_of(hypotheses, self._covers),
            commanded=float(traces.commanded.size[row]) if known else NAN,
            measured=float(traces.measured.size[row]) if known else NAN,
            statuses={status.node: status for _, status in self._statuses[:until]},
            objects=objects_of(table_at(self._objects, stamp)),
        )

    def past(self, stamp: int) -> Iterator[Snapshot]:
        """What the plots show before a time of the arm, ns, oldest first."""
        first = max(self.begin, stamp - round(LIVE.window * 1e9))
        return (self.snapshot(int(at)) for at in np.linspace(first, stamp, LIVE.points, endpoint=False))

    def _alone(self, row: int) -> Contact:
        """The estimated contact of a bag without `contact/hypotheses`; none where its position was not recorded.

        A contact without one is shown as one whose position cannot be observed.
        """
        signal = self._traces.estimated
        return signal.contact(row) if row >= 0 and signal.is_placed[row] else NO_CONTACT


def play(recording: AnalysedRecording, port: int, until: Callable[[], bool], notify: Callable[[str], None]) -> None:
    """Serve the page of a bag until a condition holds; the errors are those of `BagSource` and `serve`.

    Parameters
    ----------
    recording : of the bag.
    port : to listen on.
    until : whether it is over.
    notify : called with lines for people.
    """
    source = BagSource(recording)
    server = serve(port)
    try:
        scene = Scene(server, source.recorded.arm, source.recorded.world, draggable=False)
        length = (source.end - source.begin) / 1e9
        name_page(server, recording.bag.path.name)
        place, then = 0.0, time.monotonic()
        slider = server.gui.add_slider("time [s]", 0.0, max(length, 0.01), 0.01, place)
        speed = server.gui.add_dropdown("speed", SPEEDS, initial_value="1")
        running = server.gui.add_checkbox("play", True)
        panel = Controls(server, source.recorded.arm)
        notify(f"{recording.bag.path}: {url(port)}")

        def moved(event: object) -> None:
            nonlocal place
            if getattr(event, "client", None) is not None:  # not by the page itself
                place = float(slider.value)

        slider.on_update(moved)
        shown = math.nan
        while not until():
            time.sleep(1.0 / LIVE.rate)
            now = time.monotonic()
            if running.value:
                place += (now - then) * float(speed.value)
                place = place if place <= length else 0.0
                slider.value = round(place, 2)
            then = now
            if place != shown:
                if not 0.0 <= place - shown < 1.0:  # moved by hand, or begun again
                    panel.fill(source.past(source.begin + round(place * 1e9)))
                shown = place
                snapshot = source.snapshot(source.begin + round(place * 1e9))
                with server.atomic():
                    scene.show(snapshot)
                    panel.show(snapshot)
    finally:
        with quiet():
            server.stop()
