"""Messages between nodes of one process: order and turns."""

from collections import deque
from collections.abc import Callable

import pytest

from wam_description.message_bus import MessageBus, QueuedBus


def echoes(bus: MessageBus, count: int) -> list[str]:
    """What two listeners of a topic note of so many pings, each of which one of them answers with the next."""
    seen, publish = list[str](), bus.publisher("/ping")

    def answer(stamp: int, value: str) -> None:
        seen.append(f"first {value}{stamp}")
        if stamp < count:
            publish(stamp + 1, value)

    bus.listen("/ping", answer)
    bus.listen("/ping", lambda stamp, value: seen.append(f"second {value}{stamp}"))
    publish(1, "p")
    return seen


def test_at_once_an_answer_comes_before_the_next_listener_has_the_question() -> None:
    assert echoes(MessageBus(), 2) == ["first p1", "first p2", "second p2", "second p1"]


def test_in_turns_an_answer_waits_until_all_have_the_question_and_others_have_their_turn() -> None:
    tasks: deque[Callable[[], None]] = deque()
    most = 3
    seen = echoes(QueuedBus(tasks.append, most), 2 * most)
    assert not seen
    tasks.append(lambda: seen.append("other"))
    while tasks:
        tasks.popleft()()
    pings = [f"{who} p{stamp}" for stamp in range(1, 2 * most + 1) for who in ("first", "second")]
    assert seen == [*pings[: 2 * most], "other", *pings[2 * most :]]


def test_of_more_messages_than_its_depth_a_topic_keeps_the_newest() -> None:
    tasks, seen = deque[Callable[[], None]](), list[int]()
    bus = QueuedBus(tasks.append, 9)
    bus.listen("/a", lambda stamp, value: seen.append(stamp))
    list(map(bus.publisher("/a", 2), range(5), "abcde"))
    tasks.popleft()()
    assert (seen, len(tasks)) == ([3, 4], 0)


def test_answers_to_a_message_of_the_middleware_come_before_what_the_executor_was_given_since() -> None:
    tasks, seen = deque[Callable[[], None]](), list[int]()
    bus = QueuedBus(tasks.append, 2)
    publish = bus.publisher("/a", 5)
    bus.listen("/a", lambda stamp, value: seen.append(stamp))
    take = bus.answered(lambda data: [publish(number, 1 // number) for number in data])
    take(b"\1\2")
    assert (seen, len(tasks)) == ([1, 2], 0), "no turn is asked for"
    take(b"\3\4\5")
    assert (seen, len(tasks)) == ([1, 2, 3, 4], 1), "a long answer lets others have their turns"
    with pytest.raises(ZeroDivisionError):
        take(b"\0")
    take(b"")
    assert len(seen) == 4, "without an answer there is no turn"
    take(b"\6")
    assert (seen, len(tasks)) == ([1, 2, 3, 4, 5, 6], 1)
    tasks.popleft()()
    assert not tasks, "the turn that was asked for finds nothing"
