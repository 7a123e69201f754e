"""Fixtures of the tests that touch ROS: a domain, a log directory and a context of their own."""

import fcntl
import itertools
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from wam_ros.network import SWITCH, is_inhabited, limit_to_this_machine

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]
# programs that a test starts run this tree too, whatever is installed
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
# a test without the fixture domain_id cannot reach anybody: rclpy.init refuses this
os.environ["ROS_DOMAIN_ID"] = "tests take the fixture domain_id"
for elsewhere in (SWITCH, "ROS_LOCALHOST_ONLY"):
    os.environ.pop(elsewhere, None)
limit_to_this_machine(os.environ)

# The tests' own: nobody uses them by default, and their ports lie above those that Linux gives to any program.
DOMAINS = range(215, 233)
LONG = 300.0  # s, for what must happen at all, on a machine as busy as may be
_COUNTER = itertools.count()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the tests that start ROS nodes; one worker runs them all, so that they do not slow each other."""
    for item in items:
        if {"domain_id", "domain_of_module"} & set(getattr(item, "fixturenames", ())):
            item.add_marker("ros")
        if item.get_closest_marker("ros") and config.pluginmanager.hasplugin("xdist"):
            item.add_marker(pytest.mark.xdist_group("ros"))


@pytest.fixture
def checked_fields(monkeypatch: pytest.MonkeyPatch) -> None:
    """What ROS_PYTHON_CHECK_FIELDS=1 does: a field of a wrong type fails."""
    for name, module in list(sys.modules.items()):
        if ".msg._" in name and hasattr(module, "ros_python_check_fields"):
            monkeypatch.setattr(module, "ros_python_check_fields", "1")


def soon() -> float:
    """Seconds that count as prompt: 2, or on a busy machine as long as a few starts of Python with numpy."""
    begin = time.monotonic()
    subprocess.run([sys.executable, "-c", "import numpy"], check=True)
    return max(2.0, 20.0 * (time.monotonic() - begin))


class RosWorld:
    """A ROS network for one test, its own in a machine full of others.

    Attributes
    ----------
    domain_id : domain that no other test uses at the same time.
    context : initialised rclpy context.
    executor : runs the nodes given to `add`.
    environment : for child processes that shall be in the same network.
    """

    def __init__(self, domain_id: int) -> None:
        import rclpy
        from rclpy.context import Context

        from wam_ros.run import make_executor

        self.domain_id = domain_id
        self.environment = {**os.environ, "ROS_DOMAIN_ID": str(domain_id)}
        self.context = Context()
        rclpy.init(args=[], context=self.context, domain_id=domain_id)
        self.executor = make_executor(self.context)
        self._nodes: list[Any] = []

    def add(self, node: Any) -> Any:
        """Spin this node too; it is destroyed at the end of the test."""
        self._nodes.append(node)
        self.executor.add_node(node)
        return node

    def remove(self, node: Any) -> None:
        """Destroy a node now."""
        self._nodes.remove(node)
        self.executor.remove_node(node)
        node.destroy_node()

    def node(self, name: str, namespace: str = "/wam") -> Any:
        """A plain node, spun and destroyed with the test."""
        from rclpy.node import Node

        return self.add(Node(name, namespace=namespace, context=self.context))

    def wait(self, until: Callable[[], Any], timeout: float = LONG, what: str = "") -> None:
        """Spin until something is true; the test fails where that takes longer than `timeout` seconds."""
        end = time.monotonic() + timeout
        while not until():
            assert time.monotonic() < end, f"not within {timeout} s: {what or until}"
            self.executor.spin_once(timeout_sec=0.01)

    def close(self) -> None:
        import rclpy

        for node in list(self._nodes):
            self.remove(node)
        self.executor.shutdown()
        rclpy.try_shutdown(context=self.context)


@contextmanager
def locked_domain() -> Iterator[int]:
    """A ROS domain that nobody is in, locked against other test processes."""
    end = time.monotonic() + 10.0 * LONG
    for attempt in itertools.count(os.getpid() + next(_COUNTER)):
        number = DOMAINS[attempt % len(DOMAINS)]
        lock = os.open(
            Path(tempfile.gettempdir()) / f"wam_stack_test_domain_{number}",
            os.O_CREAT | os.O_RDWR | os.O_CLOEXEC,
            0o666,
        )
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if not is_inhabited(number):
                break
        except OSError:
            pass  # another test has it
        os.close(lock)
        assert time.monotonic() < end, f"ROS domains {DOMAINS[0]} to {DOMAINS[-1]} are all in use; end what is there"
        time.sleep(0.05)
    try:
        yield number
    finally:
        os.close(lock)


def isolate(monkeypatch: pytest.MonkeyPatch, number: int, folder: Path) -> None:
    """Environment of this process and its children for a ROS domain of its own."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
    monkeypatch.setenv("ROS_LOG_DIR", str(folder / "ros_log"))
    monkeypatch.setenv("ROS_PYTHON_CHECK_FIELDS", "1")


@pytest.fixture
def domain_id(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A free ROS domain in the environment of this process."""
    with locked_domain() as number:
        isolate(monkeypatch, number, tmp_path)
        yield number


@pytest.fixture(scope="module")
def domain_of_module(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """The same, for fixtures of a module."""
    with pytest.MonkeyPatch.context() as patch, locked_domain() as number:
        isolate(patch, number, tmp_path_factory.mktemp("ros"))
        yield number


@pytest.fixture
def ros(domain_id: int) -> Iterator[RosWorld]:
    """A ROS network of this test's own: nodes, executor, context."""
    world = RosWorld(domain_id)
    yield world
    world.close()
