"""`wam model`: the arm's model, printed for other programs."""

import argparse

from wam_cli.commands import configuration_of, take_configuration
from wam_description.effects import Effects
from wam_description.mjcf import mjcf
from wam_description.parameters import build_part
from wam_description.urdf import urdf
from wam_description.world import World


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("format", choices=("urdf", "mjcf"))
    take_configuration(parser)


def run(given: argparse.Namespace) -> int:
    """Print the model."""
    configuration = configuration_of(given)
    shared = configuration.shared
    if given.format == "urdf":
        print(urdf(shared.arm))
        return 0

    section = configuration.sections["driver"]
    world, effects = build_part(World, section, "world."), build_part(Effects, section, "effects.")
    print(mjcf(shared.arm, shared.timing.substep, world, effects))
    return 0
