"""The commands of `wam`, a module each: `arguments(parser)` and `run(given)`, which returns the exit code.

Here is what several of them take.
"""

import argparse
from pathlib import Path

from wam_description.configuration import Configuration, packaged

BASE_CONFIGURATION = "wam"


def take_configuration(parser: argparse.ArgumentParser) -> None:
    """Give a command the option --config."""
    parser.add_argument(
        "--config", default=BASE_CONFIGURATION, help="configuration: a YAML file, or the name of one that is installed"
    )


def configuration_of(given: argparse.Namespace) -> Configuration:
    """The configuration that --config names."""
    name: str = given.config
    return Configuration.load(Path(name) if name.endswith((".yaml", ".yml")) else packaged(name))
