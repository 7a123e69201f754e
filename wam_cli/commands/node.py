"""`wam node`: one node, or several, as a process."""

import argparse

from wam_cli.options import configuration_of, take_configuration
from wam_ros.node import node_makers, parameter_file
from wam_ros.process_signals import end_at_once_on_signals
from wam_ros.run import run as run_node

TAKES_ROS_ARGUMENTS = True


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam node` to its parser; the rest of the line is ROS's."""
    known = "driver, transform, velocity_loop, gravity, force_loop, ...; several share one process"
    parser.add_argument("name", nargs="+", help=known)
    parser.usage = "wam node [OPTION...] NAME... [ROS ARGUMENT...]"
    parser.epilog = "ROS arguments are for example: -p timing.mode:=lockstep -r __ns:=/left"
    take_configuration(parser)


def run(given: argparse.Namespace) -> int:
    """Run the nodes until they are stopped."""
    end_at_once_on_signals()  # until run_node handles them; an exception would break the import of the node
    makers = node_makers(given.name)
    with parameter_file(configuration_of(given)) as file:
        run_node(makers, ["wam", "--ros-args", "--params-file", str(file), *given.ros])
    return 0
