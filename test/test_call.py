"""`wam call` on a running stack: parameters, topics, pushes and the time."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest
import yaml
from conftest import LONG

WAM = [sys.executable, "-P", "-m", "wam_cli.program"]


@pytest.fixture(scope="module")
def stack(domain_of_module: int) -> Iterator[None]:
    """A stack in lockstep, as fast as it can."""
    up = subprocess.Popen([*WAM, "up", "--real-time-factor", "0"], stdout=subprocess.PIPE, text=True, env=os.environ)
    assert up.stdout is not None
    assert "nodes started" in up.stdout.readline()
    yield
    up.send_signal(signal.SIGINT)
    up.wait(LONG)


def called(*words: str) -> tuple[int, str, str]:
    """Exit code, output and errors of a request."""
    done = subprocess.run([*WAM, "call", *words], capture_output=True, text=True, timeout=LONG, check=False)
    return done.returncode, done.stdout, done.stderr


def test_a_live_parameter_is_read_changed_and_refused(stack: None) -> None:
    assert called("set", "force_loop:posture_gain=1.25")[0] == 0
    assert called("get", "force_loop:posture_gain") == (0, "1.25\n", "")
    code, out, err = called("set", "force_loop:posture_gain=-1")
    assert (code, out) == (1, "")
    assert "posture_gain" in err
    assert called("get", "force_loop:posture_gain")[1] == "1.25\n"
    code, out, err = called("get", "force_loop:posture_gian")
    assert (code, out) == (1, "")
    assert "did you mean 'posture_gain'?" in err


def test_a_push_reaches_the_arm_and_a_wrong_one_is_refused(stack: None) -> None:
    assert called("enable")[0] == 0
    code, out, _ = called("push", "outer_link", "0", "12", "0", "--at", "0.3", "--seconds", "0.5")
    assert (code, out.startswith("pushed outer_link with 12 N at 0.30 m")) == (0, True)
    assert "push one of inner_link, outer_link" in called("push", "hand", "0", "0", "1")[2]
    assert "--at is 2 m" in called("push", "outer_link", "0", "0", "1", "--at", "2")[2]


def test_messages_are_printed_and_the_time_is_stopped(stack: None) -> None:
    code, out, _ = called("echo", "joint_states", "--count", "1")
    assert code == 0
    message = next(yaml.safe_load_all(out))
    assert message["name"] == ["joint1", "joint2", "joint3", "joint4"]
    assert len(message["position"]) == 4
    assert [called(word)[:2] for word in ("pause", "resume")] == [(0, "paused\n"), (0, "running\n")]
    first, second = (int(called("step")[1].split()[1]) for _ in range(2))  # 'at ... ns'
    assert second == first + 1_000_000
    assert called("resume")[0] == 0
