"""Messages between nodes of one process without the middleware: order, turns, who is served."""

from collections import deque
from collections.abc import Callable

from wam_ros.limits import NODE_LIMITS
from wam_ros.local_bus import LocalBus


class FalseExecutor:
    """Does one task at a time, first come, first served."""

    def __init__(self) -> None:
        self.tasks: deque[Callable[[], None]] = deque()

    def create_task(self, task: Callable[[], None]) -> None:
        self.tasks.append(task)

    def spin_once(self) -> None:
        self.tasks.popleft()()


def test_messages_come_to_all_listeners_in_the_order_in_which_they_were_sent() -> None:
    executor, heard = FalseExecutor(), list[tuple[str, bytes]]()
    bus = LocalBus(executor, ["a", "b"])
    for name in ("first", "second"):
        bus.subscribe("/state", lambda data, name=name: heard.append((name, data)))
    bus.subscribe("/answer", lambda data: heard.append(("answer", data)))
    bus.subscribe("/state", lambda data: bus.send("/answer", b"to " + data))
    bus.send("/state", b"1")
    bus.send("/nobody", b"-")
    bus.send("/state", b"2")
    assert heard == []  # a listener never works inside the step of a publisher
    executor.spin_once()
    states = [(name, data) for data in (b"1", b"2") for name in ("first", "second")]
    assert heard == [*states, ("answer", b"to 1"), ("answer", b"to 2")]
    assert not executor.tasks


def test_nodes_that_answer_each_other_without_end_leave_turns_to_everything_else() -> None:
    executor, count, others = FalseExecutor(), [0], list[int]()
    bus = LocalBus(executor, ["a"])

    def answer(data: bytes) -> None:
        count[0] += 1
        bus.send("/ping", data)

    bus.subscribe("/ping", answer)
    bus.send("/ping", b"")
    executor.create_task(lambda: others.append(count[0]))
    for _ in range(3):
        executor.spin_once()
    assert others == [NODE_LIMITS.turn]
    assert count == [2 * NODE_LIMITS.turn]
    assert len(executor.tasks) == 1


def test_a_topic_that_a_node_elsewhere_publishes_is_left_to_the_middleware() -> None:
    bus = LocalBus(FalseExecutor(), ["driver", "force_loop"])
    assert bus.carries(["driver"])
    assert not bus.carries(["driver", "program"])
    assert not bus.carries([])
