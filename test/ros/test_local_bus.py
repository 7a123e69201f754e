"""Messages between nodes of one process without the middleware: order, turns, who is served."""

from collections import deque
from collections.abc import Callable

from wam_ros.limits import NODE_LIMITS
from wam_ros.local_bus import LocalBus, Message


class FalseExecutor:
    """Does one task at a time, first come, first served."""

    def __init__(self) -> None:
        self.tasks: deque[Callable[[], None]] = deque()

    def create_task(self, task: Callable[[], None]) -> None:
        self.tasks.append(task)

    def spin_once(self) -> None:
        self.tasks.popleft()()


def test_nodes_that_answer_each_other_without_end_leave_turns_to_everything_else() -> None:
    executor, count, others = FalseExecutor(), [0], list[int]()
    bus = LocalBus(executor, ["a"])

    def answer(message: Message) -> None:
        count[0] += 1
        bus.send("/ping", *message)

    bus.subscribe("/ping", answer)
    bus.send("/ping", 1, None, b"")
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
