"""Processes and signals: whatever ends the stack, the brakes go on, the bag is closed, nothing is left behind."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from conftest import LONG, ran, soon, wait
from diagnostic_msgs.msg import DiagnosticStatus
from std_srvs.srv import SetBool
from test_own_controller import Echo

from wam_bag.bag import read
from wam_cli.main import main
from wam_description.configuration import Configuration, packaged
from wam_description.event import fault
from wam_description.nodes import GROUPED
from wam_description.topics import BY_NAME
from wam_ros import bring_up
from wam_ros.bring_up import Composition, Processes
from wam_ros.limits import CALL_LIMITS, PROCESS_LIMITS
from wam_ros.process_signals import LISTENER_GONE
from wam_ros.ros_topics import qos
from wam_ros.run import prepare_logging_directory, run

ROOT = Path(__file__).parents[2]
NODES = 7  # six and the recorder
PYTHON = ("env", "--default-signal=HUP", sys.executable)  # nohup would have it ignored
BOLD = ("--set", "driver:late_periods=1.0")  # a busy machine is no obstacle


class Stack:
    """A command of ours in a process of its own, found again with all it started by a word in its environment."""

    def __init__(self, folder: Path, *command: str, **environment: str) -> None:
        self.mark = f"WAM_STACK_TEST={folder}"
        self.output = folder / "output.txt"
        everything = {**os.environ, "PYTHONPATH": str(ROOT), "WAM_STACK_TEST": str(folder), **environment}
        with self.output.open("w") as output:
            self.process = subprocess.Popen(
                [*PYTHON, *command], stdout=output, stderr=output, cwd=folder, env=everything
            )

    def alive(self) -> list[int]:
        """Processes that carry the mark, zombies left out."""
        found = []
        for entry in Path("/proc").iterdir():
            with contextlib.suppress(OSError):
                if (
                    entry.name.isdigit()
                    and self.mark.encode() in (entry / "environ").read_bytes().split(b"\0")
                    and (entry / "stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
                ):
                    found.append(int(entry.name))
        return found

    def said(self) -> str:
        return self.output.read_text()

    def end(self) -> None:
        """Kill what a failed test has left."""
        for pid in self.alive():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.process.wait()


@pytest.fixture
def started(tmp_path: Path) -> Iterator[Callable[..., Stack]]:
    stacks: list[Stack] = []

    def start(*command: str, **environment: str) -> Stack:
        stacks.append(Stack(tmp_path, *command, **environment))
        return stacks[-1]

    yield start
    for stack in stacks:
        stack.end()


def soon_delivered() -> float:
    """The same for processes: first the driver, then the others wait until listeners have their last messages."""
    return 2.0 * PROCESS_LIMITS.delivery + soon()


def up(started: Callable[..., Stack], *arguments: str) -> Stack:
    """The whole stack and a recorder, running, with a bag that grows."""
    stack = started("-m", "wam_cli.main", "up", "--record", *arguments)
    wait(lambda: recorded(stack) > 100_000, f"a bag that grows; {stack.said()}")
    in_groups = GROUPED in arguments or "--realtime" in arguments
    others = 3 if in_groups else NODES if "--processes" in arguments else 0
    assert len(stack.alive()) == others + 1
    return stack


def recorded(stack: Stack) -> int:
    return sum(file.stat().st_size for file in stack.output.parent.glob("bags/*/*.mcap"))


def spin(composition: Composition, until: Callable[[], bool], seconds: float = LONG) -> None:
    end = time.monotonic() + seconds
    composition.spin(lambda: until() or time.monotonic() > end)


def statuses(folder: Path, node: str) -> list[str]:
    """What a node said of its state, from the only bag of a folder."""
    (bag,) = (folder / "bags").iterdir()
    assert (bag / "metadata.yaml").is_file(), "the bag is closed"
    status: Any = read(bag).topics["/wam/status"]
    return [message.message for message in status.messages if message.name == node]


def enable(ros: Any, stack: Stack) -> None:
    """Release the brakes, and wait until the driver's status has come: it is latched, and the next one replaces it."""
    node = ros.node("asker")
    seen: list[str] = []
    node.create_subscription(
        DiagnosticStatus, "status", lambda message: seen.append(message.message), qos(BY_NAME["status"])
    )
    client = node.create_client(SetBool, "driver/enable")
    ros.wait(client.service_is_ready)
    while True:
        future = client.call_async(SetBool.Request(data=True))
        ros.wait(future.done, what=f"an answer; {stack.said()}")
        if future.result().success:
            break
        assert "no motor_current_command arrives" in future.result().message
    ros.wait(lambda: "enabled" in seen, what=f"the status 'enabled'; {stack.said()}")


