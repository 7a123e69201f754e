"""`wam call` on a running stack: parameters, topics, pushes and the time."""

import argparse
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from tempfile import TemporaryFile
from typing import Any

import pytest
import yaml
from conftest import LONG

from wam_cli.commands.call import _wrench, arguments
from wam_cli.main import main
from wam_description.arm import Shared
from wam_description.configuration import Configuration, packaged
from wam_description.wiring import Call
from wam_ros.client import StackClient
from wam_ros.limits import CALL_LIMITS

WAM = [sys.executable, "-P", "-m", "wam_cli.program"]


@pytest.fixture(scope="module")
def stack(domain_of_module: int) -> Iterator[None]:
    """A stack in lockstep."""
    up = subprocess.Popen([*WAM, "up"], stdout=subprocess.PIPE, text=True, env=os.environ)
    assert up.stdout is not None
    assert "nodes in" in up.stdout.readline()
    yield
    up.send_signal(signal.SIGINT)
    up.wait(LONG)


@pytest.fixture(autouse=True)
def is_not_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """The system would end the process of the tests as that of a command that does not leave the network."""
    monkeypatch.setattr("wam_ros.process_signals.LONGEST", 1e6)


def called(*words: str) -> tuple[int, str, str]:
    """Exit code, output and errors of a request, made in this process."""
    with TemporaryFile("w+") as out, TemporaryFile("w+") as err:
        with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as ended:
            main(["call", *words])
        assert isinstance(ended.value.code, int)
        for file in (out, err):
            file.seek(0)
        return ended.value.code, out.read(), err.read()


def wait_for_push() -> None:
    """Return when the simulated arm is pushed."""
    lines = subprocess.Popen([*WAM, "call", "echo", "sim/contact/wrench"], stdout=subprocess.PIPE, text=True)
    assert lines.stdout is not None
    next(line for line in lines.stdout if "y: 1.0" in line)
    lines.terminate()
    lines.wait(LONG)


def test_a_live_parameter_is_read_changed_and_refused(stack: None) -> None:
    assert called("set", "force_loop:posture_gain=1.25") == (0, "force_loop:posture_gain=1.25\n", "")
    assert called("get", "force_loop:posture_gain") == (0, "1.25\n", "")
    code, out, err = called("set", "force_loop:posture_gain=-1")
    assert (code, out) == (1, "")
    assert "posture_gain" in err
    assert called("get", "force_loop:posture_gain")[1] == "1.25\n"
    told = "force_loop:force_gain=[0.5]; lowered by the guard to be stable: force_gain [0.0"
    assert called("set", "force_loop:force_gain=0.5")[1].startswith(told)
    assert called("set", "force_loop:force_gain=0.02")[1] == "force_loop:force_gain=[0.02]\n"
    wrong = "wam call: force_loop:force_gain is 'abc'; it must be a number\n"
    assert called("set", "force_loop:force_gain=abc") == (1, "", wrong)
    assert "'posture_gain=2' has no node" in called("set", "posture_gain=2")[2]
    code, out, err = called("set", "driver:watchdog=5.0")
    assert (code, out) == (1, "")
    assert "parameter 'watchdog' is chosen at the start; while node driver runs, these may change: " in err
    code, out, err = called("get", "force_loop:posture_gian")
    assert (code, out) == (1, "")
    assert "did you mean 'posture_gain'?" in err


def test_the_live_parameters_of_a_node_come_first_and_those_of_all_nodes_on_demand(stack: None) -> None:
    code, out, err = called("get", "force_loop")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0] == "# live, changed by wam call set"
    own = lines.index("# of this node, chosen at its start")
    assert any(line.startswith("force_loop:force_gain=") for line in lines[:own])
    assert not any(":arm." in line or ":timing." in line for line in lines)
    assert lines[-1].endswith("wam call get force_loop --all")
    everything = called("get", "force_loop", "--all")[1].splitlines()
    assert set(lines[:-1]) < set(everything)
    assert any(line.startswith("force_loop:timing.period=") for line in everything)


def test_a_push_reaches_the_arm_and_a_wrong_one_is_refused(stack: None) -> None:
    assert called("enable")[0] == 0
    assert called("tare") == (0, "the present external torques now count as zero in the force loop\n", "")
    code, out, _ = called("push", "outer_link", "0", "12", "0", "--at", "0.3", "--seconds", "0.5")
    assert (code, out.startswith("pushed outer_link with 12 N at 0.30 m")) == (0, True)
    assert "this arm has inner_link, outer_link" in called("push", "hand", "0", "0", "1")[2]
    assert "--at is 2 m" in called("push", "outer_link", "0", "0", "1", "--at", "2")[2]
    too_much = "the force is 600 N; allowed: up to disturbance_force_limit, 500 N"
    assert too_much in called("push", "outer_link", "0", "-6e2", "0")[2]


def test_an_unknown_node_or_topic_is_answered_with_those_that_there_are(stack: None) -> None:
    for words in [("get", "nosuch"), ("set", "nosuch:gain=1"), ("echo", "nosuch")]:
        code, out, err = called(*words)
        assert (code, out) == (1, "")
        assert "start the stack" not in err
        there = set(err.partition("; there are ")[2].strip().split(", "))
        assert ({"joint_states", "status"} if words[0] == "echo" else {"driver", "force_loop"}) <= there
        assert "wam_call" not in there
    assert "'timing.period' is no name of a node" in called("get", "timing.period")[2]
    with StackClient("wam") as here:
        refused = here.request(Call("nosuch", "tare"), LONG).message
        lacks = here.request(Call("driver", "nosuch"), LONG).message
    assert refused.startswith("no service /wam/nosuch/tare; there are ")
    assert {"driver", "force_loop"} <= set(refused.partition("; there are ")[2].split(", "))
    assert lacks.startswith("no service /wam/driver/nosuch; there are /wam/driver/enable, ")


