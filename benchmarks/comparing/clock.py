"""The arm's clock as it is seen from outside, by a reader of /clock."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rosgraph_msgs.msg import Clock

from wam_ros.run import Connection
from wam_ros.wire import stamp_of

Readings = list[tuple[float, int]]  # wall clock in s, the arm's time in ns


@contextmanager
def watched_clock() -> Iterator[tuple[Executor, Readings]]:
    """An executor to spin, and the readings since then: of `time.time`."""
    seen: Readings = []
    connection = Connection()
    watch = Node("stopwatch", context=connection.context)
    connection.add(watch)

    def take(data: bytes) -> None:
        seen.append((time.time(), stamp_of(data)))

    watch.create_subscription(Clock, "/clock", take, qos_profile_sensor_data, raw=True)
    try:
        yield connection.executor, seen
    finally:
        connection.close()