@pytest.mark.parametrize(("name", "options"), [("INT", ()), ("TERM", ("--processes", GROUPED)), ("HUP", ())])
def test_a_signal_ends_all_with_brakes_on_and_the_bag_closed(
    name: str, options: tuple[str, ...], started: Any, tmp_path: Path, ros: Any
) -> None:
    stack = up(started, *options)
    enable(ros, stack)
    stack.process.send_signal(signal.Signals[f"SIG{name}"])
    wait(lambda: stack.process.poll() is not None, f"the end of wam up; {stack.said()}", soon_delivered())
    assert stack.alive() == []
    assert stack.process.returncode == 0
    assert "Traceback" not in stack.said()
    assert "fault" not in stack.said(), "the brakes are on before a command ceases"
    assert statuses(tmp_path, "driver")[-2:] == ["enabled", "braked"]


@pytest.fixture
def recording(tmp_path: Path, domain_id: int, monkeypatch: pytest.MonkeyPatch) -> Processes:
    """A recorder as a process, with a bag that is open."""
    (tmp_path / "wam_cli.py").touch()  # no process takes a module from there
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(bring_up, "PROCESS_LIMITS", replace(bring_up.PROCESS_LIMITS, end=0.2, end_reports=0.2))
    processes = Processes(Configuration.load(packaged("wam")).with_values({"nodes": ["recorder"]}))
    wait(lambda: list(tmp_path.glob("bags/*/*.mcap")), "a bag")
    return processes


def pid_of(processes: Processes, name: str) -> int:
    return processes.processes[name].pid


def test_the_end_waits_for_a_recorder_that_is_slow_and_says_so(
    recording: Processes, tmp_path: Path, capfd: Any
) -> None:
    pid = pid_of(recording, "recorder")
    os.kill(pid, signal.SIGSTOP)
    threading.Timer(1.5, os.kill, (pid, signal.SIGCONT)).start()  # much later than the patience with other nodes
    recording.close()
    assert recording.killed == []
    assert list(tmp_path.glob("bags/*/metadata.yaml"))
    assert "waiting for the end of node recorder" in capfd.readouterr().err


def catches_sigterm(pid: int) -> bool:
    status = Path("/proc", str(pid), "status").read_text()
    return bool(int(status.split("SigCgt:")[1].split()[0], 16) >> (signal.SIGTERM - 1) & 1)


