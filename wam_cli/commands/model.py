"""`wam model`: the arm of a configuration, printed for other programs or compared with the thesis's requisites."""

import argparse

from wam_cli.options import configuration_of, namespace, take_configuration
from wam_description.effects import Effects
from wam_description.mjcf import mjcf
from wam_description.parameters import build_part
from wam_description.urdf import urdf
from wam_description.world import World


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam model` to its parser."""
    parser.add_argument(
        "format",
        choices=("urdf", "mjcf", "scorecard"),
        help="urdf, mjcf: the arm in this format; scorecard: a table of the arm and the requirements of chapter 3",
    )
    parser.add_argument(
        "--ros2-control",
        type=namespace,
        metavar="NAMESPACE",
        help="URDF with the tag <ros2_control>, for the arm in this namespace",
    )
    take_configuration(parser)


def run(given: argparse.Namespace) -> int:
    """Print the model or the table."""
    if given.ros2_control and given.format != "urdf":
        raise ValueError("--ros2-control adds a tag to the URDF; call: wam model urdf --ros2-control NAMESPACE")
    configuration = configuration_of(given)
    shared = configuration.shared
    if given.format == "scorecard":
        from wam_studies.scorecard import report  # its thesis has slow imports

        print(report(configuration), end="")
    elif given.format == "urdf":
        print(urdf(shared.arm, given.ros2_control))
    else:
        section = configuration.sections["driver"]
        world, effects = build_part(World, section, "world."), build_part(Effects, section, "effects.")
        print(mjcf(shared.arm, shared.timing.substep, world, effects))
    return 0
