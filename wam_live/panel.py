"""Status, buttons, sliders and plots of the page; what is pressed goes into a queue as requests."""

import contextlib
import html
import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from queue import SimpleQueue
from typing import Any, Final, NamedTuple

import numpy as np
import viser
from viser import uplot

from wam_analysis.drawing import COLOURS, HAND, LIKELY
from wam_description.arm import Arm
from wam_description.event import Level
from wam_description.signals import BASE, ZERO, Contact, NodeStatus, Triple
from wam_description.status import PAUSED
from wam_description.wiring import Call, SetParameters
from wam_live.services import SERVICES
from wam_live.snapshot import Snapshot, size
from wam_live.thresholds import LIVE

FORCES: Final = ("true", "commanded", "measured", "estimated", "at least")  # of the plot, the last one in front
PLACES: Final = ("true", "estimated")
FORCE_TITLE: Final = "force [N]"
HINT: Final = "Enable releases the brakes; then drag a link to push it."  # until there is an answer
LEGEND: Final = (  # of the arrows and the range in the scene
    ("&#10145;", "true", "true force (simulator)"),
    ("&#10145;", "estimated", "estimated force"),
    ("&#9646;", "likely", "90 % range of the contact position"),
    ("&#10145;", "hand", "pull of your hand"),
)
BUTTONS: Final = {  # by row: label and its requests
    "arm": {"Enable": "enable", "Brake": "disable"},
    "time": {"Pause": "pause", "Step": "step", "Run": "resume"},
    "reset": {"Fault": "reset_fault", "Arm": "reset"},
}
DOTS: Final = {Level.OK: "#2f9e44", Level.WARN: "#f08c00", Level.ERROR: "#e03131", Level.STALE: "#adb5bd"}
DITHER: Final = ("velocity_loop", "dither.level")  # 0 switches it off
SLIDERS: Final = {  # live parameters of nodes; value at the right end of the slider, step
    ("force_loop", "force_gain"): (0.2, 0.001),
    ("force_loop", "posture_gain"): (20.0, 0.1),
    ("force_loop", "force_error_limit"): (40.0, 0.5),
    DITHER: (2.0, 0.1),
}


class Press(NamedTuple):
    """A commanded force of the arm on the world; zero ends it."""

    frame: str
    force: Triple  # N


class Play(NamedTuple):
    """A scenario to be played, its name or file; '' stops the one that is played."""

    script: str


class Bend(NamedTuple):
    """The arm to the posture in which the force loop was assessed, `guard.posture`."""


NO_PRESS: Final = Press(BASE, ZERO)
FIRST_SCRIPT: Final = "demo_scenario"
Request = Call | SetParameters | Press | Play | Bend


