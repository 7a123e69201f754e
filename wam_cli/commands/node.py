"""`wam node`: one node, or several, as a process."""

import argparse

from wam_cli.options import BASE_CONFIGURATION, configuration_of, take_configuration
from wam_description.interface import declared
from wam_ros.node import node_makers, parameter_file
from wam_ros.process_signals import end_at_once_on_signals
from wam_ros.run import run as run_node

TAKES_ROS_ARGUMENTS = True
PARAMETERS = "--params-file"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam node` to its parser; the rest of the line is ROS's."""
    known = "driver, transform, velocity_loop, gravity, force_loop, ...; several share one process"
    parser.add_argument("name", nargs="+", help=known)
    parser.usage = "wam node [OPTION...] NAME... [ROS ARGUMENT...]"
    parser.epilog = (
        "ROS arguments are for example: -p timing.mode:=lockstep -r __ns:=/left.  A --params-file takes the place of "
        "the packaged configuration."
    )
    take_configuration(parser)


def run(given: argparse.Namespace) -> int:
    """Run the nodes until they are stopped."""
    end_at_once_on_signals()  # until run_node handles them; an exception would break the import of the node
    configuration = configuration_of(given)
    own_nodes = {declared(entry).name: entry for entry in configuration.shared.nodes if ":" in entry}
    makers = node_makers(own_nodes.get(name, name) for name in given.name)
    is_of_ros = PARAMETERS in given.ros and given.config == BASE_CONFIGURATION and not given.values
    with parameter_file(configuration) as file:
        own = [] if is_of_ros else [PARAMETERS, str(file)]
        if failure := run_node(makers, ["wam", "--ros-args", *own, *given.ros]):
            raise SystemExit(f"error: {failure}")
    return 0
