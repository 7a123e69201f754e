"""`wam record`: every topic of a running stack into a bag."""

import argparse
from pathlib import Path

from wam_cli.commands import configuration_of, namespace, new_bag, take_configuration, writable_directory
from wam_description.arm import Shared
from wam_description.configuration import Configuration, option_values
from wam_description.interface import Interface
from wam_description.parameters import values
from wam_ros.bring_up import parameter_file
from wam_ros.call import CalledStack
from wam_ros.node import node_makers
from wam_ros.recorder_interface import RecorderInterface
from wam_ros.run import run as run_node
from wam_ros.topics import NAMESPACE

RECORDER = RecorderInterface.name


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--name", default="", help="name of the bag; default: arm, date and time")
    parser.add_argument("--directory", help="directory for the bag, instead of that of the configuration")
    parser.add_argument("--namespace", type=namespace, default=NAMESPACE, help="of the stack; default: %(default)s")
    take_configuration(parser)
    parser.epilog = (
        "Time, nodes and arm are those of the running stack; of --config and --set, only the parameters of the node "
        "recorder are used."
    )


def run(given: argparse.Namespace) -> int:
    """Record until Ctrl-C."""
    for name in option_values(given.values):
        if not name.startswith(f"{RECORDER}:"):
            raise ValueError(
                f"--set {name} has no effect here: the running stack has its own; "
                f"give parameters of the recorder alone, as --set {RECORDER}:split_time=60.0"
            )
    own = {f"{RECORDER}:name": given.name}
    if given.directory:
        own[f"{RECORDER}:directory"] = given.directory
    configuration = configuration_of(given).with_values(own)
    directory = Path(str(configuration.sections[RECORDER]["directory"]))
    writable_directory("--directory", directory)
    if given.name:
        new_bag(directory / given.name)
    with CalledStack(given.namespace) as stack:
        shared = stack.shared()
    nodes = [name for name in Interface(shared).names if name != RECORDER]
    print(f"the stack in /{given.namespace} runs in {shared.timing.mode}: {', '.join(nodes)}", flush=True)
    with parameter_file(_of_stack(configuration, shared)) as file:
        where = f"__ns:=/{given.namespace}"
        run_node(node_makers([RECORDER]), ["wam", "--ros-args", "--params-file", str(file), "-r", where])
    return 0


def _of_stack(configuration: Configuration, shared: Shared) -> Configuration:
    """The configuration with the shared parameters of a running stack, of which this recorder is no part."""
    nodes = [entry for entry in shared.nodes if entry != RECORDER]
    return configuration.with_values({**values(shared), "nodes": nodes})
