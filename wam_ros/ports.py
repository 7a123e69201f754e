"""A node's connections, made from its interface: typed, counted, and ready when all are matched."""

import time
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.subscription import Subscription

from wam_description.agreement import DIGESTS, digests, disagreement
from wam_description.arm import Shared
from wam_description.event import Event, Level, fault
from wam_description.event_text import sentence
from wam_description.interface import Interface
from wam_description.nodes import NODES
from wam_description.parameters import listed
from wam_description.signals import NodeStatus
from wam_description.status import AWAITED, BUSY, CHANGES, HELD_UP, diagnosed_name, guidance, with_refused
from wam_description.topics import STATUS
from wam_description.wiring import Declaration
from wam_ros.limits import NODE_LIMITS
from wam_ros.long_steps import STEPS, LongStep
from wam_ros.messages import Refused, diagnostic_status, message_type, read_status
from wam_ros.outlets import Outlets
from wam_ros.priority import PRIORITY, set_priority
from wam_ros.refusals import Claims, Refusals
from wam_ros.tolerance import TolerantNode
from wam_ros.topics import DIAGNOSTICS, SECOND, header, listening, topic_name
from wam_ros.wire import decoder, deserialized, stamp_of

READY = NodeStatus(Level.OK, "ready", connected=True)
WAITING = NodeStatus(Level.WARN, "waiting for its peers")
PUBLISHED, NODE, ENDED = "published ", "node", "ended"  # keys of the report, the first before a full topic name
PARAMETERS = "parameters of "  # beginning of what a problem concerns, before the name of a node


def problem_of(cause: str, reason: str) -> Event | None:
    """Why the driver has to brake, None where there is no reason."""
    return fault(cause, reason=reason) if reason else None


class Changes:
    """Live parameters that a node has taken: those after one step are reported together."""

    def __init__(self) -> None:
        self._after, self._number = -1, 0
        self._facts: dict[str, str] = {}

    def add(self, stamp: int, values: Mapping[str, str]) -> dict[str, str]:
        """Everything that was taken after the step of a stamp, ns, with the number of this report."""
        if stamp != self._after:
            self._after, self._number = stamp, self._number + 1
            self._facts = {CHANGES: str(self._number)}
        self._facts |= values
        return self._facts


