"""Who reaches the stack, and whom it disturbs: this machine alone, and nobody."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from conftest import LONG, ROOT, wait

from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError
from wam_driver.thresholds import DRIVER
from wam_ros.network import (
    FIRST_PORT,
    OPEN,
    PORTS,
    PROFILE,
    SWITCH,
    THIS_MACHINE,
    Place,
    limit_to_this_machine,
    occupant,
    require_places,
)
from wam_ros.node import make_node

WIDE_OPEN = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_STATIC_PEERS": "192.0.2.77"}
PARAMETERS = ("--ros-args", "--params-file", str(ROOT / "config" / "wam.yaml"))
PROGRAM = ("-m", "wam_cli.program", "node", "driver", *PARAMETERS)
LOOPBACK = "0100007F"  # as in /proc/net/udp
UNLIMITED = {"FASTRTPS_DEFAULT_PROFILES_FILE": "", "SKIP_DEFAULT_XML_FILE": ""}  # as before the tests limit themselves

# what any ROS program can do, `ros2` for one: it has nothing of ours
STRANGER = """
import sys, time
import rclpy
from rclpy.node import Node
from std_srvs.srv import Trigger
rclpy.init()
node = Node("stranger")
estop = node.create_client(Trigger, "/wam/driver/estop")
end = time.monotonic() + float(sys.argv[1])
while time.monotonic() < end and not estop.service_is_ready():
    rclpy.spin_once(node, timeout_sec=0.05)
if estop.service_is_ready():
    answer = estop.call_async(Trigger.Request())
    rclpy.spin_until_future_complete(node, answer, timeout_sec=10.0)
    print("reached" if answer.done() and answer.result().success else "no answer")
print("saw", [name for name in node.get_node_names() if name != "stranger"])
rclpy.shutdown()
"""


def test_what_was_lost_is_repeated_before_lockstep_calls_it_missing() -> None:
    dds = "{http://www.eprosima.com}"
    (period,) = ElementTree.parse(PROFILE).iter(f"{dds}heartbeatPeriod")
    repeated = int(period.findtext(f"{dds}sec") or 0) + int(period.findtext(f"{dds}nanosec") or 0) * 1e-9
    assert 0.0 < 3.0 * repeated < Configuration.load(packaged("wam")).shared.timing.timeout - DRIVER.roll_call


@pytest.fixture
def programs() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Start programs of this Python, which end with the test; an empty variable of their environment is left out."""
    running: list[subprocess.Popen[str]] = []

    def start(*command: str, before: tuple[str, ...] = (), **environment: str) -> subprocess.Popen[str]:
        everything = {name: value for name, value in {**os.environ, **environment}.items() if value}
        process = subprocess.Popen(
            [*before, sys.executable, "-P", *command],
            env=everything,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        running.append(process)
        return process

    yield start
    for process in running:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def said(process: subprocess.Popen[str]) -> str:
    """The output of a program that ends by itself."""
    return process.communicate(timeout=LONG)[0]


def wait_for_place(domain: int, namespace: str, name: str, process: subprocess.Popen[str]) -> None:
    wait(lambda: occupant(domain, namespace, name) or process.poll() is not None, f"node {name}")
    assert process.poll() is None, said(process)


def bound(domain: int) -> list[tuple[str, int]]:
    """Address and port of each UDP socket that listens for a ROS domain."""
    lines = Path("/proc/net/udp").read_text().splitlines()[1:]
    found = [line.split()[1].split(":") for line in lines]
    ports = range(FIRST_PORT + PORTS * domain, FIRST_PORT + PORTS * (domain + 1))
    return [(address, int(port, 16)) for address, port in found if int(port, 16) in ports]


def test_ros_is_limited_to_this_machine_whatever_the_shell_has_set() -> None:
    environment = {**WIDE_OPEN, "ROS_DISCOVERY_SERVER": "192.0.2.77:11811", "ROS_DOMAIN_ID": "5"}
    limit_to_this_machine(environment)
    assert environment == {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(PROFILE),
        "SKIP_DEFAULT_XML_FILE": "1",
        "ROS_DOMAIN_ID": "5",
    }
    assert PROFILE.is_file()


def test_it_is_opened_on_purpose_only_and_by_one_switch() -> None:
    environment = {**WIDE_OPEN, SWITCH: OPEN}
    limit_to_this_machine(environment)
    assert environment == {**WIDE_OPEN, SWITCH: OPEN}
    with pytest.raises(ParameterError, match=rf"{SWITCH} is 'yes'; allowed: {THIS_MACHINE}, {OPEN}"):
        limit_to_this_machine({SWITCH: "yes"})
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}
    limit_to_this_machine(environment)
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "OFF", "narrower than asked"