@pytest.mark.parametrize("imports", [False, True])
def test_a_recorder_that_is_told_to_end_before_it_has_a_bag_lacks_no_messages(
    imports: bool, tmp_path: Path, domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    processes = Processes(Configuration.load(packaged("wam")).with_values({"nodes": ["recorder"]}))
    if imports:
        wait(lambda: catches_sigterm(pid_of(processes, "recorder")), "the first import")
        pid = pid_of(processes, "recorder")
        os.kill(pid, signal.SIGSTOP)  # so that it has no bag yet however busy the machine is
        threading.Timer(0.3, os.kill, (pid, signal.SIGCONT)).start()
    processes.close()
    assert (processes.bag_failure, processes.killed) == ("", [])
    assert not list(tmp_path.glob("bags/*"))


def test_a_recorder_that_is_ended_before_the_other_nodes_leaves_a_bag_that_is_not_whole(
    tmp_path: Path, domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with Processes(Configuration.load(packaged("wam")).with_values({"nodes": ["gravity", "recorder"]})) as processes:
        wait(lambda: list(tmp_path.glob("bags/*/*.mcap")), "a bag")
        os.kill(pid_of(processes, "recorder"), signal.SIGTERM)
        assert processes.wait(bool) == {"recorder": 0}
    assert processes.bag_failure.startswith("the recorder ended before the other nodes; the bag lacks")


def test_a_recorder_that_does_not_end_is_killed_and_named(
    recording: Processes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    monkeypatch.setattr(bring_up, "PROCESS_LIMITS", replace(bring_up.PROCESS_LIMITS, recorder_end=0.5))
    os.kill(pid_of(recording, "recorder"), signal.SIGSTOP)
    recording.close()
    assert recording.killed == ["recorder"]
    assert "node recorder is killed: it did not end in time" in capfd.readouterr().err
    (bag,) = tmp_path.glob("bags/*")
    assert not (bag / "metadata.yaml").exists()
    main_without_exit("bag", "repair", str(bag))
    assert (bag / "metadata.yaml").is_file()


HELD_UP = """
def held_up(self, *given):
    while True:
        pass

Held.destroy_node = Held.shutdown = held_up
"""


@pytest.mark.parametrize(
    "held", ["from rclpy.node import Node as Held", "from rclpy._rclpy_pybind11 import EventsExecutor as Held"]
)
def test_a_process_that_the_middleware_holds_up_at_its_end_is_over_and_has_done_its_work(
    held: str, tmp_path: Path, domain_id: int, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    (tmp_path / "sitecustomize.py").write_text(f"{held}\n{HELD_UP}")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{ROOT}")
    monkeypatch.chdir(tmp_path)
    processes = Processes(Configuration.load(packaged("wam")).with_values({"nodes": ["recorder"]}))
    wait(lambda: list(tmp_path.glob("bags/*/*.mcap")), "a bag")
    processes.close()
    assert processes.killed == []
    assert processes.bag_failure == ""
    assert processes.processes["recorder"].returncode == -signal.SIGVTALRM
    assert processes.ended() == {"recorder": 0}
    assert list(tmp_path.glob("bags/*/metadata.yaml"))
    printed = capfd.readouterr().err.splitlines()
    assert not [line for line in printed if "WARN" in line and "waiting for the end" not in line]  # a busy machine


def main_without_exit(*words: str) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_lockstep_that_never_pauses(number: int, started: Any, tmp_path: Path, domain_id: int) -> None:
    stack = started("-m", "wam_cli.main", "demo", "--no-live", "--real-time-factor", "0", "--name", "stopped")
    wait(lambda: recorded(stack) > 100_000, f"a bag that grows; {stack.said()}")
    stack.process.send_signal(number)
    wait(lambda: stack.process.poll() is not None, f"the end; {stack.said()}", soon())
    assert stack.process.returncode == 128 + number
    assert "Traceback" not in stack.said()
    assert statuses(tmp_path, "driver")[-1] == "braked"


def test_children_of_a_killed_parent_end_by_themselves(started: Any, tmp_path: Path, domain_id: int) -> None:
    stack = up(started, "--processes")
    stack.process.kill()
    stack.process.wait()
    wait(lambda: not stack.alive(), "the end of the children", soon_delivered())
    (bag,) = (tmp_path / "bags").iterdir()
    assert (bag / "metadata.yaml").is_file(), "the recorder closed its bag"


GROUP = "the process of the nodes transform, gravity, force_loop, contact_estimator"


def test_a_process_that_ends_is_named_and_takes_the_stack_with_it(started: Any, tmp_path: Path, domain_id: int) -> None:
    stack = up(started, "--realtime", *BOLD)
    (victim,) = (pid for pid in stack.alive() if b"force_loop" in Path(f"/proc/{pid}/cmdline").read_bytes())
    os.kill(victim, signal.SIGKILL)
    wait(lambda: stack.process.poll() is not None, f"the end; {stack.said()}", soon_delivered())
    assert stack.alive() == []
    errors = [line for line in stack.said().splitlines() if line.startswith("error: ")]
    cause = f"error: {GROUP} was ended from outside by SIGKILL; the system does that if memory is short"
    assert errors[0] == f"{cause}; the other nodes are stopped now", "the cause comes first"
    assert not any(cause in line for line in errors[1:]), "and once"
    assert stack.process.returncode == 9
    assert statuses(tmp_path, "driver")[-1] == "braked"


PROGRAMS = {
    "node": ("wam_cli.main", "node", "driver"),
    "demo": ("wam_cli.main", "demo", "--no-live"),
    "scorecard": ("wam_cli.main", "model", "scorecard"),
    "live": ("wam_cli.main", "live", str(ROOT / "bags" / "sample" / "wam-touch")),
    "program": ("wam_cli.program", "node", "gravity", "--ros-args", "--params-file", str(packaged("wam"))),
}


@pytest.mark.parametrize(("program", "library", "number"), [
    ("node", "mujoco", signal.SIGINT),
    ("demo", "mujoco", signal.SIGINT),
    ("scorecard", "numpy", signal.SIGTERM),
    ("live", "PIL", signal.SIGINT),
    ("program", "pinocchio", signal.SIGINT),
])  # fmt: skip
def test_a_signal_during_start_up_ends_all_silently(
    program: str, library: str, number: signal.Signals, started: Any, domain_id: int
) -> None:
    stack = started("-m", *PROGRAMS[program])
    wait(lambda: has_loaded(stack, library) or stack.process.poll() is not None, f"the import of {library}")
    stack.process.send_signal(number)
    wait(lambda: stack.process.poll() is not None, f"the end; {stack.said()}")
    assert stack.alive() == []
    assert stack.process.returncode in (0, 128 + number)
    assert "Traceback" not in stack.said()


def has_loaded(stack: Stack, library: str) -> bool:
    """Whether a program has begun to load a library, by the files that it has mapped."""
    with contextlib.suppress(OSError):
        return any(f"/{library}/" in Path(f"/proc/{pid}/maps").read_text() for pid in stack.alive())
    return False


@pytest.mark.parametrize("program", ["node", "program"])
def test_signals_while_a_program_ends_do_not_change_how_it_ends(program: str, ros: Any, started: Any) -> None:
    listener = ros.node("listener")
    stack = started("-m", *PROGRAMS[program])
    name = "driver" if program == "node" else "gravity"
    ros.wait(lambda: name in listener.get_node_names() or stack.process.poll() is not None)

    def interrupt() -> bool:
        stack.process.send_signal(signal.SIGINT)
        time.sleep(0.002)
        return stack.process.poll() is not None

    wait(interrupt, f"the end; {stack.said()}")
    assert stack.process.returncode == 0
    assert "Traceback" not in stack.said()


@pytest.mark.parametrize("home", [None, "/dev/null", "/proc"], ids=["unset", "not a directory", "read-only"])
def test_without_a_home_to_write_to_the_log_is_elsewhere(home: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("HOME", home), ("ROS_LOG_DIR", None), ("ROS_HOME", None)):
        monkeypatch.setenv(name, value or "")
        if value is None:
            monkeypatch.delenv(name)
    prepare_logging_directory()
    assert os.environ["ROS_LOG_DIR"] == f"{tempfile.gettempdir()}/wam_stack_log_{os.getuid()}"
    monkeypatch.delenv("ROS_LOG_DIR")


def command(capsys: Any, *arguments: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as end:
        main(list(arguments))
    output = capsys.readouterr()
    code = end.value.code
    return (code if isinstance(code, int) else 1, output.out, output.err if isinstance(code, int) else str(code))


@pytest.mark.slow
def test_a_reader_who_has_had_enough_is_no_error() -> None:
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        [sys.executable, "-m", "wam_cli.main", "model", "scorecard"],
        stdout=write,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    os.close(write)
    assert (done.returncode, done.stderr) == (128 + signal.SIGPIPE, "")


@pytest.mark.slow
@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_stream_that_the_caller_has_closed_is_no_error(closed: str) -> None:
    words = ["sh", "-c", f"{sys.executable} -m wam_cli.program model scorecard {closed}"]
    done = subprocess.run(words, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("ros_arguments", "text"), [(["-p", "x"], "-p x"), (["-p"], "trailing -p flag"), (["--nonsense"], "--nonsense")]
)
def test_wrong_ros_arguments_end_a_program_with_one_line(
    ros_arguments: list[str], text: str, domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wam_ros.run.Stop", object)
    with pytest.raises(SystemExit, match=text) as ended:
        run({}, ["wam", "--ros-args", *ros_arguments])
    assert "\n" not in str(ended.value)


def test_record_takes_mode_and_nodes_from_the_running_stack(started: Any, tmp_path: Path, domain_id: int) -> None:
    mode, echo = "realtime", f"{Echo.__module__}:Echo"
    configured = Configuration.load(packaged("wam")).with_nodes(echo).with_values({"timing.mode": mode})
    path = os.pathsep.join([str(ROOT), str(ROOT / "test" / "ros")])
    with Composition(configured, "left", domain_id) as composition:
        words = ("--name", "mine", "--set", f"recorder:directory={tmp_path / 'bags'}", "--namespace", "left")
        stack = started("-m", "wam_cli.main", "bag", "record", *words, PYTHONPATH=path)
        spin(composition, lambda: recorded(stack) > 100_000)
        assert recorded(stack) > 100_000, stack.said()
        stack.process.send_signal(signal.SIGINT)
        spin(composition, lambda: stack.process.poll() is not None)
    assert stack.process.returncode == 0, stack.said()
    nodes = "driver, transform, velocity_loop, gravity, force_loop, contact_estimator, echo"
    assert stack.said().startswith(f"the stack in /left runs in {mode}: {nodes}\n")
    bag = read(tmp_path / "bags" / "mine")
    assert bag.metadata["recording"]["mode"] == mode
    assert bag.first > 10**18, "a time of day"
    assert bag.counts["/left/echo"] > 0
    assert b"/left/echo:" in bag.attachments["parameters.yaml"]


def test_record_without_a_stack_ends_with_the_reason_and_no_bag(
    tmp_path: Path, domain_id: int, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    monkeypatch.setattr("wam_ros.client.CALL_LIMITS", replace(CALL_LIMITS, answer=0.2))
    code, _, err = command(capfd, "bag", "record", "--set", f"recorder:directory={tmp_path / 'bags'}")
    assert (code, list(tmp_path.glob("bags/*"))) == (1, [])
    assert err == "wam bag: no node of a stack in /wam answers within 0.2 s; start the stack with 'wam up'\n"


def test_a_fault_ends_the_scenario_where_no_step_comes_any_more(tmp_path: Path, domain_id: int) -> None:
    script = tmp_path / "script.yaml"
    script.write_text("steps: [{name: wait, seconds: 100.0}]")
    base = Configuration.load(packaged("wam"))
    configured = base.with_values({"nodes": [*base.shared.nodes, "scenario"], "scenario:script": str(script)})
    with Composition(configured, domain_id=domain_id) as composition:
        driver: Any = composition.nodes["driver"]
        spin(composition, lambda: driver.driver.stamp > 20_000_000)
        driver.time.pause(True)
        spin(composition, lambda: False, 0.1)
        driver.trip(fault("test", reason="two publishers send motor_current_command"))
        scenario: Any = composition.nodes["scenario"]
        spin(composition, lambda: scenario.done)
        assert scenario.failure == "the driver stopped in step 'wait': two publishers send motor_current_command"


REPORT_THE_DELIVERY = """
import time
from rclpy.node import Node
from wam_ros.run import end_of_delivery, run
from wam_ros.limits import PROCESS_LIMITS

class Sender(Node):
    def __init__(self, context, namespace):
        super().__init__("sender", context=context, namespace=namespace)
        print("made", flush=True)

    def destroy_node(self):
        print(end_of_delivery(self.context) - time.monotonic() <= PROCESS_LIMITS.short_delivery)
        super().destroy_node()

run({"sender": Sender}, ["wam"])
"""


@pytest.mark.parametrize("listener_gone", [False, True])
def test_a_node_waits_for_its_listeners_but_not_for_one_that_was_killed(
    listener_gone: bool, started: Any, domain_id: int
) -> None:
    stack = started("-c", REPORT_THE_DELIVERY)
    wait(lambda: "made" in stack.said() or stack.process.poll() is not None, "the node")
    assert stack.process.poll() is None, stack.said()
    if listener_gone:
        stack.process.send_signal(LISTENER_GONE)
    stack.process.terminate()
    assert stack.process.wait(LONG) == 0, stack.said()
    assert stack.said().split() == ["made", str(listener_gone)]


@pytest.mark.parametrize(("number", "is_announced"), [(signal.SIGKILL, True), (signal.SIGTERM, False)])
def test_where_a_node_was_killed_the_others_are_informed_before_they_end(
    number: signal.Signals, is_announced: bool, recording: Processes, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[int] = []
    monkeypatch.setattr(subprocess.Popen, "send_signal", lambda process, number: sent.append(number))
    os.kill(pid_of(recording, "recorder"), number)
    recording.wait(bool)
    recording.close()
    assert (LISTENER_GONE in sent) is is_announced


def test_a_listener_that_is_frozen_holds_up_the_end_of_all_nodes_once(
    started: Any, domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    patience = 4.0  # s; each of the six nodes would wait as long
    monkeypatch.setattr("wam_ros.run.PROCESS_LIMITS", replace(PROCESS_LIMITS, delivery=patience))
    configured = Configuration.load(packaged("wam")).with_values({"timing.real_time_factor": 0.0})
    with Composition(configured, domain_id=domain_id) as composition:
        listener = started("-m", "wam_cli.main", "bag", "record", "--name", "outside")
        spin(composition, lambda: recorded(listener) > 100_000)
        assert recorded(listener) > 100_000, listener.said()
        listener.process.send_signal(signal.SIGSTOP)
        spin(composition, lambda: False, 0.1)
        begin = time.monotonic()
    took = time.monotonic() - begin
    listener.process.send_signal(signal.SIGCONT)
    assert took < patience + min(soon(), 2.0 * patience)


def test_the_driver_does_not_repeat_its_status_over_one_that_is_on_its_way(
    started: Any, domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wam_ros.run.PROCESS_LIMITS", replace(PROCESS_LIMITS, delivery=0.2))
    configured = Configuration.load(packaged("wam")).with_values({"timing.mode": "realtime", "nodes": ["driver"]})
    with Composition(configured, domain_id=domain_id) as composition:
        published = composition.nodes["driver"].outlets.written
        listener = started("-m", "wam_cli.main", "bag", "record", "--name", "outside")
        spin(composition, lambda: recorded(listener) > 40_000)
        assert recorded(listener) > 40_000, listener.said()
        listener.process.send_signal(signal.SIGSTOP)
        spin(composition, lambda: False, 0.2)
        before = published["status"]
        begin = time.monotonic()
        spin(composition, lambda: False, 1.5)  # about 30 periods of the repetition
        while_frozen, frozen = published["status"] - before, time.monotonic() - begin
        listener.process.send_signal(signal.SIGCONT)
        spin(composition, lambda: published["status"] > before + while_frozen + 10, LONG)
        after = published["status"] - before - while_frozen
    assert 1 <= while_frozen <= frozen / 0.2 + 2
    assert after > 10


def test_a_node_without_a_package_that_it_needs_ends_with_one_line(tmp_path: Path, domain_id: int) -> None:
    (tmp_path / "pinocchio.py").write_text("raise ModuleNotFoundError('gone', name='pinocchio')")
    path = os.pathsep.join([str(tmp_path), str(ROOT)])
    done = ran("-P", "-m", "wam_cli.program", "node", "driver", env={**os.environ, "PYTHONPATH": path})
    assert done.returncode == 1
    assert done.stderr.startswith("wam node: it needs 'pinocchio', which is not installed; ")
    assert len(done.stderr.splitlines()) == 1


SET_BACK = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <pthread.h>
#include <stdlib.h>
#include <unistd.h>
typedef int Wait(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);
int pthread_cond_timedwait(pthread_cond_t *condition, pthread_mutex_t *mutex, const struct timespec *until) {
  static __thread int waits;  // the first of each thread stands for the one during which the clock was set back
  struct timespec later = *until;
  int is_of_wall_clock = until->tv_sec > 1000000000;
  if (is_of_wall_clock && access(getenv("BEGUN"), F_OK) == 0 && !waits++) later.tv_sec += 3600;
  Wait *wait = (Wait *)dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");  // of this name on x86-64 alone
  return (wait ? wait : (Wait *)dlsym(RTLD_NEXT, "pthread_cond_timedwait"))(condition, mutex, &later);
}
"""
ONE_SHOTS = """
import os
from wam_ros.run import Connection
from wam_ros.tolerance import TolerantNode
came = []
def begin():
    timer = node.create_timer(0.005, lambda: (came.append(timer), timer.cancel(), begin()))
with Connection() as connection:
    node = connection.add(TolerantNode("a", context=connection.context))
    begin()
    connection.spin(lambda: len(came) > 40)
    open(os.environ["BEGUN"], "w").close()
    connection.spin(lambda: len(came) > 80)
assert len(set(came)) == len(came)
"""


def test_a_process_that_is_held_up_calls_no_timer_twice(tmp_path: Path, domain_id: int) -> None:
    begun = tmp_path / "begun"
    with subprocess.Popen([sys.executable, "-c", ONE_SHOTS], env={**os.environ, "BEGUN": str(begun)}) as process:
        end = time.monotonic() + LONG
        while process.poll() is None and time.monotonic() < end:
            if begun.exists():
                process.send_signal(signal.SIGSTOP)
                time.sleep(0.2)
                process.send_signal(signal.SIGCONT)
            time.sleep(0.03)
        process.kill()
    assert process.returncode == 0


@pytest.mark.skipif(shutil.which("cc") is None, reason="without a compiler no clock can be set back for a process")
def test_a_wall_clock_that_is_set_back_stops_no_timer(tmp_path: Path, domain_id: int) -> None:
    source, library = tmp_path / "set_back.c", tmp_path / "set_back.so"
    source.write_text(SET_BACK)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)
    environment = {**os.environ, "LD_PRELOAD": str(library), "BEGUN": str(tmp_path / "begun")}
    ran("-c", ONE_SHOTS, check=True, env=environment, timeout=LONG)
