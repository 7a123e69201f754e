"""The topics of a simulation without ROS: what it keeps of their messages."""

from wam_description.signals import Point, State, Table, Wrench
from wam_description.topics import JOINT_STATE, POINT, TABLE, WRENCH, Topic
from wam_sim.bus import Bus, TopicValue


def test_numbers_of_messages_come_back_with_their_frames_in_the_order_in_which_they_were_published() -> None:
    kinds = {"states": JOINT_STATE, "forces": WRENCH, "points": POINT, "tables": TABLE}
    bus = Bus({name: Topic(name, kind, "inner", name) for name, kind in kinds.items()})
    third = 1.0 / 3.0
    published = [
        ("states", 1, State([third, 2.0], [], [3.0]), (third, 2.0, 3.0), ""),
        ("states", 2**62, State([1], [2], []), (1.0, 2.0), ""),
        ("forces", 3, Wrench("link", (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)), (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), "link"),
        ("forces", 4, Wrench("base", (1.0, 2.0, 3.0), (4.0, 5.0, 0.0)), (1.0, 2.0, 3.0, 4.0, 5.0, 0.0), "base"),
        ("forces", 5, Wrench("base", (0.0,) * 3, (0.0,) * 3), (0.0,) * 6, "base"),
        ("points", 6, Point("link", (0.1, 0.0, 0.0)), (0.1, 0.0, 0.0), "link"),
        ("tables", 7, Table("base", ((1.0, 2.0), (3.0, 4.0))), (1.0, 2.0, 3.0, 4.0), "base"),
        ("tables", 8, Table("base", ()), (), "base"),
        ("states", 9, State([third, 2.0], [], [3.0]), (third, 2.0, 3.0), ""),
    ]
    expected: dict[str, list[TopicValue]] = {}
    for topic, stamp, value, numbers, frame in published:
        bus.publish(topic, stamp, value)
        expected.setdefault(topic, []).append(TopicValue(stamp, numbers, frame))
        if stamp == 5:  # read meanwhile: what comes after goes on from it
            assert bus.rows == expected
    assert bus.rows == expected