class Controls:
    """The controls of the page: status, buttons, sliders and plots.

    Parameters
    ----------
    server : that shows them.
    arm : names of the covers.
    live : present values of live parameters by (node, name), for those of `SLIDERS`; None where the page plays a bag.
    dither : about the dither, whose period is chosen when the nodes start.

    Attributes
    ----------
    requests : what was pressed, oldest first.
    snapshot : what is shown.
    """

    def __init__(
        self, server: viser.ViserServer, arm: Arm, live: Mapping[tuple[str, str], Any] | None = None, dither: str = ""
    ) -> None:
        self.requests: SimpleQueue[Request] = SimpleQueue()
        self._gui = gui = server.gui
        self.snapshot = Snapshot()
        self._drawn, self._high = math.nan, LIVE.ranges[0]
        self._samples: deque[tuple[float, ...]] = deque(maxlen=LIVE.points)
        self._sliders: dict[tuple[str, str], Any] = {}
        gui.configure_theme(control_width="medium", show_share_button=False)
        if live is not None:
            self._add_buttons()  # above all that changes its height
        self._status = gui.add_html(boxed(status_page(Snapshot()), LIVE.status_height))
        self._shown = gui.add_html("")
        gui.add_html(legend(LEGEND if live is not None else LEGEND[:-1]))
        if live is not None:
            self.notify(HINT)
            self._add_press(arm)
            self._add_scenario()
        self._force_plot = self._add_plot(FORCE_TITLE, FORCES, LIVE.ranges[0])
        self._place_plot = self._add_plot("position along the link [m]", PLACES, max(arm.covers.end))
        if live:
            self._add_sliders(live)
        if dither:
            gui.add_html(paragraph(html.escape(dither)))

    def take(self, snapshot: Snapshot) -> None:
        """Keep an instant for the plots; call it with every picture."""
        if self._samples and snapshot.seconds < self._samples[-1][0]:
            self._samples.clear()  # the arm was started again, or the bag was moved back
        if not self._samples or snapshot.seconds > self._samples[-1][0] + 0.9 * LIVE.window / LIVE.points:
            self._samples.append(sample(snapshot))

    def show(self, snapshot: Snapshot, pushing: float = 0.0, pressing: float = 0.0) -> None:
        """Show an instant and what was taken before it; call it a few times a second.

        Parameters
        ----------
        snapshot : the instant.
        pushing, pressing : forces that the page pushes a link with and commands, N, 0 for none.
        """
        self.snapshot = snapshot
        status = boxed(status_page(snapshot, pushing, pressing), LIVE.status_height)
        if status != self._status.content:
            self._status.content = status
        self.take(snapshot)
        if self._samples[-1][0] != self._drawn:
            self._draw()

    def fill(self, past: Iterable[Snapshot]) -> None:
        """Take what was before the next instant, oldest first; the plots begin with it."""
        self._samples.clear()
        self._samples.extend(sample(snapshot) for snapshot in past)
        if self._samples:
            self._draw()

    def notify(self, text: str, refused: bool = False) -> None:
        """Show the answer to the last request."""
        stated = paragraph(f"{'refused: ' * refused}{html.escape(text)}", DOTS[Level.ERROR] if refused else "")
        self._shown.content = boxed(stated, LIVE.note_height)

    def set_slider(self, node: str, name: str, value: Any) -> None:
        """Put a slider where its parameter is."""
        if (slider := self._sliders.get((node, name))) is not None:
            slider.value = float(np.ravel(value)[0])

    # made once

    def _add_buttons(self) -> None:
        stop = self._gui.add_button("Emergency stop", hint="stop at once; 'Fault' under reset ends it", color="red")
        stop.on_click(lambda _: self._ask("estop"))
        for row, buttons in BUTTONS.items():
            group = self._gui.add_button_group(row, tuple(buttons))
            group.on_click(lambda event, buttons=buttons: self._ask(buttons[event.target.value]))

    def _ask(self, service: str) -> None:
        for request in SERVICES[service][1]:
            self.requests.put(request)

    def _add_press(self, arm: Arm) -> None:
        with self._gui.add_folder("Press", expand_by_default=False):
            frame = self._gui.add_dropdown("frame", (BASE, *arm.covers.names))
            axis = self._gui.add_dropdown("direction", ("-z", "+z", "-x", "+x", "-y", "+y"))
            newtons = self._gui.add_slider("force [N]", 0.0, 20.0, 0.5, 5.0)

            def press(_: Any) -> None:
                force = [0.0, 0.0, 0.0]
                force["xyz".index(axis.value[1])] = math.copysign(newtons.value, float(axis.value[0] + "1"))
                self.requests.put(Press(frame.value, (force[0], force[1], force[2])))

            bend = self._gui.add_button("Bend the arm", hint="before a press: moves to guard.posture of the force loop")
            bend.on_click(lambda _: self.requests.put(Bend()))
            self._gui.add_button("Press").on_click(press)
            self._gui.add_button("Let go").on_click(lambda _: self.requests.put(NO_PRESS))

    def _add_scenario(self) -> None:
        with self._gui.add_folder("Scenario or task", expand_by_default=False):
            script = self._gui.add_text("file", FIRST_SCRIPT, hint="name, or path of a YAML file with steps")
            self._gui.add_button("Play").on_click(lambda _: self.requests.put(Play(script.value.strip())))
            self._gui.add_button("Stop").on_click(lambda _: self.requests.put(Play("")))

    def _add_sliders(self, live: Mapping[tuple[str, str], Any]) -> None:
        with self._gui.add_folder("Gains", expand_by_default=False):
            for (node, name), value in live.items():
                high, step = SLIDERS[node, name]
                first = float(np.ravel(value)[0])
                slider = self._gui.add_slider(name, 0.0, max(high, 2.0 * first), step, first)
                slider.on_update(lambda event, key=(node, name), like=value: self._moved(event, key, like))
                self._sliders[node, name] = slider

    def _moved(self, event: Any, key: tuple[str, str], like: Any) -> None:
        if event.client is None:  # set by the page itself
            return
        value = float(event.target.value)
        values = value if isinstance(like, float) else [value] * len(like)
        self.requests.put(SetParameters(key[0], {key[1]: values}))

    def _add_plot(self, title: str, names: tuple[str, ...], high: float, order: float | None = None) -> Any:
        empty = tuple(np.zeros(1) for _ in range(1 + len(names)))
        return self._gui.add_uplot(
            empty,
            (uplot.Series(label="time [s]"), *map(line, names)),
            scales=scales(high),
            title=title,
            height=170,
            padding=(8, 24, 0, 0),
            legend=uplot.Legend(live=False),
            order=order,
        )

    def _draw(self) -> None:
        newest = self._drawn = self._samples[-1][0]
        rows = np.array([row for row in self._samples if row[0] >= newest - LIVE.window])
        time, force, place = rows[:, :1], rows[:, 1 : 1 + len(FORCES)], rows[:, 1 + len(FORCES) :]
        between = np.diff(np.floor(rows[:, 0] / LIVE.mark), prepend=math.nan) == 0.0
        force[between, FORCES.index("at least")] = math.nan
        high = next((one for one in LIVE.ranges if one > np.nanmax(force, initial=0.0)), LIVE.ranges[-1])
        if high != self._high:
            # a plot whose scales are changed stays at its old range of time, and empty: another takes its place
            old, self._high = self._force_plot, high
            self._force_plot = self._add_plot(FORCE_TITLE, FORCES, high, old.order)
            old.remove()
        for plot, values in ((self._force_plot, force), (self._place_plot, place)):
            plot.data = tuple(np.ascontiguousarray(column) for column in np.hstack([time, values]).T)


