"""The arm's time in realtime: a period of the steady clock is a period of the arm; the last command is held."""

import math
from collections import deque
from collections.abc import Callable

from wam_description.event import fault
from wam_driver.driver import Driver
from wam_driver.safety import Mode
from wam_driver.thresholds import DRIVER


class Realtime:
    """Advances the driver by the periods that are due, at most by the time that the watchdog allows.

    Parameters
    ----------
    driver : to be advanced; where more than its `late_periods` are late, the brakes stay on, and the reason of a fault
        names the computer, too.
    publish : called after a period, to publish the new state.
    now : steady clock, s.
    held_up : another node of this process that was in a long step, '' for none.

    Attributes
    ----------
    command_came : when the last command came, on that clock.
    is_started, start_overdue : this time begins at once.
    """

    is_started, start_overdue = True, False

    def __init__(
        self,
        driver: Driver,
        publish: Callable[[], None],
        now: Callable[[], float],
        held_up: Callable[[], str] = lambda: "",
    ) -> None:
        self._held_up = held_up
        self._driver, self._timing, self._parameters = driver, driver.timing, driver.parameters
        self._publish, self._now = publish, now
        self._latencies: list[float] = []
        self._sent: dict[int, float] = {}  # s on that clock, by stamp, since the last report
        self._done = self._missed = 0
        self._recent: deque[int] = deque()  # periods that were due at each tick in the window; all but one were late
        self._recent_done = 0
        self._connected = math.inf  # since when all nodes are, on that clock
        self.is_paused = False
        self.command_came = -math.inf

    def start(self) -> None:
        """Publish the first state."""
        # half a period of slack, so that a timer that comes a little early or late loses no period
        self._progress = self._now()
        self._begin = self._progress - 0.5 * self._timing.period
        self._send()

    def take_currents(self, stamp: int, currents: list[float]) -> None:
        """Take the command that answers the state of `stamp`."""
        self._driver.command(stamp, currents)
        self._progress = self.command_came = now = self._now()
        if sent := self._sent.pop(stamp, 0.0):
            self._latencies.append(now - sent)

    def take_push(self, stamp: int) -> None:
        """Note a disturbance: in realtime nothing waits for it."""

    def tick(self) -> None:
        """Advance by what is due; what is later than the watchdog allows is not made up for, and brakes."""
        now = self._now()
        due = int((now - self._begin) / self._timing.period) - self._done
        if due <= 0:
            return
        self._done += due
        if self.is_paused:
            return
        self._missed += due - 1
        self._recent.append(due)
        self._recent_done += due
        while self._recent_done > DRIVER.window and len(self._recent) > 1:
            self._recent_done -= self._recent.popleft()
        age = now - self._progress
        most = max(1, round(self._parameters.watchdog / self._timing.period))
        if due > most and self._driver.safety.mode is Mode.ENABLED:
            late = {"time": due * self._timing.period, "allowed": self._parameters.watchdog}
            cure = "give it a processor of its own, or use lockstep"
            event = fault("node_late", what="driver", cure=cure, **late)
            if step := self._held_up():
                event = fault("held_up", step=step, **late)
            self._driver.safety.trip(event)
        for left in range(min(due, most) - 1, -1, -1):
            self._driver.advance(age)
            if left == 0 or self._driver.is_outer:
                self._send()

    def settles(self) -> bool:
        """Whether the arm waits for few late periods; called again and again once all nodes are connected."""
        now = self._now()
        if self._connected == math.inf:
            self._connected = now
            self._recent.clear()
            self._recent_done = 0
        waited = now - self._connected
        if self._parameters.late_periods == 1.0 or waited >= DRIVER.longest_settling:
            return False
        return waited < DRIVER.settling or bool(self.lateness)

    @property
    def lateness(self) -> str:
        """How many of the newest periods were late and what to do about it, '' where few were."""
        count, late = self._recent_done, self._recent_done - len(self._recent)
        if late <= self._parameters.late_periods * count:
            return ""
        part, allowed = 100.0 * late / count, 100.0 * self._parameters.late_periods
        return (
            f"{part:.3g} % of the newest periods were late; allowed: {allowed:.3g} %; "
            "this computer is too busy or too slow for realtime; end other programs, or use lockstep"
        )

    def obstacle(self) -> str:
        """What speaks against a release of the brakes now, '' where nothing does."""
        now = self._now()
        self._progress = now
        if now - self.command_came > self._parameters.watchdog:
            return "no motor_current_command arrives; start velocity_loop and its peers, then enable"
        return self.lateness if now - self._connected >= DRIVER.settling else ""

    def _send(self) -> None:
        self._sent[self._driver.stamp] = self._now()
        self._publish()

    def pause(self, on: bool) -> None:
        """Stop the time, or let it go on."""
        self.is_paused = on
        self._progress = self._now()

    def step(self) -> str:
        """Advance a paused arm by one period, which is never refused."""
        self._driver.advance(0.0)
        self._send()
        return ""

    def facts(self) -> dict[str, str]:
        """For the diagnostics: latencies since the last report, late periods and rate since the start."""
        latencies, self._latencies = sorted(self._latencies) or [math.nan], []
        self._sent.clear()
        return {
            "latency p50 [us]": f"{latencies[len(latencies) // 2] * 1e6:.0f}",
            "latency p99 [us]": f"{latencies[int(len(latencies) * 0.99)] * 1e6:.0f}",
            "missed periods": str(self._missed),
            "periods": str(self._done),
            "rate [Hz]": f"{(self._done - self._missed) / (self._now() - self._begin):.1f}",
        }

    @property
    def summary(self) -> str:
        """How well the periods were kept, for people."""
        return f"{self._missed} late periods of {self._done}"
