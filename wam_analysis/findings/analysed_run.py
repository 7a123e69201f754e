"""A bag prepared for analysis: its run, parameters, signals and the constant forces that were commanded."""

from functools import cached_property

from wam_analysis.demo_summary import DemoSummary, failure_of, summary_of
from wam_analysis.findings.held_force import HeldForce, Theory, held_forces, theory_of
from wam_analysis.recorded import PredictionParameters, prediction_parameters
from wam_bag.bag import Bag
from wam_bag.losses import CUT
from wam_sim.recording import RecordedRun, recorded_run


class AnalysedRun:
    """What the analyses take from a bag; everything is evaluated when it is asked for.

    Parameters
    ----------
    run : of the bag.
    is_foreign : whether it is a recording of another robot.
    """

    def __init__(self, run: RecordedRun, is_foreign: bool = False) -> None:
        self.run = run
        self.is_foreign = is_foreign

    @cached_property
    def summary(self) -> DemoSummary:
        """Forces and contacts over time, holds, reactions and losses."""
        return summary_of(self.run)

    @cached_property
    def parameters(self) -> PredictionParameters:
        """What predictions need, as far as the bag has it."""
        return prediction_parameters(self.run.parameters)

    @cached_property
    def held(self) -> tuple[HeldForce, ...]:
        """Each commanded force, and how it was reached and held."""
        return held_forces(self)

    @cached_property
    def theories(self) -> dict[str, Theory]:
        """What is predicted for each of them, by name; nothing where it was refused."""
        return {one.hold.name: Theory() if one.hold.is_refused else theory_of(self, one) for one in self.held}

    @property
    def bag(self) -> Bag:
        """The bag of the run."""
        return self.run.bag

    @property
    def namespace(self) -> str:
        """Of the arm."""
        return self.run.namespace

    def lacking(self, *names: str) -> tuple[str, ...]:
        """Those of some topics that were not recorded."""
        refused = {one.topic for one in self.run.refused}
        return tuple(
            name
            for name in names
            if name not in refused
            and not ((columns := self.bag.topics.get(f"{self.namespace}/{name}")) and len(columns.log_time_ns))
        )

    @property
    def is_part(self) -> bool:
        """Whether it was cut out of a longer recording."""
        return CUT in self.bag.metadata

    @property
    def failure(self) -> str:
        """Why the run failed or that it was cut off; '' where it did not, or had no scenario and no fault."""
        return failure_of(self.run)

    @property
    def mode(self) -> str:
        """'lockstep', 'realtime' or 'unknown'."""
        return self.summary.loop.mode


def analysed_run(bag: Bag, namespace: str = "") -> AnalysedRun:
    """Prepare a bag for the analyses, whatever is in it; `namespace` as for `recorded_run`."""
    return AnalysedRun(recorded_run(bag, namespace))
