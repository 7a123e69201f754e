"""The line over python-can: frames arrive as they were sent, and errors of the adapter are counted."""

import random
import time

import can

from wam_driver.bus import frames
from wam_driver.bus.frames import Frame
from wam_driver.bus.line import CanLine


def lines(channel: str) -> tuple[CanLine, CanLine]:
    """Two ends of a virtual bus; nothing here waits."""
    both = [can.Bus(interface="virtual", channel=channel) for _ in range(2)]
    return CanLine(both[0], time), CanLine(both[1], time)


def test_frames_arrive_as_they_were_sent() -> None:
    host, node = lines("frames")
    draw = random.Random(47)
    sent = [Frame(draw.randrange(2048), draw.randbytes(draw.randint(1, 8))) for _ in range(100)]
    for frame in sent:
        host.send(frame)
    assert [node.receive(0.0) for _ in sent] == sent
    assert node.receive(0.0) is None
    assert host.receive(0.0) is None, "its own frames"
    host.close()
    node.close()


def test_an_error_frame_is_no_frame() -> None:
    host, node = lines("errors")
    host._bus.send(can.Message(is_error_frame=True))
    assert node.receive(0.0) is None
    assert node.counts["bus errors"] == 1
    host.close()
    node.close()


def test_a_bus_that_is_closed_refuses_frames() -> None:
    host, node = lines("closed")
    host.close()
    node.close()
    assert not host.send(frames.get(1, 5))
    assert host.receive(0.0) is None
    assert host.counts["bus errors"] == 1
