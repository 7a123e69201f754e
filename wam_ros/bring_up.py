"""Starting the nodes together: in processes of their own, one or several in each, or all in this one."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple, cast

from rclpy.logging import get_logger
from rclpy.node import Node

from wam_description.configuration import Configuration
from wam_description.interface import declared, require_parameters
from wam_description.nodes import EACH, ONE
from wam_ros.limits import PROCESS_LIMITS
from wam_ros.local_bus import BUSES, LocalBus
from wam_ros.network import require_places
from wam_ros.node import make_node, parameter_file
from wam_ros.process_signals import HELD_UP, LISTENER_GONE
from wam_ros.processors import placed_groups
from wam_ros.run import FIRST, LAST, PARENT, Closing, Connection, prepare_logging_directory
from wam_ros.topics import NAMESPACE

LOGGER: Final = get_logger("wam")
# codes of a recorder that SIGTERM ended before it had a bag
NOT_BEGUN: Final = (-signal.SIGTERM, 128 + signal.SIGTERM)


def start(
    configuration: Configuration,
    processes: str,
    is_stopped: Callable[[], bool],
    namespace: str = NAMESPACE,
    log_level: str = "info",
) -> "Composition | Processes":
    """Start the nodes of a configuration.

    Parameters
    ----------
    configuration : values for all nodes; its `shared.nodes` names which ones are started.
    processes : ONE, GROUPED or EACH, of `wam_description.nodes`; ONE is this one.
    is_stopped : whether the start is to be broken off.
    namespace : namespace of the nodes.
    log_level : least severity of what they print.

    Raises
    ------
    ParameterError
        where there is no such node, one of this name runs already in this namespace, or a value is not allowed.
    """
    names = node_names(configuration)
    require_places(names.values(), namespace)
    require_parameters(configuration)
    if processes == ONE:
        return Composition(configuration, namespace, None, is_stopped, log_level)
    return Processes(configuration, namespace, log_level, processes)


def node_names(configuration: Configuration) -> dict[str, str]:
    """Names of the nodes of a bring-up by their entries in the parameter `nodes`.

    Raises
    ------
    ParameterError
        where there is no such node.
    """
    return {entry: declared(entry).name for entry in configuration.shared.nodes}


class Processes(Closing):
    """Nodes in processes of their own; leaving the context stops them all, brakes first, bag last.

    Parameters
    ----------
    configuration : values for all nodes; its `shared.nodes` names which ones are started.
    namespace : namespace of the nodes.
    log_level : least severity of what they print.
    processes : GROUPED or EACH, of `wam_description.nodes`; a process of several nodes is named for all of them.

    Attributes
    ----------
    killed : nodes that did not end by themselves.
    bag_failure : after the end, why the bag is not whole; '' where it is, or where nothing was recorded.
    """

    bag_failure = ""

    def __init__(
        self,
        configuration: Configuration,
        namespace: str = NAMESPACE,
        log_level: str = "info",
        processes: str = EACH,
    ) -> None:
        names = node_names(configuration)
        self.killed: list[str] = []
        self._stack = ExitStack()
        arguments = self._stack.enter_context(_arguments(configuration, namespace, log_level))
        self._processes = {
            " or ".join(names[entry] for entry in group): _start(group, arguments, place)
            for group, place in placed_groups(configuration.shared, processes)
        }

    def ended(self) -> dict[str, int]:
        """Exit codes of the nodes that have ended, by name."""
        codes = {name: process.poll() for name, process in self._processes.items()}
        return {name: 0 if code == -HELD_UP else code for name, code in codes.items() if code is not None}

    def wait(self, until: Callable[[dict[str, int]], bool]) -> dict[str, int]:
        """Wait until the exit codes seen so far satisfy a condition; returns them."""
        while not until(ended := self.ended()):
            time.sleep(0.05)
        return ended

    @property
    def failures(self) -> list[str]:
        """Nodes that have ended and should not have; why, they have printed themselves."""
        return [f"node {name} {_ending(code)}" for name, code in self.ended().items() if code]

    def close(self) -> None:
        """Stop every node that runs, the hard way where one does not end by itself; the recorder when it has written.

        All nodes but the recorder have one deadline together.  The recorder has as long as it goes on.
        """
        deadline = time.monotonic() + PROCESS_LIMITS.end
        was_first = self.ended().get(LAST) == 0
        first = [name for name in self._processes if FIRST in name.split()]
        others = [name for name in self._processes if name not in (*first, LAST)]
        if any(code < 0 for code in self.ended().values()):
            for process in self._processes.values():
                process.send_signal(LISTENER_GONE)
        for names in (first, others):
            for name in names:
                self._processes[name].terminate()
            for name in names:
                if not _has_ended(self._processes[name], deadline):
                    self._kill(name, "did not end")
        if recorder := self._processes.get(LAST):
            recorder.terminate()
            self._wait_for_recorder(recorder)
        if (code := self.ended().get(LAST)) and code not in NOT_BEGUN:
            self.bag_failure = f"the recorder ended with code {code}; the bag may lack messages"
        elif was_first and others:
            self.bag_failure = "the recorder ended before the other nodes; the bag lacks what they published after it"
        self._stack.close()

    def _wait_for_recorder(self, process: subprocess.Popen[bytes]) -> None:
        begin = now = moved = time.monotonic()
        state, printed = _work_of(process.pid), begin
        while process.poll() is None:
            time.sleep(0.02)
            now = time.monotonic()
            if (work := _work_of(process.pid)) != state:
                state, moved = work, now
            if now - moved > PROCESS_LIMITS.recorder_end:
                self._kill(
                    LAST, f"has done nothing for {PROCESS_LIMITS.recorder_end:.0f} s; 'wam bag repair' closes its bag"
                )
            elif now - printed > PROCESS_LIMITS.recorder_reports:
                printed = now
                LOGGER.warning(f"waiting for the recorder to write the bag, {now - begin:.0f} s")

    def _kill(self, name: str, reason: str) -> None:
        LOGGER.error(f"node {name} is killed: it {reason}")
        self.killed.append(name)
        _kill(self._processes[name])


class NodeProcess:
    """One node of a configuration as a process, which can be ended by SIGTERM and started again.

    Parameters
    ----------
    configuration : values for the node.
    entry : of the parameter `nodes`.
    namespace : of the node.
    log_level : least severity of what it prints.
    """

    def __init__(self, configuration: Configuration, entry: str, namespace: str, log_level: str = "error") -> None:
        self._stack = ExitStack()
        self._arguments = self._stack.enter_context(_arguments(configuration, namespace, log_level))
        self._entry = entry
        self.start()

    def start(self) -> None:
        """Start the node."""
        self._process = _start([self._entry], self._arguments)

    @property
    def code(self) -> int | None:
        """Exit code where it has ended."""
        return self._process.poll()

    def send(self, number: signal.Signals) -> None:
        """Send it a signal; without effect where it has ended."""
        self._process.send_signal(number)

    def stop(self) -> None:
        """End the node, the hard way where it does not end by itself."""
        self._process.terminate()
        if not _has_ended(self._process, time.monotonic() + PROCESS_LIMITS.end):
            _kill(self._process)

    def close(self) -> None:
        """End the node for good."""
        self.stop()
        self._stack.close()


@contextmanager
def _arguments(configuration: Configuration, namespace: str, log_level: str) -> Iterator[list[str]]:
    """Arguments of ROS for the processes of a configuration."""
    prepare_logging_directory()
    with parameter_file(configuration) as file:
        yield ["--params-file", str(file), "-r", f"__ns:=/{namespace.strip('/')}", "--log-level", log_level]


def _start(
    entries: Sequence[str], arguments: Sequence[str], place: Mapping[str, str] = MappingProxyType({})
) -> subprocess.Popen[bytes]:
    # a session of its own: Ctrl-C reaches the parent alone, which stops the nodes in order
    return subprocess.Popen(
        [sys.executable, "-m", "wam_ros.program", *entries, "--ros-args", *arguments],
        start_new_session=True,
        env={**os.environ, PARENT: str(os.getpid()), **place},
    )


def _has_ended(process: subprocess.Popen[bytes], deadline: float) -> bool:
    """Whether a process ends before a time of the monotonic clock."""
    try:
        process.wait(max(0.0, deadline - time.monotonic()))
    except subprocess.TimeoutExpired:
        return False
    return True


def _kill(process: subprocess.Popen[bytes]) -> None:
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _ending(code: int) -> str:
    """How a process ended that should not have, in words."""
    if code > 0:
        return f"ended by itself with code {code}; it printed the reason above"
    number = -code
    name = signal.Signals(number).name if number in signal.valid_signals() else f"signal {number}"
    cause = "; the system does that if memory is short" if name == "SIGKILL" else ""
    return f"was ended from outside by {name}{cause}"


def _work_of(pid: int) -> tuple[str, ...]:
    """What changes while a process works: its time of computing, what it has written, whether it waits for a disk."""
    folder = Path("/proc", str(pid))
    try:
        state, *fields = (folder / "stat").read_text().rpartition(")")[2].split()
        written = (folder / "io").read_text()
    except OSError:
        return ()
    return (*fields[10:12], written, str(time.monotonic()) * (state == "D"))


class PlayedScenario(NamedTuple):
    """How the scenario of a composition went.

    Attributes
    ----------
    is_done : whether it came to its end, as it is written or by a failure.
    failure : why it failed, '' where it did not.
    fault : of the driver, '' for none.
    """

    is_done: bool
    failure: str
    fault: str


class Composition(Connection):
    """Nodes in this process, in one executor; leaving the context destroys them, brakes first, bag last.

    Parameters
    ----------
    configuration : values for all nodes; its `shared.nodes` names which ones are made.
    namespace : namespace of the nodes.
    domain_id : ROS domain, the one of the environment where None.
    is_stopped : no further node is made once it is true.
    log_level : least severity of what they print.

    Attributes
    ----------
    nodes : the nodes by name.
    killed : none, as nodes of this process end by themselves.
    """

    killed: tuple[str, ...] = ()
    bag_failure = ""

    def __init__(
        self,
        configuration: Configuration,
        namespace: str = NAMESPACE,
        domain_id: int | None = None,
        is_stopped: Callable[[], bool] = lambda: False,
        log_level: str = "info",
    ) -> None:
        names = node_names(configuration)
        super().__init__(["wam", "--ros-args", "--log-level", log_level], domain_id)
        BUSES[self.context] = LocalBus(self.executor, names.values())
        self.nodes: dict[str, Node] = {}
        self._may_end: dict[str, Any] = {}
        try:
            with parameter_file(configuration) as parameters:
                for entry, name in names.items():
                    if not is_stopped():
                        self._make(entry, name, namespace, parameters)
        except BaseException:
            self.close()
            raise

    def _make(self, entry: str, name: str, namespace: str, parameters: Path) -> None:
        node = make_node(
            entry,
            context=self.context,
            namespace=namespace,
            cli_args=["--ros-args", "--params-file", str(parameters)],
            use_global_arguments=False,
        )
        self.nodes[name] = node
        self.add(node)
        if hasattr(getattr(node, "node", node), "done"):
            self._may_end[name] = node

    def ended(self) -> dict[str, int]:
        """Exit codes of the nodes that have ended, by name, as if they were processes."""
        return {name: int(bool(node.failure)) for name, node in self._may_end.items() if node.done}

    @property
    def failures(self) -> list[str]:
        """Why nodes have ended that should not have."""
        return [node.failure for node in self._may_end.values() if node.done and node.failure]

    def wait(self, until: Callable[[dict[str, int]], bool]) -> dict[str, int]:
        """Spin until the exit codes seen so far satisfy a condition; returns them."""
        self.spin(lambda: until(self.ended()))
        return self.ended()

    def play(self, is_stopped: Callable[[float], bool] = lambda seconds: False) -> PlayedScenario:
        """Spin until the node `scenario` is done, or until a function of the arm's time, s, stops it."""
        scenario, driver = cast(Any, self.nodes["scenario"]), cast(Any, self.nodes["driver"]).driver
        self.spin(lambda: is_stopped(driver.stamp / 1e9) or bool(scenario.done))
        return PlayedScenario(bool(scenario.done), str(scenario.failure), driver.safety.fault)

    def close(self) -> None:
        """Destroy the nodes, driver first, recorder last."""
        recorder = self.nodes.get(LAST)
        super().close()
        self.bag_failure = str(getattr(recorder, "failure", ""))
        self.nodes.clear()