@pytest.mark.parametrize("command", [PROGRAM, ("-m", "wam_cli.main", "up")], ids=" ".join)
def test_every_program_listens_on_the_loopback_interface_alone(
    command: tuple[str, ...], programs: Callable[..., subprocess.Popen[str]], domain_id: int
) -> None:
    process = programs(*command, **WIDE_OPEN)
    wait_for_place(domain_id, "/wam", "driver", process)
    assert {address for address, _ in bound(domain_id)} == {LOOPBACK}


@pytest.mark.parametrize(("switch", "addresses"), [(OPEN, {"00000000"}), ("shut", set())])
def test_the_switch_opens_a_program_and_a_wrong_one_ends_it_in_one_sentence(
    switch: str, addresses: set[str], programs: Callable[..., subprocess.Popen[str]], domain_id: int
) -> None:
    process = programs(*PROGRAM, **UNLIMITED, **{SWITCH: switch})
    if addresses:
        wait_for_place(domain_id, "/wam", "driver", process)
        assert {address for address, _ in bound(domain_id)} == addresses
    else:
        assert said(process) == f"error: environment variable {SWITCH} is 'shut'; allowed: {THIS_MACHINE}, {OPEN}\n"


def test_an_ordinary_ros_program_of_this_machine_finds_the_stack(
    programs: Callable[..., subprocess.Popen[str]], domain_id: int
) -> None:
    wait_for_place(domain_id, "/wam", "driver", programs(*PROGRAM))
    plain = {**UNLIMITED, "ROS_AUTOMATIC_DISCOVERY_RANGE": ""}
    assert "reached" in said(programs("-c", STRANGER, str(LONG), **plain))


def ip(*arguments: str) -> str:
    return subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True).stdout


@pytest.fixture
def hosts() -> Iterator[tuple[tuple[str, ...], tuple[str, ...]]]:
    """Two hosts on one network: what to put before a command that shall run there."""
    if not (shutil.which("ip") and shutil.which("unshare")):
        pytest.skip("no two network namespaces here: the programs ip (iproute2) and unshare are missing")
    names = [f"wam{os.getpid()}{letter}" for letter in "ab"]
    holders: list[subprocess.Popen[str]] = []
    try:
        try:
            for name in names:
                ip("netns", "add", name)
            ip("link", "add", "there", "netns", names[0], "type", "veth", "peer", "name", "there", "netns", names[1])
            for number, name in enumerate(names, 1):
                ip("-n", name, "addr", "add", f"10.99.0.{number}/24", "dev", "there")
                for device in ("lo", "there"):
                    ip("-n", name, "link", "set", device, "up")
            # the middleware looks for its interfaces once, when it starts
            wait(lambda: all("state UP" in ip("-n", name, "-o", "link", "show", "there") for name in names), "both up")
        except subprocess.CalledProcessError as error:
            pytest.skip(f"no two network namespaces here: {error.stderr.strip()}")
        # a host has a shared memory of its own
        private = ("unshare", "-m", "sh", "-c", "mount -t tmpfs none /dev/shm && echo mounted && exec cat")
        for name in names:
            holders.append(
                subprocess.Popen(
                    ["ip", "netns", "exec", name, *private], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
                )
            )
            if "mounted" not in next(iter(holders[-1].stdout or []), ""):
                pytest.skip("no two network namespaces here: no /dev/shm of their own")
        first, second = (("nsenter", "-t", str(holder.pid), "-m", "-n") for holder in holders)
        yield first, second
    finally:
        for holder in holders:
            holder.communicate()
        for name in names:
            subprocess.run(["ip", "netns", "del", name], check=False, capture_output=True)


