"""The command `wam`: everything of the stack that is started from a shell."""

import argparse
import importlib
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError

# commands that need no ROS; named here and imported when called, because ROS glue knows no analysis
ANALYSES = {"report": "wam_analysis.demo_report:report", "plant": "wam_analysis.plant_figure:figure"}
BASE_CONFIGURATION = "wam"
REQUESTS = {  # of the command `call`: node, service, and the value where it is a switch
    "enable": ("driver", "enable", True),
    "disable": ("driver", "enable", False),
    "estop": ("driver", "estop", None),
    "reset_fault": ("driver", "reset_fault", None),
    "reset": ("driver", "reset", None),
    "tare": ("force_loop", "tare", None),
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; exits with 0 where all went well."""
    parser = _parser()
    given, rest = parser.parse_known_args(arguments)
    if rest and given.run is not _node:
        parser.error(f"unrecognized arguments: {' '.join(rest)}")
    given.ros = rest
    try:
        code = given.run(given)
    except (ParameterError, ValueError, OSError) as error:
        parser.exit(1, f"wam {given.command}: {error}\n")
    except KeyboardInterrupt:
        code = 130
    sys.exit(code or 0)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="wam",
        description="Force control of the cable-driven MIT/WAM arm, simulated down to its motor shafts.",
        epilog="Start with: wam demo.  With ROS 2 sourced, 'ros2 run wam_stack <node>' works as well.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    demo = _command(commands, "demo", _demo, "play the demonstration, record it, say how well it went")
    demo.add_argument("--lockstep", action="store_true", help="as fast as it goes and the same every time")
    demo.add_argument("--name", default="", help="name of the bag; default: demo, date and time")
    _configured(demo)

    up = _command(commands, "up", _up, "start the nodes and leave them running until Ctrl-C")
    up.add_argument("--mode", choices=("realtime", "lockstep"), help="clockwork, instead of the configuration's")
    up.add_argument("--scenario", default="", help="play this scenario (YAML file, or demo_scenario)")
    up.add_argument("--record", action="store_true", help="record every topic")
    _configured(up)

    node = _command(commands, "node", _node, "start one node by hand, with ROS arguments if need be")
    node.add_argument("name", help="driver, transform, velocity_loop, gravity, force_loop, contact_estimator, ...")
    node.usage = "wam node [-h] [--config CONFIG] name [ROS argument ...]"
    node.epilog = "ROS arguments are for example: -p timing.mode:=lockstep -r __ns:=/left"
    _configured(node)

    record = _command(commands, "record", _record, "record every topic of a running stack until Ctrl-C")
    record.add_argument("--name", default="", help="name of the bag; default: arm, date and time")
    record.add_argument("--directory", help="where the bag goes, instead of the configuration's")
    _configured(record)

    report = _command(commands, "report", _report, "say what a recording of the demonstration shows")
    report.add_argument("bag", help="directory of the bag")

    call = _command(commands, "call", _call, f"ask a running stack: {', '.join(REQUESTS)}")
    call.add_argument("request", choices=tuple(REQUESTS))
    call.add_argument("--namespace", default="wam", help="namespace of the stack, default wam")

    plant = _command(commands, "plant", _plant, "draw the plant's effects beside the theory, print the differences")
    plant.add_argument("file", help="picture to write, for example plant.png")

    model = _command(commands, "model", _model, "write the arm's model")
    model.add_argument("format", choices=("urdf", "mjcf"))
    _configured(model)
    return parser


def _command(commands: Any, name: str, run: Any, text: str) -> argparse.ArgumentParser:
    command: argparse.ArgumentParser = commands.add_parser(name, help=text, description=text.capitalize() + ".")
    command.set_defaults(run=run)
    return command


def _configured(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--config", default=BASE_CONFIGURATION, help="configuration: a YAML file, or the name of one that is installed"
    )


def _configuration(given: argparse.Namespace) -> Configuration:
    name: str = given.config
    return Configuration.load(Path(name) if name.endswith((".yaml", ".yml")) else packaged(name))


def _demo(given: argparse.Namespace) -> int:
    from wam_ros.bring_up import Composition, Processes
    from wam_ros.run import Stop

    stop = Stop()
    base = _configuration(given)
    name = given.name or f"demo_{time.strftime('%Y-%m-%d_%H-%M-%S')}"
    configuration = base.with_values(
        {
            "nodes": [*base.shared.nodes, "scenario", "recorder"],
            "timing.mode": "lockstep" if given.lockstep else "realtime",
            "recorder:name": name,
        }
    )
    bag = Path(str(configuration.sections["recorder"]["directory"])) / name
    if given.lockstep:
        with Composition(configuration) as composition:
            scenario: Any = composition.nodes["scenario"]
            composition.spin(lambda: stop.is_set or scenario.done)
            failure = scenario.failure
    else:
        with Processes(configuration) as processes:
            ended = processes.wait(lambda ended: stop.is_set or bool(ended))
        failure = ", ".join(f"node {node} ended with code {code}" for node, code in ended.items() if code)
    if stop.is_set:
        print(f"stopped; what was recorded until then is in {bag}" if bag.exists() else "stopped before anything moved")
        return 130
    if failure:
        print(f"the demonstration failed: {failure}", file=sys.stderr)
        return 1
    return _analysis("report", bag)


def _up(given: argparse.Namespace) -> int:
    from wam_ros.bring_up import Processes
    from wam_ros.run import Stop

    stop = Stop()
    configuration = _configuration(given)
    extra = ["scenario"] * bool(given.scenario) + ["recorder"] * given.record
    configuration = configuration.with_values({"nodes": [*configuration.shared.nodes, *extra]})
    if given.mode:
        configuration = configuration.with_values({"timing.mode": given.mode})
    if given.scenario:
        configuration = configuration.with_values({"scenario:script": given.scenario})
    with Processes(configuration) as processes:
        print(f"{len(configuration.shared.nodes)} nodes started; Ctrl-C stops them", flush=True)
        ended = processes.wait(lambda ended: stop.is_set or bool(ended))
    for node, code in ended.items():
        print(f"node {node} ended with code {code}; all were stopped", file=sys.stderr)
    return max([abs(code) for code in ended.values()], default=0)


def _node(given: argparse.Namespace) -> int:
    from wam_ros.bring_up import MODULES, node_class
    from wam_ros.run import run

    if given.name not in MODULES:
        raise ParameterError(f"no node is named '{given.name}'; nodes: {', '.join(MODULES)}")
    configuration = _configuration(given)
    run(node_class(given.name), ["wam", "--ros-args", "--params-file", str(configuration.path), *given.ros])
    return 0


def _record(given: argparse.Namespace) -> int:
    from wam_ros.bring_up import node_class, parameter_file
    from wam_ros.run import run

    values = {"recorder:name": given.name}
    if given.directory:
        values["recorder:directory"] = given.directory
    configuration = _configuration(given).with_values(values)
    with parameter_file(configuration) as file:
        run(node_class("recorder"), ["wam", "--ros-args", "--params-file", str(file)])
    return 0


def _call(given: argparse.Namespace) -> int:
    from wam_ros.call import call

    node, service, switch = REQUESTS[given.request]
    answer = call(f"/{given.namespace.strip('/')}/{node}/{service}", switch)
    print(answer.message)
    return 0 if answer.success else 1


def _plant(given: argparse.Namespace) -> int:
    return _analysis("plant", Path(given.file))


def _report(given: argparse.Namespace) -> int:
    return _analysis("report", Path(given.bag))


def _analysis(name: str, *arguments: Any) -> int:
    module, function = ANALYSES[name].split(":")
    text = getattr(importlib.import_module(module), function)(*arguments)
    print(text)
    return 0


def _model(given: argparse.Namespace) -> int:
    from wam_description.effects import Effects
    from wam_description.mjcf import mjcf
    from wam_description.parameters import build
    from wam_description.urdf import urdf
    from wam_description.world import World

    configuration = _configuration(given)
    shared = configuration.shared
    if given.format == "urdf":
        print(urdf(shared.arm))
        return 0

    def part(prefix: str) -> dict[str, Any]:
        section = configuration.sections["driver"]
        return {key.removeprefix(prefix): value for key, value in section.items() if key.startswith(prefix)}

    world, effects = build(World, part("world.")), build(Effects, part("effects."))
    print(mjcf(shared.arm, shared.timing.substep, world, effects))
    return 0


if __name__ == "__main__":
    main()
