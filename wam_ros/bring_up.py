"""Starting the nodes together: in processes of their own, one or several in each, or all in this one."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final

from rclpy.logging import get_logger

from wam_description.configuration import Configuration
from wam_description.interface import declared, require_parameters
from wam_description.nodes import EACH
from wam_ros.limits import PROCESS_LIMITS
from wam_ros.network import require_places
from wam_ros.node import node_makers, parameter_file
from wam_ros.process_signals import HELD_UP, LISTENER_GONE, Stop
from wam_ros.processors import placed_groups
from wam_ros.ros_topics import NAMESPACE
from wam_ros.run import FIRST, LAST, PARENT, Closing, Connection, run

LOGGER: Final = get_logger("wam")
# codes of a node that has done its work, or that SIGTERM ended before it began, as a recorder without a bag
NO_FAILURE: Final = (0, -signal.SIGTERM, 128 + signal.SIGTERM)


class CommandProcess(subprocess.Popen[bytes]):
    """A command of `wam` as a process, in a session of its own: Ctrl-C reaches the parent alone.

    Parameters
    ----------
    words : of the command.
    place : environment in which the process finds its processors.
    options : as those of Popen.
    """

    def __init__(self, words: Sequence[str], place: Mapping[str, str] = MappingProxyType({}), **options: Any) -> None:
        environment = {**os.environ, PARENT: str(os.getpid()), **place}
        # -P: the packages of this process, which are compiled, not those of a clone that is the working directory
        command = [sys.executable, "-P", "-m", "wam_cli.program", *words]
        super().__init__(command, start_new_session=True, env=environment, **options)

    def has_ended(self, seconds: float) -> bool:
        """Whether it ends within this time."""
        try:
            self.wait(max(0.0, seconds))
        except subprocess.TimeoutExpired:
            return False
        return True

    def kill(self) -> None:
        """End it the hard way."""
        os.killpg(self.pid, signal.SIGKILL)
        self.wait()

    def close(self, seconds: float = PROCESS_LIMITS.end) -> None:
        """End it, the hard way where it does not end by itself within this time."""
        self.terminate()
        if not self.has_ended(seconds):
            self.kill()


class NodeProcess(CommandProcess):
    """Nodes of a configuration as a process.

    Parameters
    ----------
    configuration : values for the nodes.
    entries : of the parameter `nodes`.
    namespace : of the nodes.
    log_level : least severity of what they print.
    place : as for `CommandProcess`.

    Attributes
    ----------
    nodes : names of its nodes.
    """

    def __init__(
        self,
        configuration: Configuration,
        entries: Sequence[str],
        namespace: str,
        log_level: str = "error",
        place: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self.nodes = [declared(entry).name for entry in entries]
        with parameter_file(configuration) as file:
            words = ["node", *entries, *_arguments(f"/dev/fd/{file.name}", namespace, log_level)]
            super().__init__(words, place, pass_fds=[int(file.name)])


def _arguments(file: str, namespace: str, log_level: str) -> list[str]:
    """The arguments of ROS for nodes with the parameters in a file."""
    where = f"__ns:=/{namespace.strip('/')}"
    return ["--ros-args", "--params-file", file, "-r", where, "--log-level", log_level]


def run_together(
    configuration: Configuration,
    entries: Sequence[str],
    namespace: str,
    log_level: str = "info",
    stop: Stop | None = None,
    before_end: Callable[[], object] = lambda: None,
) -> str:
    """Run nodes with the values of a configuration as this process; see `Processes` and `run`."""
    makers = node_makers(entries)
    with parameter_file(configuration) as file:
        return run(makers, ["wam", *_arguments(str(file), namespace, log_level)], stop, before_end)


def require_start(configuration: Configuration, namespace: str) -> None:
    """Refuse nodes of which one already runs, and values that are not allowed, before any starts."""
    require_places([declared(entry).name for entry in configuration.shared.nodes], namespace)
    require_parameters(configuration)


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
    processes : by the names of their nodes.
    killed : nodes that did not end by themselves.
    bag_failure : after the end, why the bag is not whole; '' where it is, or where nothing was recorded.

    Raises
    ------
    ParameterError
        where there is no such node, one of this name already runs in this namespace, or a value is not allowed.
    """

    bag_failure = ""

    def __init__(
        self,
        configuration: Configuration,
        namespace: str = NAMESPACE,
        log_level: str = "info",
        processes: str = EACH,
    ) -> None:
        require_start(configuration, namespace)
        self.killed: list[str] = []
        groups = placed_groups(configuration.shared, processes)
        started = [NodeProcess(configuration, group, namespace, log_level, place) for group, place in groups]
        self.processes = {", ".join(process.nodes): process for process in started}

    def ended(self) -> dict[str, int]:
        """Exit codes of the processes that have ended, by name."""
        codes = {name: process.poll() for name, process in self.processes.items()}
        return {name: 0 if code == -HELD_UP else code for name, code in codes.items() if code is not None}

    def wait(self, until: Callable[[dict[str, int]], bool]) -> dict[str, int]:
        """Wait until the exit codes seen so far satisfy a condition; returns them."""
        while not until(ended := self.ended()):
            time.sleep(0.05)
        return ended

    @property
    def failures(self) -> list[str]:
        """Processes that have ended and should not have; why, they have printed themselves."""
        return [f"{process_of(name)} {_ending(code)}" for name, code in self.ended().items() if code]

    def close(self) -> None:
        """Stop every node that runs, the hard way where one does not end by itself; the recorder when it has written.

        All processes but that of the recorder have one deadline together.
        """
        before, deadline = self.ended(), time.monotonic() + PROCESS_LIMITS.end
        recorder = next((name for name, process in self.processes.items() if LAST in process.nodes), "")
        others = [name for name in self.processes if name != recorder]
        if any(code < 0 for code in before.values()):
            for process in self.processes.values():
                process.send_signal(LISTENER_GONE)
        self._end([name for name in others if FIRST in self.processes[name].nodes], deadline)
        self._end(others, deadline)
        self._end([recorder] if recorder else [], time.monotonic() + PROCESS_LIMITS.recorder_end)
        code = self.ended().get(recorder, 0)
        if recorder not in before and code not in NO_FAILURE:
            lacking = "the bag may lack messages; 'wam bag repair' closes it"
            self.bag_failure = f"{process_of(recorder)} ended with code {code}; {lacking}"
        elif before.get(recorder) == 0 and others:
            self.bag_failure = "the recorder ended before the other nodes; the bag lacks what they published after it"

    def _end(self, names: Sequence[str], deadline: float) -> None:
        """End processes, after a time, s, the hard way."""
        for name in names:
            self.processes[name].terminate()
        for name in names:
            process = self.processes[name]
            while not process.has_ended(min(deadline - time.monotonic(), PROCESS_LIMITS.end_reports)):
                if time.monotonic() < deadline:
                    LOGGER.warning(f"waiting for the end of {process_of(name)}")
                    continue
                LOGGER.error(f"{process_of(name)} is killed: it did not end in time")
                self.killed.append(name)
                process.kill()