class Ports:
    """Publishers and subscriptions of one node.

    Parameters
    ----------
    node : the ROS node.
    declaration : of the node.
    shared : the shared configuration.
    interface : of the bring-up; names which peers to expect.

    Attributes
    ----------
    counts : steps and whatever else the node counts, for the diagnostics.
    refusals : messages that were refused.
    facts : further values for the diagnostics.
    live : present values of the shared parameters that the node owns, as facts of its status.
    faults : present fault of each other node, '' where it has none.
    problems : why the driver has to brake, by what is concerned: an input that is lost, a topic with two publishers.
    session : of the driver that this node follows, 0 before it is known.
    claims : who publishes what this node works on.
    takes_problem : called with a new problem, where the node itself has to brake.
    waits : whether the node waits for something else before it is ready.
    """

    def __init__(self, node: TolerantNode, declaration: Declaration, shared: Shared, interface: Interface) -> None:
        self.node, self.shared, self.interface = node, shared, interface
        self.counts: Counter[str] = Counter()
        self.refusals = Refusals(node)
        self.facts: dict[str, str] = {}
        self.faults: dict[str, str] = {}
        self.problems: dict[str, Event] = {}
        self.session = 0
        self._name = declaration.name
        self._busy: dict[str, tuple[str, frozenset[str]]] = {}  # by node in a long step: what, and who waits for it
        self._changes = Changes()
        self._status = self._plain = WAITING
        self._digests = digests(shared)
        self.live: dict[str, str] = {}
        self.takes_problem: Callable[[Event | None], None] | None = None
        self.waits: Callable[[], bool] = lambda: False
        self._repeated = time.monotonic()  # when the status was, on that clock
        self._wanted: NodeStatus | None = None
        self._next_report = self._last_report = 0
        self._absent: set[str] = set()
        self._subscriptions: dict[str, Subscription] = {}
        self.claims = Claims(node)
        rows = [interface.topics[topic] for topic in declaration.outputs if topic in interface.topics]
        own = [interface.topics[topic] for topic in (STATUS, DIAGNOSTICS)]
        self._outlets = Outlets(node, rows, own, shared)
        self._last_steps = self._seconds_without_step = 0
        # mode, whether nodes are missing, faulty nodes
        self._informed: tuple[str, bool, tuple[str, ...]] = ("", True, ())
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._readiness = node.create_timer(0.02, self._look_for_peers, clock=steady)
        node.create_timer(NODE_LIMITS.claim_period, self._look_for_rivals, clock=steady)
        if shared.timing.mode == "realtime":  # in lockstep nothing is published by the wall clock
            node.create_timer(1.0, self._report_standstill, clock=steady)

    def publish(self, topic: str, stamp: int, value: Any) -> None:
        """Publish a value on a topic of the table, with the stamp of the state that caused it, ns."""
        self._outlets.publish(topic, stamp, value)

    def feed(
        self,
        topic: str,
        take: Callable[[int, Any], None],
        arrays: str = "",
        accepts: Callable[[int], bool] | None = None,
    ) -> None:
        """Subscribe to values.

        Parameters
        ----------
        topic : name in the table of topics.
        take : called with the stamp, ns, and the value; it may raise Refused.
        arrays : of a JointState, the arrays that must be filled; one with a '?' may be empty.
        accepts : whether a message of a stamp is of interest; others are not decoded.
        """
        decode = decoder(self.interface.topics[topic], self.shared, arrays)

        def receive(data: bytes) -> None:
            if is_local:  # what a second publisher sends does not come here
                if rivals := self.problems.get(topic):
                    raise Refused(sentence(rivals))
            elif subscription.get_publisher_count() > 1 and (rivals := self.claims.rivals(topic)):
                self.set_problem(topic, rivals)
                raise Refused(sentence(rivals))
            stamp = stamp_of(data)
            if accepts is None or accepts(stamp):
                take(stamp, decode(data))

        is_local = self.listen(topic, receive, raw=True)
        self.claims.subscriptions[topic] = subscription = self._subscriptions[topic]

    def listen(self, topic: str, take: Callable[[Any], None], raw: bool = False) -> bool:
        """Subscribe; a message that `take` refuses is counted and reported, and the last good one is used.

        Returns whether the messages come without the middleware, see `wam_ros.local_bus`.

        Parameters
        ----------
        topic : name in the table of topics.
        take : called with the message, or its bytes where `raw`; it may raise Refused.
        """

        def receive(message: Any) -> None:
            try:
                take(message)
            except Refused as reason:
                self.refusals.add(topic, str(reason), reason.kind)
                is_own = not (reason.kind or self.problems.get(topic))
                if is_own and self.refusals.show(topic, str(reason)):
                    self.publish_status(self._plain)

        row = self.interface.topics[topic]
        profile = listening(row)
        if not row.latched and self.shared.timing.mode == "realtime":
            profile.depth = NODE_LIMITS.newest_kept  # a late node works on the newest state
        kind = message_type(row)
        name = topic_name(self.node, row)
        bus, is_local = self._outlets.bus, False
        if bus is not None and raw and not row.latched and bus.carries(self.interface.publishers(topic)):
            bus.subscribe(self.node.resolve_topic_name(name), self.node.bearing(receive, f"a message on {topic}"))
            profile.depth, is_local = 1, True
        subscription = self.node.create_subscription(kind, name, receive, profile, raw=raw)
        if is_local:
            self.node.leave_unserved(subscription)
        self._subscriptions[topic] = subscription
        return is_local

    def repeat_status(self) -> None:
        """Publish the present status once more, as a message may be lost on a loaded machine."""
        self._outlets.send(STATUS, diagnostic_status(self._status, self.shared.arm.name))

    def report_long_step(self, step: LongStep) -> None:
        """Publish that this node is inside a long step, which holds up those of its process; from another thread."""
        status = self._status._replace(facts={**self._status.facts, BUSY: str(step), HELD_UP: " ".join(STEPS.nodes)})
        self._outlets.send(STATUS, diagnostic_status(status, self.shared.arm.name))

    def held_up(self, nodes: Collection[str]) -> str:
        """The long step of another node that holds up one of these nodes, '' for none."""
        found = [reason for reason, held in self._busy.values() if not held.isdisjoint(nodes)]
        if step := STEPS.recent():
            found += [str(step)] * (not STEPS.nodes.isdisjoint(nodes))
        return next(iter(found), "")

    def repeat_taken_status(self) -> None:
        """`repeat_status`, but not over one that is still on its way: replaced, it would be a loss to a recorder.

        One that a frozen node does not take holds up the others no longer than `NODE_LIMITS.status_on_its_way`.
        """
        now = time.monotonic()
        if now - self._repeated > NODE_LIMITS.status_on_its_way or self._outlets.is_taken(STATUS):
            self._repeated = now
            self.repeat_status()

    def set_problem(self, concerned: str, problem: Event | None) -> None:
        """State in the status, with level ERROR, why the driver has to brake; None where nothing is wrong any more."""
        if self.problems.get(concerned) == problem:
            return
        if problem is None:
            del self.problems[concerned]
        else:
            self.problems[concerned] = problem
            self.node.get_logger().error(sentence(problem))
        if self.takes_problem is not None:
            self.takes_problem(problem)
        else:
            self.publish_status(self._plain._replace(connected=self.ready))

    @property
    def problem(self) -> str:
        """The first problem that there is in words, '' where there is none."""
        return next(map(sentence, self.problems.values()), "")

    def report_change(self, stamp: int, values: Mapping[str, Any]) -> None:
        """Publish live parameters that the node has taken after its step of a stamp, ns: a replay needs both.

        What was taken after one step is reported together, so that only the last message is needed.
        """
        texts = {name: str(listed(value)) for name, value in values.items()}
        changed = self._changes.add(stamp, {f"{self._name}:{name}": text for name, text in texts.items()})
        self.live |= {name: text for name, text in texts.items() if name in self.live}
        self._status = self._with_shared(self._status)
        status = self._status._replace(stamp=stamp, facts={**self._status.facts, **changed})
        self._outlets.send(STATUS, diagnostic_status(status, self.shared.arm.name))

    def _with_shared(self, status: NodeStatus) -> NodeStatus:
        """A status of this node with what the others compare and take of its shared parameters."""
        return status._replace(node=self._name, facts={**status.facts, DIGESTS: self._digests, **self.live})

    def follow(self, session: int, awaited: Collection[str]) -> None:
        """Report that this node follows another session of the driver, and which topics it lacks for its next step."""
        facts = {AWAITED: " ".join(awaited)} if self.session else {}  # at the start nobody asks
        self.session = session
        self.claims.restart()
        if self.ready:
            plain = self._plain._replace(connected=True)
            self.publish_status(plain._replace(facts={**plain.facts, **facts}))
            self._plain = plain

    def _look_for_rivals(self) -> None:
        for topic in self.claims.subscriptions:
            self.set_problem(topic, self.claims.rivals(topic))
        expected = self.interface.declarations
        for concerned in [problem for problem in self.problems if problem.startswith(PARAMETERS)]:
            node = concerned.removeprefix(PARAMETERS)
            if node not in expected and node not in self.node.get_node_names():
                self.set_problem(concerned, None)  # it has ended, or never was: its status was replayed

    def set_status(self, status: NodeStatus) -> None:
        """Publish the status of the node, latched; kept until the node is ready."""
        if not self.ready:
            self._wanted = status
            return
        self.publish_status(status._replace(connected=True))

    def publish_status(self, status: NodeStatus) -> None:
        """Publish the status of the node as it is, where it has changed."""
        self._plain = status
        status = with_refused(status, self.refusals.unusable)
        problem = self.problem if self.takes_problem is None else ""
        if problem:
            events = (*status.events, *self.problems.values())
            status = status._replace(level=Level.ERROR, message=problem, fault=problem, events=events)
        status = self._with_shared(status._replace(session=status.session or self.session))
        if status != self._status:
            if self.shared.timing.mode == "lockstep" or status.session != self._status.session:
                # only the last status is kept: a recording, and a driver that is followed, lack none
                self._outlets.is_taken(STATUS, NODE_LIMITS.status_echo)
            self._status = status
            self._outlets.send(STATUS, diagnostic_status(status, self.shared.arm.name))
            self._inform()

    def _inform(self) -> None:
        """Print on the console what the driver's state is and what to call next, where that has changed."""
        mode = self._status.mode
        faulty = tuple(sorted(node for node, fault in self.faults.items() if fault)) if mode == "braked" else ()
        state = (mode, bool(self._absent), faulty)
        if not self._status.mode or state == self._informed:
            return
        before, self._informed = self._informed[0], state
        is_played = "scenario" in self.shared.nodes
        self.node.get_logger().info(guidance(mode, before, self.absent, faulty, self.node.get_namespace(), is_played))

    def raise_priority(self, is_first: bool) -> None:
        """In realtime: ask the system to prefer this process, and report what was granted.

        Parameters
        ----------
        is_first : whether it works in each inner period, and is to be ahead of the other nodes.
        """
        timing = self.shared.timing
        if timing.mode == "realtime":
            granted = set_priority(max(timing.fifo_priority - (not is_first), 0), timing.niceness)
            self.facts[PRIORITY] = granted
            if is_first:
                self.node.get_logger().info(f"{PRIORITY}: {granted}")

    def wait_for_delivery(self) -> None:
        """Report how much was published, then wait until the recorder and all others have the last messages."""
        self._report(**{ENDED: "yes"})
        self._outlets.wait_for_delivery()

    def watch_peers(self, take: Callable[[NodeStatus], None], followed: str = "") -> None:
        """Listen to the status of the other nodes, for `absent` and `faults`, and hand each to `take`.

        A node that has to brake does so where another one was started with other shared parameters.

        Parameters
        ----------
        take : called with each status of a node of the bring-up.
        followed : node whose status it is called with, too, where the bring-up lacks that node.
        """
        self._absent = set(self.interface.names) - {self._name}

        kind = message_type(self.interface.topics[STATUS])

        def receive(data: bytes) -> None:
            status = read_status(deserialized(data, kind, STATUS))
            is_peer = status.node in self.interface.declarations and status.node != self._name
            if is_peer:
                self.faults[status.node] = status.fault
                self._busy.pop(status.node, None)
                if busy := status.facts.get(BUSY):
                    self._busy[status.node] = busy, frozenset(status.facts.get(HELD_UP, "").split())
            # a node of the stack that this bring-up does not list answers all the same
            if self.takes_problem is not None and (is_peer or status.node in NODES.keys() - {self._name}):
                reason = disagreement(status.node, self._digests, status.facts.get(DIGESTS, ""))
                self.set_problem(PARAMETERS + status.node, problem_of("parameters", reason))
            if status.connected:
                self._absent.discard(status.node)
                self._inform()
            if is_peer or status.node == followed:
                take(status)

        self.listen(STATUS, receive, raw=True)

    @property
    def absent(self) -> list[str]:
        """Nodes of the bring-up that have not reported that they are connected."""
        return sorted(self._absent)

    @property
    def ready(self) -> bool:
        """Whether every expected peer is connected."""
        return self._readiness.is_canceled()

    def _look_for_peers(self) -> None:
        interface = self.interface
        for name, subscription in self._subscriptions.items():
            if subscription.get_publisher_count() < len(interface.publishers(name)):
                return
        for name, count in self._outlets.subscriptions().items():
            if count < len(interface.subscribers(name)):
                return
        if self.waits():
            return
        self._readiness.cancel()
        self.set_status(self._wanted or READY)

    def report_due(self, stamp: int) -> bool:
        """Whether the next report will be published."""
        return stamp >= self._next_report

    def report(self, stamp: int) -> None:
        """Publish the diagnostics once in a second of the arm's time: a warning while messages are refused."""
        if not self.report_due(stamp):
            return
        self._next_report = stamp - stamp % SECOND + SECOND
        self._last_report = stamp
        self._report()
        if self.refusals.look_again():
            self.publish_status(self._plain)

    def _report(self, **more: str) -> None:
        """Publish the diagnostics, with how many messages were published on each topic, this one included."""
        level = max(self._status.level, Level.WARN if self.refusals.have_grown() else Level.OK)
        self._publish_report(level, self._status.message, more)

    def _report_standstill(self) -> None:
        """Once in a second of the wall clock: report where the node has had nothing to do for long."""
        steps = self.counts["steps"]
        self._seconds_without_step = 0 if steps != self._last_steps else self._seconds_without_step + 1
        self._last_steps = steps
        if self._seconds_without_step >= NODE_LIMITS.stale_after:
            reason = f"no step for {self._seconds_without_step} s" if self.ready else self._status.message
            self._publish_report(Level.STALE, reason, {})

    def _publish_report(self, level: Level, text: str, more: Mapping[str, str]) -> None:
        refused = {f"refused on {topic}": str(count) for topic, count in sorted(self.refusals.counts.items())}
        counts = {key: str(count) for key, count in sorted(self.counts.items())}
        totals = {**self._outlets.published, DIAGNOSTICS: self._outlets.published[DIAGNOSTICS] + 1}
        published = {f"{PUBLISHED}{self._outlets.full[topic]}": str(count) for topic, count in totals.items()}
        own = {NODE: self.node.get_fully_qualified_name(), **published}
        facts = {**counts, **refused, **own, **self.facts, **more}
        name = diagnosed_name(self.node.get_namespace(), self._name)
        status = NodeStatus(level, text, name, fault=self._status.fault, facts=facts)
        message = diagnostic_status(status._replace(connected=self.ready), self.shared.arm.name)
        self._outlets.send(DIAGNOSTICS, DiagnosticArray(header=header(self._last_report), status=[message]))
