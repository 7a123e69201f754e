"""`wam node`: one node by hand."""

import argparse

from wam_description.parameters import ParameterError
from wam_ros.bring_up import MODULES, node_class
from wam_ros.commands import configuration_of, take_configuration
from wam_ros.run import run as run_node

TAKES_ROS_ARGUMENTS = True


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command; the rest of the line is ROS's."""
    parser.add_argument("name", help="driver, transform, velocity_loop, gravity, force_loop, contact_estimator, ...")
    parser.usage = "wam node [-h] [--config CONFIG] name [ROS argument ...]"
    parser.epilog = "ROS arguments are for example: -p timing.mode:=lockstep -r __ns:=/left"
    take_configuration(parser)


def run(given: argparse.Namespace) -> int:
    """Run the node until it is stopped."""
    if given.name not in MODULES:
        raise ParameterError(f"no node is named '{given.name}'; nodes: {', '.join(MODULES)}")
    configuration = configuration_of(given)
    run_node(node_class(given.name), ["wam", "--ros-args", "--params-file", str(configuration.path), *given.ros])
    return 0