def test_a_signal_is_handled_between_two_callbacks(domain_id: int, capfd: pytest.CaptureFixture[str]) -> None:
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with StackClient("wam") as client:
        client.node.create_timer(0.001, lambda: signal.raise_signal(signal.SIGTERM))
        with pytest.raises(KeyboardInterrupt):
            client.wait(lambda: False)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    assert "Exception" not in capfd.readouterr().err


def test_next_to_a_driver_of_ones_own_the_shared_parameters_are_those_of_another_node(
    ros: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wam_ros.client.CALL_LIMITS", replace(CALL_LIMITS, answer=LONG))
    driver = ros.node("driver")
    driver.declare_parameter("serial", "WAM7")
    node = subprocess.Popen([*WAM, "node", "gravity", "-r", "__ns:=/wam", "-p", "timing.mode:=realtime"])

    def shared() -> Shared:
        with StackClient("wam") as stack:
            return stack.read_shared()

    try:
        with ThreadPoolExecutor() as threads:
            found = threads.submit(shared)
            ros.wait(found.done)
        assert found.result().timing.mode == "realtime"
    finally:
        node.terminate()
        node.wait(LONG)


def test_a_push_on_the_inner_link_acts_on_the_axis_of_its_tube() -> None:
    parser = argparse.ArgumentParser()
    arguments(parser)
    given = parser.parse_args(["push", "inner_link", "0", "10", "0", "--at", "0.5"])
    driver = Configuration.load(packaged("wam")).sections["/**"]
    wrench, at, _ = _wrench(given, driver)
    assert at == 0.5
    assert wrench.torque == pytest.approx((-10.0 * 0.5 / 0.5588 * 0.04064, 0.0, 5.0), rel=1e-6)


def test_an_arm_that_cannot_be_pushed_is_told_with_what_to_do(stack: None) -> None:
    def push(*words: str) -> tuple[int, str, str]:
        return called("push", "outer_link", "0", "12", "0", *words)

    assert called("disable")[0] == 0
    assert push() == (1, "", "wam call: not pushed: the arm is braked; wam call enable\n")
    assert called("enable")[0] == 0
    assert called("pause")[0] == 0
    assert push() == (1, "", "wam call: not pushed: the arm is paused; wam call resume\n"), "at once, by the status"
    assert called("resume")[0] == 0
    long = subprocess.Popen(
        [*WAM, "call", "push", "outer_link", "0", "1", "0", "--seconds", "1e6"], stderr=subprocess.PIPE, text=True
    )
    wait_for_push()
    assert called("estop")[0] == 0
    assert long.stderr is not None
    err = long.stderr.read()
    assert long.wait(LONG) == 1
    assert "the push ended after" in err
    assert "the arm is in fault (emergency stop" in err
    code, out, err = push()
    assert (code, out) == (1, "")
    assert "not pushed: the arm is in fault (" in err
    assert "wam call reset_fault" in err
    assert [called(word)[0] for word in ("reset_fault", "reset", "enable")] == [0, 0, 0]


def test_a_topic_that_is_silent_is_named_and_ends_the_command_in_time(stack: None) -> None:
    code, out, err = called("echo", "status", "--count", "200", "--timeout", "3")
    assert code == 1
    count = out.count("---\n")
    assert count > 3
    waits = f"waiting for message {count + 1} of 200 on status"
    assert err.splitlines() == [
        f"{waits}, which is published when it changes; Ctrl-C ends this",
        f"wam call: no message came on status for 3 s (--timeout); {count} of 200 came before",
    ]
    assert "argument --timeout: '-1' is not allowed" in called("echo", "status", "--timeout", "-1")[2]


@pytest.mark.parametrize(("before", "words", "why"), [
    ("pause", "force_measured", "the arm is paused, and continues after 'wam call resume'"),
    ("resume", "sim/disturbance", "no node publishes it now"),
    ("resume", "force_measured --namespace nowhere", "no driver was found: there is an arm in /wam"),
])  # fmt: skip
def test_a_topic_on_which_nothing_comes_ends_in_time_with_the_reason(
    before: str, words: str, why: str, stack: None
) -> None:
    assert called(before)[0] == 0
    code, out, err = called("echo", *words.split(), "--timeout", "3")
    assert called("resume")[0] == 0
    assert (code, out) == (1, "")
    topic = words.partition(" ")[0]
    assert err.splitlines()[-1] == f"wam call: no message came on {topic} for 3 s (--timeout); {why}"


def test_messages_are_printed_and_the_time_is_stopped(stack: None) -> None:
    code, out, _ = called("echo", "joint_states", "--count", "1")
    assert code == 0
    message = next(yaml.safe_load_all(out))
    assert message["name"] == ["joint1", "joint2", "joint3", "joint4"]
    assert len(message["position"]) == 4
    assert [called(word)[:2] for word in ("pause", "resume")] == [(0, "paused\n"), (0, "running\n")]
    first, second = (int(called("step")[1].split()[-2]) for _ in range(2))  # '... ns'
    assert second == first + 1_000_000
    assert called("resume")[0] == 0
