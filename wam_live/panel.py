"""Status, buttons, sliders and plots of the page; what is pressed goes into a queue as requests."""

import html
import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from queue import SimpleQueue
from typing import Any, Final, NamedTuple

import numpy as np
import viser
from viser import uplot

from wam_analysis.drawing import COLOURS
from wam_description.arm import Arm
from wam_description.signals import BASE, Level, NodeStatus, Triple
from wam_description.wiring import Call, SetParameters
from wam_live.snapshot import Snapshot, size

WINDOW: Final = 15.0  # s of the arm's time in the plots
POINTS: Final = 300  # of a line at most
BUTTONS: Final[dict[str, dict[str, tuple[Call, ...]]]] = {  # by row: label and its requests
    "arm": {"Enable": (Call("driver", "enable", True),), "Brake": (Call("driver", "enable", False),)},
    "time": {
        "Pause": (Call("driver", "pause", True),),
        "Step": (Call("driver", "pause", True), Call("driver", "step")),
        "Run": (Call("driver", "pause", False),),
    },
    "reset": {"Fault": (Call("driver", "reset_fault"),), "Arm": (Call("driver", "reset"),)},
}
DOTS: Final = {Level.OK: "#2f9e44", Level.WARN: "#f08c00", Level.ERROR: "#e03131", None: "#adb5bd"}
SLIDERS: Final = {  # live parameters of nodes; value at the right end of the slider, step
    ("force_loop", "force_gain"): (0.2, 0.001),
    ("force_loop", "posture_gain"): (20.0, 0.1),
    ("force_loop", "force_error_limit"): (40.0, 0.5),
}


class Press(NamedTuple):
    """A commanded force of the arm on the world; zero ends it."""

    frame: str
    force: Triple  # N


class Play(NamedTuple):
    """A scenario to be played, its name or file; '' stops the one that is played."""

    script: str


NO_PRESS: Final = Press(BASE, (0.0, 0.0, 0.0))
FIRST_SCRIPT: Final = "demo_scenario"
Request = Call | SetParameters | Press | Play


