"""`wam map`: the stability map of figure 5.8 as a table."""

import argparse
from pathlib import Path

import numpy as np

from wam_cli.commands import TABLE, at_least, batch_of, rising, take_batch, writable_file
from wam_studies.stability.stability_map import stability_map, write_csv


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("file", type=Path, help="table to write, for example map.csv")
    for name, ends, count in (("gamma", (1.02, 3.0), 100), ("zeta", (0.05, 1.0), 100)):
        parser.add_argument(
            f"--{name}", nargs=2, type=float, metavar=("LOW", "HIGH"), default=ends, help=f"default: {ends}"
        )
        parser.add_argument(f"--{name}-points", type=int, metavar="N", default=count, help=f"default: {count}")
    parser.add_argument("--stiffness-ratio", type=float, default=1.0, help="k_tr/k_c; default: %(default)s")
    parser.add_argument("--stiction", type=float, default=1.0, help="F_static/F_dynamic; default: %(default)s")
    take_batch(parser, "map")


def run(given: argparse.Namespace) -> int:
    """Compute, write the table."""
    for name, ends, count in (("gamma", given.gamma, given.gamma_points), ("zeta", given.zeta, given.zeta_points)):
        at_least(f"--{name}-points", count, 1)
        rising(f"--{name}", ends)
    writable_file("FILE", given.file, TABLE)
    gamma = np.linspace(given.gamma[0], given.gamma[1], given.gamma_points)
    zeta = np.asarray(np.geomspace(given.zeta[0], given.zeta[1], given.zeta_points), dtype=float)
    with batch_of(given, len(zeta)) as batch:
        found = stability_map(gamma, zeta, given.stiffness_ratio, given.stiction, *batch)
    write_csv(found, given.file)
    print(f"{found.steps.size} points in {given.file}")
    return 0
