"""What /diagnostics and the console report: the present state, of which arm, and what to do next."""

from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from test_nodes import Hand, Listener, bad

from wam_description.status import guidance

MS = 1_000_000


def reports(heard: Listener, node: str = "wam: driver") -> list[Any]:
    """Reports of one node, oldest first."""
    every = [status for array in heard.seen["/diagnostics"] for status in array.status]
    return [status for status in every if status.name == node]


def next_report(hand: Hand, heard: Listener) -> Any:
    """The report of the next full second."""
    count = len(reports(heard))
    hand.ros.wait(lambda: len(reports(heard)) > count)
    return reports(heard)[-1]


@pytest.fixture
def hand(ros: Any, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> Hand:
    return Hand(ros, tmp_path, "lockstep")


def test_diagnostics_have_the_level_of_the_state_while_it_lasts(hand: Hand) -> None:
    heard = Listener(hand.ros, "/diagnostics")
    hand.enable()
    next_report(hand, heard)
    assert next_report(hand, heard).level == DiagnosticStatus.OK
    hand.ask("estop")
    report = next_report(hand, heard)
    assert report.level == DiagnosticStatus.ERROR
    assert "emergency stop" in report.message
    hand.ask("reset_fault")
    next_report(hand, heard)
    assert next_report(hand, heard).level == DiagnosticStatus.OK


def test_a_refused_message_is_a_warning_for_two_reports_and_stays_counted(hand: Hand) -> None:
    heard = Listener(hand.ros, "/diagnostics")
    hand.enable()
    hand.extra = [bad(effort=[])]
    key, refusals = "refused on motor_current_command", hand.node.health.refusals
    hand.ros.wait(lambda: refusals["motor_current_command"].count == 1)
    found = [next_report(hand, heard) for _ in range(3)]
    warn, ok = DiagnosticStatus.WARN, DiagnosticStatus.OK
    assert [report.level for report in found] == [warn, warn, ok], "up to a report before which none was refused"
    assert all({pair.key: pair.value for pair in one.values}[key] == "1" for one in found)


def test_the_console_says_the_state_and_what_to_call_next(hand: Hand, capfd: pytest.CaptureFixture[str]) -> None:
    connected = capfd.readouterr().err
    hand.enable()
    for request, data in (("estop", None), ("reset_fault", None), ("enable", True), ("enable", False)):
        hand.ask(request, data)
    hand.wait_periods(1)
    release = (
        "braked, all nodes are connected; to enable the arm: wam call enable "
        "(or: ros2 service call /wam/driver/enable std_srvs/srv/SetBool '{data: true}')"
    )
    fault = (
        "fault, the brakes are on; when its cause is gone: wam call reset_fault "
        "(or: ros2 service call /wam/driver/reset_fault std_srvs/srv/Trigger), then enable"
    )
    released = "enabled: the motors follow the commands"
    lines = [line.split("]: ")[1] for line in capfd.readouterr().err.splitlines() if "[INFO]" in line]
    assert lines == [released, fault, release, released, "braked: the brakes are on"]
    assert release in connected


def test_the_console_names_the_arm_that_is_called() -> None:
    assert "wam call enable --namespace left " in guidance("braked", "", "", "/left", False, "")