class Controls:
    """The controls.

    Parameters
    ----------
    server : that shows them.
    arm : names of the covers.
    live : present values of live parameters by (node, name), for those of `SLIDERS`; None where the page plays a bag.
    dither : about the dither, which is chosen when the nodes start.

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
        self._samples: deque[tuple[float, ...]] = deque(maxlen=POINTS)
        self._sliders: dict[tuple[str, str], Any] = {}
        gui.configure_theme(control_width="medium", show_share_button=False)
        self._status = gui.add_html(status_page(Snapshot(), 0.0))
        self._said = gui.add_html("")
        if live is not None:
            self._add_buttons()
            self._add_press(arm)
            self._add_scenario()
        self._force_plot = self._add_plot("force [N]", ("commanded", "measured", "estimated", "true"), {"auto": True})
        self._place_plot = self._add_plot(
            "position along the link [m]", ("estimated", "true"), {"auto": False, "range": (0.0, max(arm.covers.end))}
        )
        if live:
            self._add_sliders(live)
        if dither:
            gui.add_html(paragraph(html.escape(dither)))

    def show(self, snapshot: Snapshot, pushing: float = 0.0) -> None:
        """Show an instant; call it a few times a second."""
        self.snapshot = snapshot
        self._status.content = status_page(snapshot, pushing)
        if self._samples and snapshot.seconds < self._samples[-1][0]:
            self._samples.clear()  # the arm was started again, or the bag was moved back
        if not self._samples or snapshot.seconds > self._samples[-1][0] + WINDOW / POINTS:
            self._samples.append(sample(snapshot))
            self._draw()

    def fill(self, past: Iterable[Snapshot]) -> None:
        """Take what was before the next instant, oldest first; the plots begin with it."""
        self._samples.clear()
        self._samples.extend(sample(snapshot) for snapshot in past)
        if self._samples:
            self._draw()

    def say(self, text: str, refused: bool = False) -> None:
        """Show the answer to the last request."""
        self._said.content = paragraph(
            f"{'refused: ' * refused}{html.escape(text)}", DOTS[Level.ERROR] if refused else ""
        )

    def set_slider(self, node: str, name: str, value: Any) -> None:
        """Put a slider where its parameter is."""
        if (slider := self._sliders.get((node, name))) is not None:
            slider.value = float(np.ravel(value)[0])

    # made once

    def _add_buttons(self) -> None:
        stop = self._gui.add_button("Emergency stop", hint="stop at once and latch a fault", color="red")
        stop.on_click(lambda _: self.requests.put(Call("driver", "estop")))
        for row, buttons in BUTTONS.items():
            group = self._gui.add_button_group(row, tuple(buttons))
            group.on_click(lambda event, buttons=buttons: self._ask(buttons[event.target.value]))

    def _ask(self, requests: Sequence[Request]) -> None:
        for request in requests:
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

    def _add_plot(self, title: str, names: tuple[str, ...], scale: dict[str, Any]) -> Any:
        empty = tuple(np.zeros(1) for _ in range(1 + len(names)))
        lines = [uplot.Series(label=name, stroke=COLOURS[name], width=2, spanGaps=False) for name in names]
        return self._gui.add_uplot(
            empty,
            (uplot.Series(label="time [s]"), *lines),
            scales={"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(**scale)},
            title=title,
            height=170,
        )

    def _draw(self) -> None:
        newest = self._samples[-1][0]
        rows = np.array([row for row in self._samples if row[0] >= newest - WINDOW])
        time, force, place = rows[:, :1], rows[:, 1:5], rows[:, 5:7]
        for plot, values in ((self._force_plot, force), (self._place_plot, place)):
            # a NaN would blank the whole plot
            plot.data = tuple(np.ascontiguousarray(column) for column in np.hstack([time, np.nan_to_num(values)]).T)


def sample(snapshot: Snapshot) -> tuple[float, ...]:
    """Row of the plots: time; force commanded, measured, estimated, true; position estimated, true."""
    estimated, true = snapshot.estimated, snapshot.true
    return (
        snapshot.seconds,
        snapshot.commanded,
        snapshot.measured,
        size(estimated.force) if estimated.cover else 0.0,
        size(true.force) if true.cover else 0.0,
        estimated.place,
        true.place,
    )


def paragraph(text: str, colour: str = "") -> str:
    """A paragraph of the panel; `text` is HTML."""
    style = f";color:{colour}" if colour else ""
    return f'<p style="margin:2px 12px;font-size:13px;line-height:1.35{style}">{text}</p>'


def status_page(snapshot: Snapshot, pushing: float) -> str:
    """Status as HTML: the driver first, then the nodes that warn, then the contact."""
    driver = snapshot.statuses.get("driver")
    mode = mode_of(snapshot.statuses) or "waiting for the stack"
    factor = f" · {snapshot.real_time_factor:.2f} × real time" if math.isfinite(snapshot.real_time_factor) else ""
    lines = [
        paragraph(
            f'<b style="font-size:18px">{dot(driver.level if driver else None)} {mode}</b>'
            f" · {snapshot.seconds:.1f} s{factor}"
        )
    ]
    if driver and driver.fault:
        lines.append(paragraph(html.escape(driver.fault), DOTS[Level.ERROR]))
    for name, status in sorted(snapshot.statuses.items()):
        if name != "driver" and (status.level is not Level.OK or status.step or name == "force_loop"):
            text = f"{name}: {status.step or status.message}{margin_text(status.facts)}"
            lines.append(paragraph(f"{dot(status.level)} {html.escape(text)}"))
    lines.append(paragraph(contact_text(snapshot)))
    if pushing:
        lines.append(paragraph(f"you push with <b>{pushing:.1f} N</b>"))
    return "".join(lines)


def mode_of(statuses: Mapping[str, NodeStatus]) -> str:
    """State of the driver, '' where it is not known."""
    driver = statuses.get("driver")
    return driver.mode if driver else ""


def margin_text(facts: Mapping[str, str]) -> str:
    """By how much the gains may be larger, as the guard of the force loop reports it."""
    if "margin" not in facts:
        return ""
    here = facts.get("margin here", facts["margin"])
    return f" · margin {facts['margin']}" + f" ({here} here)" * (here != facts["margin"])


def dot(level: Level | None) -> str:
    """A dot in the colour of a level."""
    return f'<span style="color:{DOTS[level]}">&#9679;</span>'


def contact_text(snapshot: Snapshot) -> str:
    """The estimated contact in a sentence, as HTML."""
    contact = snapshot.estimated
    if not contact.cover:
        return "nothing touches the arm"
    place = "somewhere on"
    if math.isfinite(contact.place):
        spread = f" ± {contact.position_sd * 100:.0f}" if math.isfinite(contact.position_sd) else ""
        place = f"{contact.place * 100:.0f}{spread} cm along"
    return f"<b>{size(contact.force):.1f} N</b> {place} the {html.escape(contact.cover.replace('_', ' '))}"
