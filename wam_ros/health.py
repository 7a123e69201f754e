"""What a node reports: its status, latched, where it changes; a driver in realtime repeats it; its diagnostics."""

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from wam_bag.printable import printable
from wam_description.agreement import DIGESTS, digests
from wam_description.event import Code, Event, Level, fault
from wam_description.event_text import sentence
from wam_description.parameters import listed
from wam_description.signals import NodeStatus
from wam_description.status import AWAITED, BUSY, CHANGES, HELD_UP, REFUSED, diagnosed_name, with_refused
from wam_description.topics import STATUS
from wam_ros.limits import NODE_LIMITS
from wam_ros.long_steps import STEPS, LongStep
from wam_ros.messages import diagnostic_status
from wam_ros.ros_topics import DIAGNOSTICS, SECOND, header

READY = NodeStatus(Level.OK, "ready", connected=True)
WAITING = NodeStatus(Level.WARN, "waiting for its peers")
WRITTEN, NODE, ENDED = "written ", "node", "ended"  # keys of the report, the first before a full topic name


def problem_of(cause: str, reason: str) -> Event | None:
    """Why the driver has to brake, None where there is no reason."""
    return fault(cause, reason=reason) if reason else None


@dataclass
class Refusal:
    """The messages of a topic that a node has refused, or that have another defect of one code.

    Attributes
    ----------
    count : of all.
    reason : why the newest was.
    stamp : of the newest that the node itself has refused, ns, which comes to each of its steps until the next one.
    stated : reason that the status has, '' where it has none.
    recent : newest reason since the last report that the status may have, '' where there was none.
    """

    count: int = 0
    reason: str = ""
    stamp: int | None = None
    stated: str = ""
    recent: str = ""