def process_of(nodes: str) -> str:
    """What a message calls a process: its node, or the nodes that share it."""
    return f"the process of the nodes {nodes}" if "," in nodes else f"node {nodes}"


def _ending(code: int) -> str:
    """How a process ended that should not have, in words."""
    if code > 0:
        return f"ended with code {code}; it printed the reason above"
    number = -code
    name = signal.Signals(number).name if number in signal.valid_signals() else f"signal {number}"
    cause = "; the system does that if memory is short" if name == "SIGKILL" else ""
    return f"was ended from outside by {name}{cause}"


class Composition(Connection):
    """Nodes in this process, in one executor; leaving the context destroys them, brakes first, bag last.

    Parameters
    ----------
    configuration : as for `compose`; None makes no node yet.
    namespace, is_split : as for `make`.
    domain_id : ROS domain, the one of the environment where None.
    """

    def __init__(
        self,
        configuration: Configuration | None = None,
        namespace: str = NAMESPACE,
        domain_id: int | None = None,
        is_split: bool = False,
    ) -> None:
        super().__init__(domain_id=domain_id)
        if configuration:
            self.compose(configuration, namespace, is_split)

    def compose(self, configuration: Configuration, namespace: str = NAMESPACE, is_split: bool = False) -> None:
        """Make the nodes of a configuration, those that its `shared.nodes` names, with its values."""
        with parameter_file(configuration) as file:
            own = {"cli_args": ["--ros-args", "--params-file", str(file)], "use_global_arguments": False}
            try:
                makers = node_makers(configuration.shared.nodes, **own)
            except BaseException:
                self.close()
                raise
            self.make(makers, namespace, is_split)

    def play(self, is_stopped: Callable[[float], bool] = lambda seconds: False) -> str:
        """Spin until the node `scenario` is done, or until a function of the arm's time, s, stops it.

        Returns
        -------
        str
            why the scenario failed, '' where it did not.
        """
        scenario, driver = self.nodes["scenario"], self.nodes["driver"]
        self.spin(lambda: is_stopped(driver.driver.stamp / 1e9) or bool(scenario.done))
        return str(scenario.failure)