@pytest.mark.parametrize("invited", [False, True])
def test_another_host_reaches_the_stack_only_where_it_was_invited(
    invited: bool, programs: Callable[..., subprocess.Popen[str]], domain_id: int, hosts: tuple[tuple[str, ...], ...]
) -> None:
    here, elsewhere = hosts
    driver = programs(*PROGRAM, before=here, **UNLIMITED, **({SWITCH: OPEN} if invited else {}))
    plain = {**UNLIMITED, "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    if not invited:  # once a stranger on the same host has reached it, it is there
        local = said(programs("-c", STRANGER, str(20.0), before=here, **plain))
        assert "reached" in local, said(driver)
    stranger = programs(
        "-c", STRANGER, str(20.0 if invited else 3.0), before=elsewhere, ROS_STATIC_PEERS="10.99.0.1", **plain
    )
    answer = said(stranger)
    assert "reached" in answer if invited else answer == "saw []\n", (answer, domain_id, driver.poll())
    assert driver.poll() is None, said(driver)


OPERATOR = """
import sys, time
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger
rclpy.init()
node = Node("operator")
seen = {"mode": "", "fault": "", "zero": 0.0, "flow": 0.0}
def take(status):
    if status.name.endswith("driver"):
        values = {pair.key: pair.value for pair in status.values}
        seen.update(mode=values.get("mode", ""), fault=values.get("fault", ""))
def flow(message):
    seen["flow" if any(message.effort) else "zero"] = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
node.create_subscription(DiagnosticStatus, "/wam/status", take, latched)
node.create_subscription(JointState, "/wam/motor_currents", flow, 100)
enable = node.create_client(SetBool, "/wam/driver/enable")
reset = node.create_client(Trigger, "/wam/driver/reset_fault")
def call(client, request):
    answer = client.call_async(request)
    rclpy.spin_until_future_complete(node, answer, timeout_sec=5.0)
    return answer.result() if answer.done() else None
def spin(seconds, until=lambda: False):
    end = time.monotonic() + seconds
    while time.monotonic() < end and not until():
        rclpy.spin_once(node, timeout_sec=0.01)
def bring_up():
    for _ in range(60):
        call(reset, Trigger.Request())
        call(enable, SetBool.Request(data=True))
        spin(0.7)
        if seen["mode"] == "enabled" and seen["flow"] > seen["zero"]:
            return print("enabled", flush=True)
    print("not enabled:", seen, flush=True)
enable.wait_for_service(60.0)
bring_up()
spin(60.0, lambda: seen["mode"] == "fault")
spin(20.0, lambda: seen["zero"] > seen["flow"])
print(f"{seen['mode']} {seen['zero'] > seen['flow']} {seen['fault']}", flush=True)
sys.stdin.readline()
flowed = seen["flow"]
spin(1.0)
answer = call(enable, SetBool.Request(data=True))
spin(0.5)
print(seen["mode"], seen["flow"] == flowed, answer is not None and answer.success, flush=True)
bring_up()
rclpy.shutdown()
"""


def test_a_link_that_is_cut_brakes_by_name_and_the_operator_alone_ends_the_fault(
    programs: Callable[..., subprocess.Popen[str]], domain_id: int, hosts: tuple[tuple[str, ...], ...], tmp_path: Path
) -> None:
    here, elsewhere = hosts
    file = tmp_path / "realtime.yaml"
    realtime = {"timing.mode": "realtime", "driver:late_periods": 1.0}  # a busy machine is no obstacle
    file.write_text(Configuration.load(packaged("wam")).with_values(realtime).text)
    opened = {**UNLIMITED, SWITCH: OPEN, "ROS_STATIC_PEERS": "10.99.0.1;10.99.0.2"}
    node = ("-m", "wam_cli.program", "node")
    programs(*node, "driver", "--ros-args", "--params-file", str(file), before=here, **opened)
    rest = ("transform", "velocity_loop", "gravity", "force_loop", "contact_estimator")
    programs(*node, *rest, "--ros-args", "--params-file", str(file), before=elsewhere, **opened)
    operator = programs("-c", OPERATOR, before=here, **opened, ROS_AUTOMATIC_DISCOVERY_RANGE="SUBNET")
    assert operator.stdout
    assert operator.stdin
    assert (line := operator.stdout.readline()) == "enabled\n", line + operator.stdout.read()
    subprocess.run([*here, "ip", "link", "set", "there", "down"], check=True)
    time.sleep(1.0)
    subprocess.run([*here, "ip", "link", "set", "there", "up"], check=True)
    mode, without_current, fault = operator.stdout.readline().strip().split(maxsplit=2)
    assert (mode, without_current) == ("fault", "True"), fault
    # the driver misses the command; on a loaded machine the velocity loop may miss its own before the link is cut
    assert fault.startswith(("command stale", "velocity_loop: transform has stopped"))
    assert "velocity_loop" in fault
    print("go on", file=operator.stdin, flush=True)
    assert operator.stdout.readline() == "fault True False\n", "the arm is enabled again only after reset_fault"
    assert operator.stdout.readline() == "enabled\n"


def test_a_second_stack_is_refused_in_one_sentence_before_it_starts_anything(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], domain_id: int
) -> None:
    from wam_cli.main import main

    place = Place(domain_id, "/wam", "velocity_loop")
    for command in (["conform", "--running"], ["up"]):
        with pytest.raises(SystemExit) as ended:
            main(command)
        assert ended.value.code == 1
    place.close()
    alone, line = capsys.readouterr().err.splitlines()
    assert (
        f"node 'velocity_loop' already runs in namespace /wam of ROS domain {domain_id} (process {os.getpid()})" in line
    )
    assert "stop it, or use another ROS_DOMAIN_ID" in line
    assert "takes the place of velocity_loop; stop the stack, then start the driver alone: wam node driver" in alone
    require_places(["velocity_loop"], "wam")