class Health:
    """What one node reports: its status with its problems and refusals, and once a second its diagnostics.

    Parameters
    ----------
    node : a `wam_ros.connections.StackNode`; its `take_problem` is called with a new problem.

    Attributes
    ----------
    status : as it was published last.
    plain : of the node's work alone, as it was published last.
    counts : steps and whatever else the node counts, for the diagnostics.
    facts : further values for the diagnostics.
    problems : why the driver has to brake, by what is concerned: an input that is lost, a topic with two publishers.
    refusals : by topic.
    session : of the driver that this node follows, 0 before it is known.
    is_ready : whether every expected peer is connected.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self.status = self.plain = WAITING
        self.counts: Counter[str] = Counter()
        self.digests = digests(node.shared)
        self.problems: dict[str, Event] = {}
        self.refusals = defaultdict[str, Refusal](Refusal)
        self._defects = {Code.REFUSED: self.refusals, Code.UNSTAMPED: defaultdict[str, Refusal](Refusal)}
        self.session = 0
        self.is_ready = False
        self._changes: tuple[int, dict[str, str]] = (-1, {})  # stamp of the step before, and what was taken after it
        self._repeated = time.monotonic()  # when the status was, on that clock
        self.facts: dict[str, str] = {}
        self._next = self._last = 0  # stamps of diagnostics, ns

    # the status

    def publish(self, status: NodeStatus) -> None:
        """Publish the status of the node's work, where it has changed; a driver's has its problems already."""
        self.plain = status
        for code, refusals in self._defects.items():
            stated = {topic: one.stated for topic, one in refusals.items() if one.stated}
            status = with_refused(status, stated, code)
        if self.problems and not status.mode:
            events = (*status.events, *self.problems.values())
            status = status._replace(level=Level.ERROR, message=self.problem, fault=self.problem, events=events)
        status = self._whole(status._replace(session=status.session or self.session))
        if status != self.status:
            if self._node.shared.timing.mode == "lockstep" or status.session != self.status.session:
                # only the last status is kept: a recording, and a driver that is followed, lack none
                self._node.outlets.is_taken(STATUS, NODE_LIMITS.status_echo)
            self.status = status
            self._send(status)

    def publish_again(self) -> None:
        """Publish the status with the present problems and refusals; that the node is ready, where it has none yet."""
        self.publish(READY if self.plain is WAITING and self.is_ready else self.plain)

    def _whole(self, status: NodeStatus) -> NodeStatus:
        """A status with what the other nodes compare, and take, of the shared parameters."""
        facts = {**status.facts, DIGESTS: self.digests} if self.digests else status.facts
        return status._replace(node=self._node.get_name(), connected=self.is_ready, facts=facts)

    def _send(self, status: NodeStatus) -> None:
        self._node.outlets.send(STATUS, diagnostic_status(status, self._node.shared.arm.name))

    def repeat(self) -> None:
        """Publish the present status once more, as a message may be lost on a loaded machine."""
        self._send(self.status)

    def repeat_taken(self) -> None:
        """`repeat`, but not over one that is still on its way: replaced, it would be a loss to a recorder.

        One that a frozen node does not take holds up the others no longer than `NODE_LIMITS.status_on_its_way`.
        """
        now = time.monotonic()
        if now - self._repeated > NODE_LIMITS.status_on_its_way or self._node.outlets.is_taken(STATUS):
            self._repeated = now
            self.repeat()

    def report_long_step(self, step: LongStep) -> None:
        """Publish that this node is inside a long step, which holds up those of its process; from another thread."""
        self._send(self._with(self.status, {BUSY: str(step), HELD_UP: " ".join(STEPS.nodes)}))

    def follow(self, session: int, awaited: Collection[str] | None) -> None:
        """Report that this node follows another session of the driver.

        Parameters
        ----------
        awaited : topics that it lacks for its next step; None for a node that has not been there before.
        """
        facts = {} if awaited is None or not self.session else {AWAITED: " ".join(awaited)}  # at the start nobody asks
        self.session = session
        if self.is_ready:
            plain = self.plain
            self.publish(self._with(plain, facts))
            self.plain = plain

    def report_change(self, stamp: int, values: Mapping[str, Any]) -> None:
        """Publish live parameters that the node has taken after its step of a stamp, ns: a replay needs both.

        What was taken after one step is reported together, so that only the last message is needed.
        """
        after, before = self._changes
        facts = before if stamp == after else {CHANGES: "yes"}
        facts |= {f"{self._node.get_name()}:{name}": str(listed(value)) for name, value in values.items()}
        self._changes = stamp, facts
        self.status = self._whole(self.status)
        self._send(self._with(self.status, facts)._replace(stamp=stamp))

    @staticmethod
    def _with(status: NodeStatus, facts: Mapping[str, str]) -> NodeStatus:
        return status._replace(facts={**status.facts, **facts})

    # problems and refusals

    @property
    def problem(self) -> str:
        """The first problem that there is in words, '' where there is none."""
        return next(map(sentence, self.problems.values()), "")

    def set_problem(self, concerned: str, problem: Event | None) -> None:
        """State in the status, with level ERROR, why the driver has to brake; None where nothing is wrong any more."""
        if self.problems.get(concerned) == problem:
            return
        if problem is None:
            del self.problems[concerned]
        else:
            self.problems[concerned] = problem
            self._node.get_logger().error(sentence(problem))
        self._node.take_problem(problem)

    def refuse(
        self,
        topic: str,
        reason: str,
        is_reported: bool = False,
        stamp: int | None = None,
        code: Code = Code.REFUSED,
    ) -> None:
        """Count a refused message, or one of another defect.

        The first of several is logged, and the status has the reason until a report.

        Parameters
        ----------
        is_reported : whether the status leaves it to the others that are late as well; one a second
            is logged.
        stamp : of a message that may be refused again, ns; it counts once.
        """
        refusal = self._defects[code][topic]
        if stamp is not None:
            if stamp == refusal.stamp:
                return
            refusal.stamp = stamp
        refusal.count, refusal.reason = refusal.count + 1, reason
        log, text = self._node.get_logger(), f"{topic}: {code.words}: {printable(reason, NODE_LIMITS.reason_length)}"
        if topic in self.plain.facts.get(REFUSED, "").split(", "):
            return  # the node states it itself
        if is_reported:
            log.warning(text, throttle_duration_sec=NODE_LIMITS.log_period)
        elif topic not in self.problems:
            refusal.recent = reason
            if not refusal.stated:
                refusal.stated = reason
                log.warning(text)
                self.publish_again()

    # the diagnostics

    def report(self, stamp: int, facts: Callable[[], Mapping[str, str]] = dict) -> None:
        """Publish the diagnostics, with further facts, once in a second of the arm's time.

        The status leaves out what has not been refused since the last time.
        """
        if stamp < self._next:
            return
        self._next = stamp - stamp % SECOND + SECOND
        self._last = stamp
        self.facts |= facts()
        self._report()
        every = [one for refusals in self._defects.values() for one in refusals.values()]
        if any(one.stated for one in every):
            for one in every:
                one.stated, one.recent = one.recent, ""
            self.publish_again()

    def report_end(self) -> None:
        """Report how much was written in all."""
        self.facts[ENDED] = "yes"
        self._report()

    def _report(self) -> None:
        """Publish the diagnostics, with how many messages were written for others on each topic, this one included."""
        node, outlets = self._node, self._node.outlets
        totals = {**outlets.written, DIAGNOSTICS: outlets.written[DIAGNOSTICS] + 1}
        refused = {
            f"{code.words} on {topic}": one.count
            for code, refusals in self._defects.items()
            for topic, one in refusals.items()
        }
        facts = {key: str(count) for key, count in sorted({**self.counts, **refused}.items())}
        facts |= {NODE: node.get_fully_qualified_name()}
        facts |= {f"{WRITTEN}{outlets.full[topic]}": str(count) for topic, count in totals.items()}
        facts |= self.facts
        name, present = diagnosed_name(node.get_namespace(), node.get_name()), self.status
        status = NodeStatus(present.level, present.message, name, self.is_ready, fault=present.fault, facts=facts)
        message = diagnostic_status(status, self._node.shared.arm.name)
        outlets.send(DIAGNOSTICS, DiagnosticArray(header=header(self._last), status=[message]))
