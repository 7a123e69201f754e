"""A dry run of the driver on a bus: nothing is sent, and what would be sent is what is sent."""

import re
import time

import can
import pytest

from wam_description.configuration import Configuration, packaged
from wam_driver.bus import frames
from wam_driver.bus.bus_parameters import BusParameters
from wam_driver.bus.dry_run import heard, sent
from wam_driver.bus.line import line_of

BUS4 = Configuration.load(packaged("barrett-wam4-bus"))


def parameters(interface: str, channel: str) -> BusParameters:
    return BUS4.with_values({"driver:interface": interface, "driver:channel": channel}).node("driver", BusParameters)


def test_what_others_send_is_shown_and_nothing_is_sent() -> None:
    with can.Bus(interface="virtual", channel="dry") as other:
        line = line_of(BUS4.shared, parameters("virtual", "dry"), time)
        (text,) = heard(line, 0.05)
        assert "the bus is silent while no driver asks" in text, "that is no fault"
        for count in (100, 200, 300):
            position = frames.position(2, count)
            other.send(can.Message(arbitration_id=position.identifier, data=position.data, is_extended_id=False))
        found = list(heard(line, 0.1))
        assert other.recv(0.0) is None
        line.close()
    assert [re.sub(" +", " ", text).strip() for text in found] == ["3 443 00 01 2c controller 2 has P = 300"]


@pytest.mark.parametrize("version", [60, 200])
def test_what_would_be_sent_has_every_step_of_the_start_and_no_torque(version: int) -> None:
    found = list(sent(BUS4.shared, parameters("simulated", str(version)), version))
    remarks = [text for text in found if text.startswith("--")]
    assert [part in "\n".join(remarks) for part in ("wake up", "confirm_home", "each period")] == [True] * 3
    torques = [text for text in found if "torques" in text and not text.startswith("--")]
    assert torques
    assert all("torques [0, 0, 0, 0] counts" in text for text in torques)
    assert any("set ZERO to 1" in text for text in found)
