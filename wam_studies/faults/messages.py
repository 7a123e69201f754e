"""Broken messages on every topic that a node takes, from the topic's own publisher and from a second one."""

from functools import partial
from random import Random
from typing import Final, NamedTuple

from rclpy.serialization import serialize_message

from wam_studies.faults.message_faults import MESSAGE_FAULTS, MessageFault, broken, made_effective
from wam_studies.faults.trials import FAULTS, KEPT, FaultCase, FaultTrial
from wam_studies.faults.watched_stack import WatchedStack, watched_trial

PUSH: Final = "sim/disturbance"


class MessagePlan(NamedTuple):
    """What one trial does."""

    topic: str
    is_foreign: bool
    fault: MessageFault

    @property
    def name(self) -> str:
        """In words."""
        return f"{self.topic}, {'second' if self.is_foreign else 'own'} publisher, {self.fault.name}"


def plan(topics: list[str], seed: int, index: int) -> MessagePlan:
    """Topic, publisher and fault of a trial: all combinations, in an order drawn from the seed, then again."""
    every = [
        MessagePlan(topic, foreign, fault) for topic in topics for foreign in (False, True) for fault in MESSAGE_FAULTS
    ]
    Random(f"messages {seed}").shuffle(every)
    return every[index % len(every)]


def play(case: FaultCase) -> FaultTrial:
    """A trial of `FAULTS.messages` messages."""
    topics = KEPT.ready(WatchedStack, case.configuration).taken_topics()
    todo = plan(topics, case.seed, case.number)
    return watched_trial(case, todo.name, partial(_send, todo, Random(f"messages {case.seed} {case.number}")))


def _send(todo: MessagePlan, chance: Random, stack: WatchedStack) -> int:
    """Publish the broken messages; returns how many there were."""
    publish = stack.foreign_publisher if todo.is_foreign else partial(stack.own_publisher, chance=chance)
    publisher = publish(todo.topic)
    sent = 0
    stack.allowed_motion = FAULTS.motion if todo.is_foreign else FAULTS.held_motion
    if publisher is None:
        return 1
    if todo.topic == PUSH and not todo.is_foreign:  # bytes may be those of a push, and pushing is what it is for
        stack.allowed_force = stack.shared.disturbance_force_limit
    for _ in range(FAULTS.messages):
        message = stack.newest(todo.topic)
        if todo.fault.moves:
            made_effective(todo.topic, message, stack.cover)
        data = broken(message, todo.fault, chance, stack.stamp(), serialize_message)
        if data is not None:
            stack.inject(publisher, data)
            sent += 1
        stack.run(FAULTS.between)
    if todo.is_foreign:
        stack.node.destroy_publisher(publisher)
    stack.run(FAULTS.after)
    return max(sent, 1)
