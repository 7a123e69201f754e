"""A sweep: press with many force gains on the testbed, on all cores, and draw what each does.

    python3 examples/sweep.py --gains 100 --picture sweep.png

The stability guard is off, so that unstable gains are shown, too; a line shows the largest gain that it accepts.
"""

import argparse
import sys
from typing import NamedTuple

import numpy as np

from wam_control.force.force_loop import ForceLoop, ForceLoopParameters
from wam_control.task.scenario import ScenarioStep
from wam_description.configuration import Configuration, packaged
from wam_description.signals import ForceCommand
from wam_sim.batch import processes, results
from wam_sim.progress import Progress
from wam_sim.simulation import Simulation

NEWTONS, LARGEST = 10.0, 0.2  # commanded force, N, and largest gain, m/s/N
TASK = [
    ScenarioStep("release", 0.3, request="enable"),
    ScenarioStep("press", 2.0, force=ForceCommand("link", (0.0, -NEWTONS, 0.0))),
]


class Press(NamedTuple):
    """What one gain does: the largest force, and half of the range in the last half second, N."""

    gain: float
    peak: float
    ripple: float


def press(gain: float) -> Press:
    """Press once; a function of its input alone, so that any process can run it."""
    values = {"force_loop:force_gain": [gain], "force_loop:guard.mode": "off"}
    run = Simulation(Configuration.load(packaged("testbed")).with_values(values), TASK)
    run.play()  # the driver stops an arm that oscillates too much; what was reached until then counts
    force = -np.array([row.values[1] for row in run.rows["force_measured"]])
    last = force[-26:-1]  # outer periods of 20 ms; with the last one the command has ended
    return Press(gain, float(force.max()), float(np.ptp(last)) / 2.0)


def largest_stable_gain() -> float:
    """The gain to which the guard lowers a larger one, m/s/N; it knows nothing of the simulation."""
    values = {"force_loop:force_gain": [LARGEST], "force_loop:guard.mode": "limit"}
    configuration = Configuration.load(packaged("testbed")).with_values(values)
    shared, parameters = configuration.shared, configuration.node("force_loop", ForceLoopParameters)
    return ForceLoop(shared.arm, shared.servo, parameters, shared.timing).parameters.force_gain[0]


def main() -> None:
    """Compute, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gains", type=int, default=100, help="default: %(default)s")
    parser.add_argument("--picture", default="sweep.png", help="default: %(default)s")
    given = parser.parse_args()
    gains = np.geomspace(0.002, LARGEST, given.gains).tolist()
    with processes() as executor:
        found = results(press, gains, executor, report=Progress("sweep", sys.stderr))
    steady = [row.gain for row in found if row.ripple < 0.1 * NEWTONS]
    limit = largest_stable_gain()
    print(f"at rest after 2 s up to a gain of {max(steady, default=0.0):.3g} m/s/N")
    print(f"stable by the guard up to a gain of {limit:.3g} m/s/N")
    draw(found, limit, given.picture)


def draw(found: list[Press], limit: float, file: str) -> None:
    """Peak and ripple over the gain, and the guard's limit."""
    import matplotlib as mpl

    mpl.use("agg")
    from matplotlib import pyplot

    from wam_analysis.drawing import PREDICTED, SHAFTS, STYLE

    mpl.rcParams.update(STYLE)
    figure, axes = pyplot.subplots(figsize=(6.4, 3.4), layout="constrained")
    gains = [row.gain for row in found]
    axes.loglog(gains, [row.peak / NEWTONS for row in found], ".-", color=SHAFTS[0], label="largest force")
    axes.loglog(
        gains, [max(row.ripple, 1e-3) / NEWTONS for row in found], ".-", color=SHAFTS[1], label="ripple at the end"
    )
    axes.axvline(limit, color=PREDICTED, linestyle=":", label="largest gain that the guard accepts")
    axes.set(xlabel="force gain [m/s/N]", ylabel="over the commanded force")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    figure.savefig(file, dpi=150)
    print(file)


if __name__ == "__main__":
    main()
