"""One way to run nodes: each in a process of its own or several in one, ended by SIGINT, SIGTERM or themselves."""

import contextlib
import ctypes
import gc
import os
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # numpy would start a thread a core for 4x4 matrices

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from wam_description.message_bus import QueuedBus
from wam_description.parameters import ParameterError
from wam_ros.limits import NODE_LIMITS, PROCESS_LIMITS
from wam_ros.network import limit_to_this_machine
from wam_ros.process_signals import LISTENER_GONE, Stop, leaving
from wam_ros.processors import keep_to_processors
from wam_ros.ros_topics import NAMESPACE, SECOND
from wam_ros.tolerance import LeavingNode

FIRST = "driver"  # to be stopped: brakes on, before the commands cease and it had to call that a fault
LAST = "recorder"  # to be stopped: it closes the bag
PARENT = "WAM_STACK_PARENT"  # environment variable: process that bring-up started this one from
PR_SET_PDEATHSIG = 1
MakeNode = Callable[..., Node]


def die_with_parent() -> None:
    """Let the system end this process when the one that started it is gone, even by SIGKILL."""
    parent = os.environ.get(PARENT)
    if parent is None:
        return
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(parent):
        raise SystemExit("error: the program that started this node is gone")


class StackContext(Context):
    """A context of ROS with what its nodes share.

    Attributes
    ----------
    bus : that hands on what only nodes of this process publish; None where there is none.
    names : of these nodes.
    begun : nodes of ours that have not been destroyed.
    end : see `end_of_delivery`.
    failure : why one of its nodes has failed, '' where none has: with it the end is bounded, see `leaving`.
    """

    bus: QueuedBus | None = None
    names: frozenset[str] = frozenset()
    begun: set[Any]
    end: float
    failure: Callable[[], str]

    def carries(self, publishers: Collection[str]) -> bool:
        """Whether all nodes that publish a topic are of this process; False where none does."""
        return bool(publishers) and self.names.issuperset(publishers)


def end_of_delivery(context: Context) -> float:
    """When the nodes of a context that end now stop waiting for others to take their messages, s, monotonic.

    There is one deadline for all of them: a listener that is frozen would hold up each node in turn.
    """
    return getattr(context, "end", time.monotonic() + PROCESS_LIMITS.delivery)


def prepare_logging_directory() -> None:
    """Let rclpy log somewhere even where HOME is missing or cannot be written."""
    if not os.environ.keys() & {"ROS_LOG_DIR", "ROS_HOME"}:
        directory = Path(os.environ.get("HOME") or os.devnull, ".ros", "log")
        with contextlib.suppress(OSError):
            directory.mkdir(parents=True, exist_ok=True)
        if not os.access(directory, os.W_OK):
            os.environ["ROS_LOG_DIR"] = str(Path(tempfile.gettempdir()) / f"wam_stack_log_{os.getuid()}")


class Closing:
    """What is closed when its context is left."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End it."""


