"""A ROS domain for one test that makes its nodes itself."""

import os
import time
from collections.abc import Callable
from typing import Any

from conftest import LONG
from rclpy.node import Node

from wam_ros.ros_topics import NAMESPACE
from wam_ros.run import Connection


class Network(Connection):
    """A ROS domain for one test, with an executor for nodes that the test makes itself.

    Parameters
    ----------
    domain_id : ROS domain.

    Attributes
    ----------
    environment : for child processes that shall be in the same domain.
    """

    def __init__(self, domain_id: int) -> None:
        super().__init__(domain_id=domain_id)
        self.domain_id = domain_id
        self.environment = {**os.environ, "ROS_DOMAIN_ID": str(domain_id)}

    def node(self, name: str, namespace: str = f"/{NAMESPACE}") -> Any:
        """A plain node, spun and destroyed with the test."""
        return self.add(Node(name, namespace=namespace, context=self.context))

    def wait(self, until: Callable[[], Any], timeout: float = LONG, what: str = "") -> None:
        """Spin until something is true; the test fails if that takes longer than `timeout`, s."""
        end = time.monotonic() + timeout
        while not until():
            assert time.monotonic() < end, f"not within {timeout} s: {what or until}"
            self.executor.spin_once(timeout_sec=0.01)
