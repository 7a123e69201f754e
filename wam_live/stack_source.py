"""A running stack as the source of the page.

It must not disturb the run: it listens with the least demanding quality of service, and takes what has come only when
a picture is drawn.
"""

import time
from contextlib import suppress
from typing import Any, Final

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from wam_control.contact.contact_table import contact_of, likely_of
from wam_description.arm import Shared
from wam_description.signals import BASE, NO_CONTACT, Contact, State, Table
from wam_description.topics import BY_NAME
from wam_live.snapshot import NAN, Snapshot, objects_of, size
from wam_live.thresholds import LIVE
from wam_ros.messages import Refused, message_type
from wam_ros.wire import decoder, stamp_in

VIEWED: Final = sorted(topic.name for topic in BY_NAME.values() if topic.is_viewed)
TOPICS: Final = (*VIEWED, "force_command")  # of which everybody may be the publisher


class RunningStack:
    """The newest of each topic of a running stack.

    Parameters
    ----------
    context : of ROS.
    namespace : of the stack.
    shared : shared parameters of the driver.
    """

    def __init__(self, context: Any, namespace: str, shared: Shared) -> None:
        # its node is in no executor: what has come is taken when a picture is drawn
        self.node = Node("live_view", context=context, namespace=namespace)
        self._covers = shared.arm.covers.names
        self._topics = {name: self._subscription(name) for name in TOPICS}
        self._decoders = {name: decoder(BY_NAME[name], shared, "position?") for name in TOPICS}
        self._newest: dict[str, tuple[int, Any]] = {}
        self._pace: tuple[float, int] = (time.monotonic(), 0)
        self._factor = NAN
        self._heard = self._pace

    def snapshot(self) -> Snapshot:
        """What the stack shows now, without the statuses of its nodes."""
        for name, subscription in self._topics.items():
            if (data := _taken(subscription)) is not None:
                with suppress(Refused):
                    self._newest[name] = stamp_in(data), self._decoders[name](data)
        truth = self._of("sim/joint_states")[1]
        joints: State | None = truth or self._of("joint_states")[1]
        table: Table | None = self._fresh("contact/hypotheses")
        return Snapshot(
            stamp=self.stamp,
            q=tuple(joints.position) if joints else (),
            true=self._true(),
            estimated=contact_of(table, self._covers),
            likely=likely_of(table, self._covers),
            commanded=self._force("force_command"),
            measured=self._force("force_measured"),
            real_time_factor=self._real_time_factor(),
            silent=self._silent(),
            objects=objects_of(self._of("sim/objects")[1]),
        )

    @property
    def stamp(self) -> int:
        """Time of the newest state of the arm, ns."""
        return max(self._of("joint_states")[0], self._of("sim/joint_states")[0])

    def _of(self, topic: str) -> tuple[int, Any]:
        """Stamp, ns, and value of the newest of a topic; 0 and None before it."""
        return self._newest.get(topic, (0, None))

    def _true(self) -> Contact:
        wrench, point = self._fresh("sim/contact/wrench"), self._fresh("sim/contact/point")
        if wrench is None or point is None or wrench.frame == BASE or wrench.frame != point.frame:
            return NO_CONTACT
        return Contact(wrench.frame, point.position[0], wrench.force)

    def _force(self, topic: str) -> float:
        wrench = self._fresh(topic)
        return NAN if wrench is None else size(wrench.force)

    def _fresh(self, topic: str) -> Any:
        """The newest of a topic, None where it is old: its node may be gone."""
        stamp, value = self._of(topic)
        return None if self.stamp - stamp >= LIVE.old else value

    def _silent(self) -> float:
        now = time.monotonic()
        if self.stamp != self._heard[1]:
            self._heard = now, self.stamp
        return now - self._heard[0]

    def _real_time_factor(self) -> float:
        now, (then, stamp) = time.monotonic(), self._pace
        if now - then > 1.0:
            if 0 < stamp <= self.stamp:
                self._factor = (self.stamp - stamp) / 1e9 / (now - then)
            self._pace = now, self.stamp
        return self._factor

    def _subscription(self, topic: str) -> Subscription:
        newest = QoSProfile(reliability=ReliabilityPolicy.BEST_EFFORT, depth=1)
        return self.node.create_subscription(message_type(BY_NAME[topic]), topic, print, newest, raw=True)


def _taken(subscription: Any) -> Any:
    with subscription.handle:
        taken = subscription.handle.take_message(subscription.msg_type, True)
    return None if taken is None else taken[0]
