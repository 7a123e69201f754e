"""Broken messages on every topic that a node takes, from its own publisher and from a second one; false ones; floods.

A second publisher of another type cannot be tried here: the middleware allows one type for a name in a process.
"""

from functools import partial
from itertools import product
from random import Random
from typing import Final, NamedTuple

from rclpy.serialization import serialize_message

from wam_description.wiring import Call
from wam_studies.faults.message_faults import (
    EFFECTIVE,
    MESSAGE_FAULTS,
    SECOND,
    MessageFault,
    broken,
    enlarge,
    made_effective,
    set_stamp,
)
from wam_studies.faults.trials import FAULTS, KEPT, FaultCase, FaultTrial
from wam_studies.faults.watched_stack import WatchedStack, watched_trial, worked

PUSH: Final = "sim/disturbance"
GUARDED: Final = tuple(topic for topic in EFFECTIVE if topic != PUSH)  # a second publisher is a fault


class MessagePlan(NamedTuple):
    """What one trial does."""

    topic: str
    is_foreign: bool
    fault: MessageFault

    @property
    def name(self) -> str:
        """The plan in words: topic, publisher and fault."""
        return f"{self.topic}, {'second' if self.is_foreign else 'own'} publisher, {self.fault.name}"


def plan(topics: list[str], seed: int, index: int) -> MessagePlan:
    """Topic, publisher and fault of a trial: all combinations, in an order drawn from the seed, then again."""
    every = [MessagePlan(*one) for one in product(topics, (False, True), MESSAGE_FAULTS)]
    Random(f"messages {seed}").shuffle(every)
    return every[index % len(every)]


def _topics(case: FaultCase) -> list[str]:
    """Topics that a node takes."""
    stack: WatchedStack = KEPT.ready(WatchedStack, case.configuration)
    return [name for name in stack.topics if stack.interface.subscribers(name)]


def play(case: FaultCase) -> FaultTrial:
    """A trial of `FAULTS.messages` messages."""
    todo = plan(_topics(case), case.seed, case.number)
    return watched_trial(case, todo.name, partial(_send, todo, case.chance))


def _send(todo: MessagePlan, chance: Random, stack: WatchedStack) -> int:
    """Publish the broken messages; returns how many there were."""
    publish = stack.foreign_publisher if todo.is_foreign else partial(stack.own_publisher, chance=chance)
    publisher = publish(todo.topic)
    sent = 0
    stack.allowed_motion = FAULTS.motion if todo.is_foreign else FAULTS.held_motion
    if publisher is None:
        return 0
    if todo.topic == PUSH and not todo.is_foreign:  # bytes may be those of a push, and pushing is what it is for
        stack.allowed_force = stack.shared.disturbance_force_limit
    for _ in range(FAULTS.messages):
        message = stack.newest(todo.topic)
        if todo.fault.moves:
            made_effective(todo.topic, message, stack.cover)
        data = broken(message, todo.fault, chance, stack.driver.stamp, serialize_message)
        if data is not None:
            stack.inject(publisher, data)
            sent += 1
        stack.run(FAULTS.between)
    if todo.is_foreign:
        stack.node.destroy_publisher(publisher)
    stack.run(FAULTS.after)
    return sent


def play_second(case: FaultCase) -> FaultTrial:
    """A trial with a second publisher of false commands or feedback with right stamps; topics in turn."""
    topics = _topics(case)
    topic = topics[case.number % len(topics)]
    return watched_trial(case, f"{topic}, second publisher", partial(_stream, topic))


def _stream(topic: str, stack: WatchedStack) -> int:
    """Answer every period with a false message that has the right stamp."""
    publisher = stack.foreign_publisher(topic)
    try:
        end = stack.driver.stamp + int(FAULTS.streamed * SECOND)
        while stack.driver.stamp < end and not stack.driver.safety.fault:
            message = stack.newest(topic)
            made_effective(topic, message, stack.cover)
            set_stamp(message, stack.driver.stamp)
            stack.inject(publisher, serialize_message(message))
            stack.run(0.001)
        stack.run(FAULTS.after_publishers)
        if topic in GUARDED and not any(event.values.get("topic") == topic for event in stack.driver.safety.events):
            stack.escapes.append(f"no fault names {topic}: '{stack.driver.safety.fault}'")
    finally:
        stack.node.destroy_publisher(publisher)
    return 1


def play_flood(case: FaultCase) -> FaultTrial:
    """A trial with many messages in each period, half of the trials with long arrays; topics in turn."""
    topics = _topics(case)
    topic, is_large = topics[case.number % len(topics)], case.number // len(topics) % 2 == 1
    return watched_trial(case, f"{topic}, {'large ' * is_large}flood", partial(_flood, topic, is_large))


def _flood(topic: str, is_large: bool, stack: WatchedStack) -> int:
    """Ask for an emergency stop in a flood; the brakes must be on and the answer there soon, in the arm's time."""
    own = stack.own_publisher(topic, Random(topic))
    publisher = own or stack.foreign_publisher(topic)
    client, request = stack.service(Call("driver", "estop"))
    stack.allowed_motion = FAULTS.held_motion
    sent, before, begin, future = 0, 0, stack.driver.stamp, None
    end = worked() + FAULTS.patience
    while (future is None or not future.done()) and worked() < end:
        if (now := stack.driver.stamp) != before:
            before, message = now, stack.newest(topic)
            if is_large:
                enlarge(message)
            set_stamp(message, now)
            data = serialize_message(message)
            for _ in range(FAULTS.flood):
                stack.inject(publisher, data)
            sent += FAULTS.flood
        if future is None and now - begin >= FAULTS.flooded * SECOND:
            future, begin = client.call_async(request), now
        stack.spin_once()
    stack.delay = (stack.driver.stamp - begin) / SECOND
    if future is None or not future.done() or stack.delay > FAULTS.stopped:
        stack.escapes.append(f"no answer to an emergency stop within {1e3 * stack.delay:.0f} ms")
    if not own:
        stack.node.destroy_publisher(publisher)
    stack.run(FAULTS.after)
    return sent