class Connection(Closing):
    """A context and an executor for the nodes of this process.

    Parameters
    ----------
    arguments : command line for ROS.
    domain_id : ROS domain, the one of the environment where None.

    Attributes
    ----------
    context, executor : to make nodes with, and to spin.
    nodes : those of `make` by name.
    listener_gone : whether one of those that take messages of these nodes was killed.
    """

    def __init__(self, arguments: Sequence[str] = (), domain_id: int | None = None) -> None:
        limit_to_this_machine(os.environ)
        prepare_logging_directory()
        self.context = StackContext()
        self.context.begun = set()
        rclpy.init(
            args=list(arguments),
            context=self.context,
            domain_id=domain_id,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        try:  # an events executor where this rclpy has it
            from rclpy.experimental import EventsExecutor as Executor
        except ImportError:
            from rclpy.executors import SingleThreadedExecutor as Executor
        self.executor: Any = Executor(context=self.context)
        self.listener_gone = False
        self.nodes: dict[str, Any] = {}
        self._nodes: dict[Node, str] = {}  # and their names, which a destroyed node does not have
        self._looked = time.monotonic()
        self._pulse_end = threading.Event()
        self._pulse = threading.Thread(target=self._keep_awake, name="pulse", daemon=True)
        self._pulse.start()

    def _keep_awake(self) -> None:
        """Wake the executor now and then: the wheels of ROS wait by the wall clock, so for hours if it is set back."""
        task = None
        while not self._pulse_end.wait(PROCESS_LIMITS.pulse):
            if task is None or task.done():
                task = self.executor.create_task(self._call_overdue)

    def _call_overdue(self) -> None:
        """Call the timers that were due before the last look, and begin their waits again: each has one of its own.

        One whose wait has ended, but late, has been called since: the executor does in turn what it has to do.
        """
        before, self._looked = self._looked, time.monotonic()
        for node in self._nodes:
            for timer in node.timers:
                if not timer.is_canceled() and timer.time_until_next_call() < (before - self._looked) * SECOND:
                    timer.reset()
                    self.executor.create_task(timer.callback)

    def make(self, makers: Mapping[str, MakeNode], namespace: str = NAMESPACE, is_split: bool = False) -> None:
        """Make nodes that hand each other their messages; where one cannot be made, all is closed.

        Parameters
        ----------
        makers : what makes each node, by its name; called with ``context`` and ``namespace``.
        namespace : of the nodes.
        is_split : whether their messages go through the middleware all the same, as between processes.
        """
        self.context.bus = None if is_split else QueuedBus(self.executor.create_task, NODE_LIMITS.turn)
        self.context.names = frozenset(makers)
        try:
            for name, make in makers.items():
                self.nodes[name] = self.add(make(context=self.context, namespace=namespace))
        except BaseException:
            for node in self.context.begun.difference(self._nodes):  # half made: it lacks what its own end would use
                LeavingNode.destroy_node(node)
            self.close()
            raise

    def add(self, node: Any) -> Any:
        """Take a node into the executor; it is destroyed with the connection."""
        self._nodes[node] = node.get_name()
        self.executor.add_node(node)
        return node

    def remove(self, node: Any) -> None:
        """Destroy a node now."""
        del self._nodes[node]
        self.executor.remove_node(node)
        node.destroy_node()

    def spin(self, until: Callable[[], bool], end: Callable[[], object] = lambda: None) -> None:
        """Spin until `until` is true, which is evaluated after each callback; then `end` and handle what has arrived.

        The events executor's own spin() hangs in the wheels built against old C libraries, and its
        spin_until_future_complete() sees its time-out only when no message waits: that is what the end
        wants, and what never comes in a lockstep that goes on, hence the limit.
        """
        executor = self.executor
        while not until():
            executor.spin_once(timeout_sec=PROCESS_LIMITS.pulse)
        end()
        future: rclpy.Future[None] = rclpy.Future()
        limit = threading.Timer(PROCESS_LIMITS.arrived, executor.create_task, [future.set_result, None])
        limit.start()
        executor.spin_until_future_complete(future, timeout_sec=0.1)
        limit.cancel()
        limit.join()

    def close(self) -> None:
        """Destroy the nodes, driver first, recorder last, and leave the network."""
        limits = PROCESS_LIMITS
        self._pulse_end.set()
        self._pulse.join()
        self.context.end = time.monotonic() + (limits.short_delivery if self.listener_gone else limits.delivery)
        for node in sorted(self._nodes, key=lambda node: (self._nodes[node] == LAST) - (self._nodes[node] == FIRST)):
            self.remove(node)
        with leaving(self.context):  # an events executor has kept the nodes, and with them the participant
            self.executor.shutdown()
        rclpy.try_shutdown(context=self.context)


def run(
    makers: Mapping[str, MakeNode],
    arguments: Sequence[str],
    stop: Stop | None = None,
    before_end: Callable[[], object] = lambda: None,
) -> str:
    """Run nodes as this process, until SIGINT, SIGTERM or until the attribute `done` of one is true.

    Parameters
    ----------
    makers : what makes each node, by its name; called with ``context`` and ``namespace``.
    arguments : command line.
    stop : that the signals set.
    before_end : called before the nodes end.

    Returns
    -------
    The `failure` of a node, '' where none has one.

    Raises
    ------
    SystemExit
        with code 1 where the ROS arguments or the parameters are refused.
    """
    die_with_parent()
    stop = stop or Stop()
    try:
        connection = Connection(arguments)
        connection.make(makers)
    except ParameterError as error:
        raise SystemExit(f"error: {error}") from None
    except RuntimeError as error:  # also security that is enforced where the middleware has none
        reason = " ".join(str(error).split())
        raise SystemExit(
            f"error: ROS does not start with {' '.join(arguments[1:]) or 'no arguments'}: {reason}"
        ) from None
    nodes = connection.nodes

    def end() -> None:
        # where the driver puts the brakes on, no other node has to report that it ends
        for node in [nodes[FIRST]] if FIRST in nodes else nodes.values():
            if stop.is_set and hasattr(node, "end"):
                node.end()

    def is_over() -> bool:
        return stop.is_set or any(getattr(node, "done", False) for node in nodes.values())

    def failure() -> str:
        return next(filter(None, (str(getattr(node, "failure", "")) for node in nodes.values())), "")

    with connection:
        signal.signal(LISTENER_GONE, lambda *_: setattr(connection, "listener_gone", True))
        keep_to_processors(os.environ)  # all threads are there
        for node in nodes.values():
            getattr(node, "raise_priority", lambda: None)()
        gc.freeze()  # to look through all modules takes 0.1 s, in which the node would be late
        connection.spin(is_over, end)
        before_end()
        connection.context.failure = failure
    return failure()