@pytest.mark.parametrize(("name", "more", "text"), [
    ("driver", (), r"node 'driver' already runs in namespace /wam .* \(process \d+\); stop it"),
    ("driver", ("-r", "__node:=other"), r"node 'other', section '/\*\*/other' .*: missing parameter"),
])  # fmt: skip
def test_a_node_that_runs_already_or_was_renamed_is_refused(
    name: str, more: tuple[str, ...], text: str, ros: Any
) -> None:
    with closing(Place(ros.domain_id, "/wam", "driver")), pytest.raises(ParameterError, match=text):
        make_node(name, context=ros.context, namespace="/wam", cli_args=[*PARAMETERS, *more])


def test_enforced_security_without_the_middleware_s_part_for_it_ends_a_node_in_one_line(
    programs: Callable[..., subprocess.Popen[str]], domain_id: int, tmp_path: Path
) -> None:
    enclave = tmp_path / "enclaves" / "wam"
    enclave.mkdir(parents=True)
    settings = {
        "ROS_SECURITY_ENABLE": "true",
        "ROS_SECURITY_STRATEGY": "Enforce",
        "ROS_SECURITY_KEYSTORE": str(tmp_path),
        "ROS_SECURITY_ENCLAVE_OVERRIDE": "/wam",
    }
    process = programs(*PROGRAM, **settings)
    text = said(process)
    assert process.returncode == 1
    assert "Traceback" not in text, text
    assert ": error creating node: This Fast DDS version doesn't have the security libraries" in text, text
