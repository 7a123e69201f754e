"""`wam conform`: a driver, tested against the contract of docs/driver.md."""

import argparse
import shlex
import time
from contextlib import ExitStack
from multiprocessing import get_context

from wam_cli.options import COUNT, bounded, configuration_of, take_configuration, take_stack
from wam_description.configuration import Configuration
from wam_description.interface import declared
from wam_description.parts import Motors
from wam_driver.bus.bus_parameters import BusParameters
from wam_driver.bus.dry_run import heard, sent
from wam_driver.bus.line import answer, line_of
from wam_driver.bus.simulator import SimulatedBus
from wam_driver.thresholds import BUS
from wam_ros.bring_up import NodeProcess
from wam_ros.conformance import NOT_TESTED, OK, WRONG, conformance_rows
from wam_ros.driver_bench import DriverBench
from wam_ros.network import occupant, requested_domain, require_places
from wam_ros.priority import set_priority
from wam_theory.rounding import rounded_down


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam conform` to its parser."""
    take_configuration(parser)
    take_stack(parser)
    parser.add_argument(
        "--bus",
        default="",
        metavar="CHANNEL",
        help="bus of a real arm: can0, or INTERFACE:CHANNEL of python-can; simulated:200 simulates a bus with firmware "
        "200",
    )
    parser.add_argument(
        "--arm",
        type=COUNT,
        default=0,
        metavar="VERSION",
        help="first start a simulated arm with this firmware, e.g. 200, as another process on the bus that --bus "
        "names, e.g. udp_multicast:239.74.163.2",
    )
    parser.add_argument(
        "--dry-run",
        type=bounded(float, 0.1, 3600.0, "s"),
        metavar="SECONDS",
        help="no test: listen to the bus for SECONDS, send nothing, then print what the driver would send",
    )
    parser.add_argument(
        "--running",
        action="store_true",
        help="test a driver that already runs, without the stack; if none runs, this prints how to start it",
    )
    parser.add_argument(
        "--current",
        type=bounded(float, unit="A"),
        default=0.4,
        metavar="A",
        help="test current of the first motor, A; its sign sets the direction; it is added to the current that carries "
        "the links; default: %(default)s",
    )
    parser.add_argument(
        "--share",
        type=bounded(float, 0.0, 1.0),
        default=0.9,
        metavar="FRACTION",
        help="fraction of the periods in which the driver must publish a state; default: %(default)s",
    )
    parser.add_argument(
        "--attempts",
        type=COUNT,
        default=5,
        metavar="N",
        help="how often a check that fails is tried; on a busy computer more may be needed; default: %(default)s",
    )
    parser.epilog = (
        "The test enables the driver many times, and small currents flow. On a real arm, keep its range clear and "
        "a hand on the emergency stop."
    )


def run(given: argparse.Namespace) -> int:
    """Test a driver and print the rows of the contract as they are found; 1 where one is wrong."""
    configuration = configuration_of(given)
    if (given.bus or given.dry_run) and "interface" not in configuration.sections.get("driver", {}):
        raise ValueError(
            "--bus and --dry-run are for a driver on a bus; give its configuration, for example --config "
            "barrett-wam4-bus"
        )
    configuration = driver_alone(on_bus(configuration, given.bus))
    if given.dry_run:
        return _listen(configuration, given.dry_run)
    _require_rated(given.current, configuration.shared.arm.motors)
    entry = configuration.shared.nodes[0]
    values = *given.values, "timing.mode=realtime", f"nodes=[{entry},velocity_loop]"
    words = ["--config", given.config, *(f"--set={value}" for value in values), "-r", f"__ns:=/{given.namespace}"]
    cure = f"start the driver alone: wam node driver {shlex.join(words)}"
    if not given.running:
        require_places(["driver", "velocity_loop"], given.namespace)
    elif occupant(requested_domain(), f"/{given.namespace}", "velocity_loop"):
        raise ValueError(f"wam conform takes the place of velocity_loop; stop the stack, then {cure}")
    counts = {OK: 0, WRONG: 0, NOT_TESTED: 0}
    with DriverBench(configuration.shared, given.share, given.current, given.namespace) as bench, ExitStack() as ending:
        if given.arm:  # a process of its own
            arm = get_context("spawn").Process(target=_serve, args=(configuration, given.arm), daemon=True)
            arm.start()
            ending.callback(arm.terminate)
        if given.running and not bench.wait(lambda: bench.is_published("motor_states")):
            raise ValueError(f"no driver publishes /{given.namespace}/motor_states; {cure}")
        timing = configuration.shared.timing
        set_priority(max(timing.fifo_priority - 1, 0), timing.niceness)  # as the velocity loop, behind the driver
        print(f"driver under test: {entry}; it logs the faults that this test causes")

        drivers: list[NodeProcess] = []

        def start() -> None:
            drivers.append(NodeProcess(configuration, [entry], given.namespace))
            ending.callback(drivers[-1].close)

        def look_after() -> None:
            if drivers and (code := drivers[-1].poll()) is not None:
                raise ValueError(f"the driver has ended, with exit code {code}; correct what it has printed")

        if not given.running:
            start()
            bench.end, bench.restart, bench.look_after = lambda: drivers.pop().close(), start, look_after
        for row in conformance_rows(bench, given.attempts):
            counts[row.verdict] += 1
            print(row.text, flush=True)
    print(", ".join(f"{count} {verdict}" for verdict, count in counts.items()))
    return int(counts[WRONG] > 0)


def _require_rated(current: float, motors: Motors) -> None:
    name, rated = motors.names[0], rounded_down(motors.continuous_torque[0] / motors.torque_constant[0])
    if current > rated:
        raise ValueError(f"--current is {current:g} A; allowed: 0 to {rated:g} A, the rated current of {name}")


def _serve(configuration: Configuration, version: int) -> None:
    """Be the arm on the bus of a configuration, as prompt as the driver."""
    shared, own = configuration.shared, configuration.node("driver", BusParameters)
    set_priority(shared.timing.fifo_priority, shared.timing.niceness)
    line, arm = line_of(shared, own, time), SimulatedBus(shared, own, version)
    while True:
        answer(line, arm, shared.timing.period)


def _listen(configuration: Configuration, seconds: float) -> int:
    """Print what is on the bus, and what the driver would send."""
    own = configuration.node("driver", BusParameters)
    line = line_of(configuration.shared, own, time)
    print(f"heard on {own.interface} {own.channel} within {seconds:g} s, while this program sent nothing:", flush=True)
    try:
        print(*heard(line, seconds), sep="\n")
    finally:
        line.close()
    version = BUS.described_firmware
    print(f"\nwhat the driver would send to an arm with firmware {version}, and how often:")
    print(*sent(configuration.shared, own, version), sep="\n")
    return 0


def driver_alone(configuration: Configuration) -> Configuration:
    """A configuration with its driver and a velocity loop only, in realtime on any computer: the driver is tested."""
    drivers = [entry for entry in configuration.shared.nodes if declared(entry).name == "driver"]
    if not drivers:
        raise ValueError(
            "no entry of the parameter 'nodes' is a driver; list one, for example 'driver' or 'my_module:MyDriver'"
        )
    bold = {"driver:late_periods": 1.0} if "late_periods" in configuration.sections.get("driver", {}) else {}
    return configuration.with_values({"nodes": [drivers[0], "velocity_loop"], "timing.mode": "realtime", **bold})


def on_bus(configuration: Configuration, bus: str) -> Configuration:
    """A configuration with another bus, 'CHANNEL' of socketcan or 'INTERFACE:CHANNEL'; for '' as it is."""
    if not bus:
        return configuration
    interface, _, channel = bus.rpartition(":")
    return configuration.with_values({"driver:interface": interface or "socketcan", "driver:channel": channel})
