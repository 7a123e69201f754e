"""Fixtures of the tests that touch ROS: a domain, a log directory and a context of their own."""

import fcntl
import itertools
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
_DOMAINS = 101  # above, the ports of a domain lie among those that Linux gives to any program
_COUNTER = itertools.count()


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

    def wait(self, until: Callable[[], Any], timeout: float = 10.0, what: str = "") -> None:
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
    """A free ROS domain, locked against other test processes."""
    start = os.getpid() + next(_COUNTER)
    for offset in range(_DOMAINS):
        number = 1 + (start + offset) % _DOMAINS
        lock = os.open(
            Path(tempfile.gettempdir()) / f"wam_stack_test_domain_{number}",
            os.O_CREAT | os.O_RDWR | os.O_CLOEXEC,
            0o666,
        )
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
            continue
        break
    else:
        pytest.fail(f"all {_DOMAINS} ROS domains are in use by other tests; end them")
    try:
        yield number
    finally:
        os.close(lock)


def isolate(monkeypatch: pytest.MonkeyPatch, number: int, folder: Path) -> None:
    """Environment of this process and its children for a ROS domain of its own."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_LOG_DIR", str(folder / "ros_log"))
    monkeypatch.setenv("ROS_PYTHON_CHECK_FIELDS", "1")


@pytest.fixture
def domain_id(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A free ROS domain in the environment of this process."""
    with locked_domain() as number:
        isolate(monkeypatch, number, tmp_path)
        yield number


@pytest.fixture
def ros(domain_id: int) -> Iterator[RosWorld]:
    """A ROS network of this test's own: nodes, executor, context."""
    world = RosWorld(domain_id)
    yield world
    world.close()