def line(name: str) -> uplot.Series:
    """How a quantity is plotted: in points, as a line goes on where a NaN is; a lower bound in rings."""
    colour = COLOURS["estimated" if name == "at least" else name]
    is_bound = name == "at least"
    sizes = {"at least": 7.0, "true": 5.0}  # so that it is seen under a correct estimate
    points = {"show": True, "size": sizes.get(name, 2.5), "width": 1, "stroke": colour}
    points["fill"] = "white" if is_bound else colour
    return uplot.Series(label="at least (rings)" if is_bound else name, stroke=colour, width=0, points=points)


def scales(high: float) -> dict[str, uplot.Scale]:
    """Axes of a plot; that of the quantity is fixed, because a line without a number would blank the plot."""
    return {"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(auto=False, range=(0.0, high))}


def sample(snapshot: Snapshot) -> tuple[float, ...]:
    """Row of the plots: time; `FORCES`; `PLACES`.  NaN is a gap."""
    estimated, true = snapshot.estimated, snapshot.true
    newtons, is_bound = size(estimated.force), is_lower_bound(estimated)
    return (
        snapshot.seconds,
        size(true.force) if true.cover else 0.0,
        snapshot.commanded,
        snapshot.measured,
        math.nan if is_bound else newtons if estimated.cover else 0.0,
        newtons if is_bound else math.nan,
        true.position,
        estimated.position,
    )


def is_lower_bound(estimated: Contact) -> bool:
    """Whether the force is the least one that explains the torques, as it is where the position is not known."""
    return bool(estimated.cover) and not math.isfinite(estimated.position)


def legend(parts: Sequence[tuple[str, str, str]]) -> str:
    """What the colours of the scene mean, as HTML."""
    colours = {**COLOURS, "likely": LIKELY, "hand": HAND}
    marks = (f'<span style="color:{colours[name]}">{mark}</span> {text}' for mark, name, text in parts)
    return paragraph(" &nbsp; ".join(f'<span style="white-space:nowrap">{mark}</span>' for mark in marks))


def boxed(text: str, height: int) -> str:
    """HTML in a box of a height, px, so that what is below it stays where it is."""
    return f'<div style="height:{height}px;overflow-y:auto">{text}</div>'


def paragraph(text: str, colour: str = "") -> str:
    """A paragraph of the panel; `text` is HTML."""
    style = f";color:{colour}" if colour else ""
    return f'<p style="margin:2px 12px;font-size:13px;line-height:1.35{style}">{text}</p>'


def status_page(snapshot: Snapshot, pushing: float = 0.0, pressing: float = 0.0) -> str:
    """Status as HTML: the driver first, then what is done by hand, the nodes that warn, the contact."""
    driver = snapshot.statuses.get("driver", NodeStatus(Level.STALE, "none has come"))
    mode, is_paused = driver.mode or "waiting for the stack", PAUSED in driver.facts
    lost = bool(driver.mode) and not is_paused and snapshot.silent > LIVE.silent
    factor = f" · {snapshot.real_time_factor:.2f} × real time" if math.isfinite(snapshot.real_time_factor) else ""
    factor = " · paused" if is_paused else factor
    lines = [
        paragraph(
            f'<b style="font-size:18px">{dot(Level.STALE if lost else driver.level)} {mode}</b>'
            f" · {snapshot.seconds:.1f} s{factor}"
        )
    ]
    if lost:
        text = f"no state of the arm for {snapshot.silent:.0f} s: the stack has ended, waits for a node, or has "
        lines.append(paragraph(f"{text}another arm; then start 'wam live' again", DOTS[Level.ERROR]))
    if driver.fault:
        lines.append(paragraph(html.escape(driver.fault), DOTS[Level.ERROR]))
    if pressing:
        lines.append(press_text(snapshot, pressing))
    for name, status in sorted(snapshot.statuses.items()):
        if name != "driver" and (status.level is not Level.OK or status.step or name == "force_loop"):
            text = f"{name}: {status.step or status.message}{margin_text(status.facts)}"
            lines.append(paragraph(f"{dot(status.level)} {html.escape(text)}"))
    lines.append(paragraph(f"estimated: {contact_text(snapshot.estimated)}"))
    if snapshot.true.cover:
        lines.append(paragraph(f"true: {contact_text(snapshot.true)}"))
    if pushing:
        lines.append(paragraph(f"your hand pushes with <b>{pushing:.1f} N</b> of it"))
    return "".join(lines)


def press_text(snapshot: Snapshot, pressing: float) -> str:
    """What becomes of a commanded force, N, as HTML: the force loop may not do it."""
    loop = snapshot.statuses.get("force_loop")
    if loop is not None and any(event.cause != "speed" for event in loop.events):
        text = f"commanded {pressing:.1f} N; the force loop reports: {html.escape(loop.message)}"
        return paragraph(text, DOTS[Level.ERROR])
    if not snapshot.measured:
        return paragraph(f"commanded {pressing:.1f} N, nothing is measured yet")
    return paragraph(f"commanded <b>{pressing:.1f} N</b>, measured {snapshot.measured:.1f} N")


def margin_text(facts: Mapping[str, str]) -> str:
    """The factor by which the gains may be larger, as the guard of the force loop reports it, as HTML."""
    if "margin" not in facts:
        return ""
    text = f" · margin {facts['margin']}"
    with contextlib.suppress(KeyError, ValueError):  # where it is no number, only a part of it is known
        here = float(facts["margin here"])
        text += f" ({here:.4g} here)" * (here < float(facts["margin"]))
    return text


def dot(level: Level) -> str:
    """A dot in the colour of a level."""
    return f'<span style="color:{DOTS[level]}">&#9679;</span>'


def contact_text(contact: Contact) -> str:
    """A contact in a sentence, as HTML."""
    if not contact.cover:
        return "nothing touches the arm"
    bound, place = "at least ", "somewhere on"
    if math.isfinite(contact.position):
        deviation = f" ± {contact.position_sd * 100:.0f}" if math.isfinite(contact.position_sd) else ""
        bound, place = "", f"{contact.position * 100:.0f}{deviation} cm along"
    return f"<b>{bound}{size(contact.force):.1f} N</b> {place} the {html.escape(contact.cover.replace('_', ' '))}"
