"""The arm's time in lockstep: a period passes when the present state has been answered and the next one is due."""

from collections.abc import Callable, Mapping, Sequence

from wam_description.arm import seconds
from wam_description.event import Event, fault
from wam_description.interface import Interface
from wam_description.status import BEHIND, REAL_TIME_FACTOR, SLIPS
from wam_driver.driver import Driver
from wam_driver.pacer import Pacer
from wam_driver.session import Session
from wam_driver.thresholds import DRIVER


def unpublished(found: Mapping[str, Sequence[str]], instead: str = "") -> str:
    """What to do about nodes that run and do not answer, each with the topics that it did not publish."""
    node, topics = next(iter(found.items()))
    which = " and ".join(topics)
    if not node:
        return f"list a node in 'nodes' that publishes {which}{instead}"
    return f"{node} runs, but did not publish {which}: its step has to return this each time"


class Lockstep:
    """Advances the driver with the command that answers its present state, and reports when none comes.

    Where no answer comes within `timing.timeout`, there is a fault that names the topic and the node.  Shortly before,
    a new session is announced.  A node that does not report that it follows has stopped; of those that do, the one
    that lacks nothing for its step has not answered.  After the fault the arm is braked.  It advances by one period
    every `watch`, so that a node that was restarted gets states.  With the next answer lockstep goes on.

    Parameters
    ----------
    driver : to be advanced.
    interface : of the bring-up, whose nodes answer each state; a scenario answers those of outer periods.
    session : that the nodes follow.
    publish : called after each period, to publish the new state.
    announce : called to publish the session.
    stop : called with the reason, to stop the arm.
    now : steady clock, s.
    faults : of nodes that still report one, and so may not answer, '' for none.

    Attributes
    ----------
    pacer : determines when a period is due; also measures.
    is_started : whether the first state was published.
    """

    def __init__(
        self,
        driver: Driver,
        interface: Interface,
        session: Session,
        publish: Callable[[], None],
        announce: Callable[[], None],
        stop: Callable[[Event], None],
        now: Callable[[], float],
        faults: Callable[[], str],
    ) -> None:
        timing = driver.timing
        self._driver, self._timing, self._interface = driver, timing, interface
        self._is_played = "scenario" in interface.names
        topics = ["motor_current_command", *["sim/disturbance"] * self._is_played]
        self._senders = {topic: " and ".join(interface.publishers(topic)) or "its publisher" for topic in topics}
        self._session, self._announce = session, announce
        self._publish, self._stop, self._now, self._faults = publish, stop, now, faults
        self.pacer = Pacer(timing.real_time_factor, now)
        self._currents: tuple[int, list[float]] = (0, [])
        self._push_stamp = 0
        self.is_started = self.is_paused = False
        self._patience = timing.timeout
        self._roll_call = timing.timeout - min(DRIVER.roll_call, 0.5 * timing.timeout)
        self._is_called = False
        self._advice = ""  # what to do about an answer that is overdue
        self._waited, self._looked = 0.0, now()

    def start(self) -> None:
        """Publish the first state."""
        self.is_started = True
        self._waited = 0.0
        self._publish()

    def take_currents(self, stamp: int, currents: list[float]) -> None:
        """Take the command that answers the state of `stamp`; one that is older than the last is of no use."""
        if stamp > self._currents[0]:
            self._currents = (stamp, currents)
            self.go_on()

    def take_push(self, stamp: int) -> None:
        """Note that the disturbance of an outer period has come."""
        self._push_stamp = stamp
        self.go_on()

    @property
    def missing(self) -> list[str]:
        """Topics on which the present state is not answered yet."""
        stamp = self._driver.stamp
        missing = [] if self._currents[0] == stamp else ["motor_current_command"]
        if self._is_played and self._push_stamp != stamp and self._driver.is_outer:
            missing.append("sim/disturbance")
        return missing

    def go_on(self) -> None:
        """Advance by a period if all is there and it is due."""
        if not self.is_started or self.is_paused or self.missing:
            return
        if self.pacer.is_due(self._driver.stamp + self._timing.period_ns):
            self._patience = self._timing.timeout
            self._is_called = False
            self._one_period()

    def _one_period(self) -> None:
        self._driver.command(*self._currents)
        self._driver.advance(0.0)
        self._waited = 0.0
        self._publish()

    def watch(self) -> None:
        """Look whether an answer is overdue; to be called every `watch` seconds."""
        now = self._now()
        self._waited += min(now - self._looked, DRIVER.longest_look)
        self._looked = now
        if not self.is_started or self.is_paused or not (missing := self.missing):
            return
        if self._waited >= self._roll_call and not self._is_called:
            self._is_called = True
            self._session.begin()
            self._announce()
        if self._waited >= self._patience:
            self._advice, topics, allowed = self._cause(missing), " and ".join(missing), self._timing.timeout
            stamp = self._driver.stamp
            self._stop(fault("unanswered", topics=topics, stamp=stamp, allowed=allowed, cure=self._advice))
            self._patience = 0.5 * DRIVER.watch  # at the next look again
            self.pacer.restart()
            self._one_period()

    def _cause(self, missing: list[str]) -> str:
        """The node that is the reason, and what to do about it."""
        if faults := self._faults():
            return faults
        if silent := ", ".join(self._session.silent):
            return f"{silent} has stopped or is very slow; if it has stopped, start it, or 'wam up', again"
        found = self._interface.unanswered(missing, self._session.awaited)
        unknown = sorted(found.keys() - self._session.awaited.keys() - {""})
        if unknown or not found:
            senders = unknown or [self._senders[topic] for topic in missing]
            return f"check that {' and '.join(senders)} run{'s' * (len(senders) == 1)}"
        return unpublished(found, ", or start yours, then call reset_fault")

    @property
    def start_overdue(self) -> bool:
        """Whether the start is awaited for longer than the time-out."""
        return not self.is_started and self._waited >= self._timing.timeout

    lateness = ""  # nothing is late in lockstep

    def obstacle(self) -> str:
        """What speaks against a release of the brakes now, '' where nothing does."""
        if self.is_started and self._patience < self._timing.timeout:
            return f"no {' and '.join(self._senders)} arrives; {self._advice}; then enable"
        return ""

    def pause(self, on: bool) -> None:
        """Stop the time, or let it go on."""
        self.is_paused = on
        self._waited = 0.0
        self.pacer.restart()
        self.go_on()

    def step(self) -> str:
        """Advance a paused arm by one period; why that is refused, '' where it is not."""
        if missing := self.missing:
            return f"still waiting for {' and '.join(missing)}"
        self._one_period()
        return ""

    def facts(self) -> dict[str, str]:
        """For the diagnostics: the pace, where it is one; without a pace nothing depends on the wall clock."""
        if not self._timing.real_time_factor:
            return {}
        factor, behind = self.pacer.report()
        return {
            REAL_TIME_FACTOR: f"{factor:.3f}",
            BEHIND: f"{behind * 1e3:.1f}",
            SLIPS: str(self.pacer.slips),
        }

    @property
    def summary(self) -> str:
        """How fast time has passed, for people."""
        simulated, elapsed = self.pacer.passed
        if not elapsed:
            return f"it ended at {seconds(self._driver.stamp):.3g} s of the arm's time"
        return f"{simulated:.1f} s of the arm in {elapsed:.1f} s: real-time factor {simulated / elapsed:.2f}"
