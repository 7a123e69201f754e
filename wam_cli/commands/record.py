"""`wam record`: every topic of a running stack into a bag."""

import argparse
from pathlib import Path

from wam_cli.commands import configuration_of, new_bag, take_configuration, writable_directory
from wam_ros.bring_up import parameter_file
from wam_ros.node import node_makers
from wam_ros.run import run as run_node


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--name", default="", help="name of the bag; default: arm, date and time")
    parser.add_argument("--directory", help="directory for the bag, instead of that of the configuration")
    take_configuration(parser)


def run(given: argparse.Namespace) -> int:
    """Record until Ctrl-C."""
    values = {"recorder:name": given.name}
    if given.directory:
        values["recorder:directory"] = given.directory
    configuration = configuration_of(given).with_values(values)
    directory = Path(str(configuration.sections["recorder"]["directory"]))
    writable_directory("--directory", directory)
    if given.name:
        new_bag(directory / given.name)
    with parameter_file(configuration) as file:
        run_node(node_makers(["recorder"]), ["wam", "--ros-args", "--params-file", str(file)])
    return 0
