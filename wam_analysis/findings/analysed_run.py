"""A bag prepared for analysis: its run, parameters, signals and the constant forces that were commanded."""

from functools import cached_property

import numpy as np

from wam_analysis.demo_summary import DemoSummary, failure_of, summary_of
from wam_analysis.findings.held_force import HeldForce, Theory, held_forces, theory_of
from wam_analysis.findings.transmission import TransmissionFindings, transmission_findings
from wam_analysis.foreign.sources import Source, alternates, command_of, sources
from wam_analysis.foreign.topic_map import NOTHING_GIVEN, TopicMap
from wam_analysis.held_messages import lacking
from wam_analysis.recorded import PredictionParameters, prediction_parameters
from wam_bag.bag import Bag, JointColumns, PointColumns, WrenchColumns
from wam_bag.losses import CUT
from wam_sim.recording import RecordedRun, recorded_run

STAMPED = (JointColumns, WrenchColumns, PointColumns)
MOVING = ("motor_states", "joint_sensors", "joint_states", "sim/joint_states")  # where motion is seen, the best first


class AnalysedRun:
    """What the analyses take from a bag; everything is evaluated where it is used.

    Parameters
    ----------
    run : of the bag.
    given : topics, joints, fields and units of another robot's recording; None of one of this stack.
    """

    def __init__(self, run: RecordedRun, given: TopicMap | None = None) -> None:
        self.run = run
        self.is_foreign = given is not None
        self.given = given or NOTHING_GIVEN

    @cached_property
    def sources(self) -> tuple[Source, ...]:
        """Joints and wrenches with what was done to their raw values; of this stack the motors and joints that move."""
        bag = self.bag
        if not self.is_foreign:
            seen = [name for name in MOVING if self.run.joints(name) is not None]
            kept = seen[: 1 + ("motor_states" in seen)]  # the joints once
            topics = [f"{self.namespace}/{name}" for name in kept]
            bag = bag._replace(topics={name: bag.topics[name] for name in topics})
        return tuple(sources(bag, self.given))

    @cached_property
    def mixed(self) -> tuple[Source, ...]:
        """Those whose topic two publishers share, so that it is not analysed."""
        return tuple(one for one in self.sources if not one.is_command and self.is_foreign and alternates(one))

    @cached_property
    def states(self) -> tuple[Source, ...]:
        """What was measured."""
        return tuple(one for one in self.analysed if not one.is_command)

    def command_of(self, source: Source) -> Source | None:
        """What was commanded of a joint or wrench; None where that is not known."""
        return command_of(source, self.commands, self.states)

    @property
    def analysed(self) -> tuple[Source, ...]:
        """All but those of a topic that two publishers share."""
        left_out = {one.topic for one in self.mixed}
        return tuple(one for one in self.sources if one.topic not in left_out)

    @property
    def commands(self) -> tuple[Source, ...]:
        """What was commanded to another robot."""
        return tuple(one for one in self.analysed if one.is_command)

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
        return held_forces(self.run, self.summary, self.parameters)

    @cached_property
    def theories(self) -> dict[str, Theory]:
        """What is predicted for each of them, by name; nothing where it was refused."""
        found = [one for one in self.held if not one.hold.is_refused]
        nothing = {one.hold.name: Theory() for one in self.held}
        return nothing | {one.hold.name: theory_of(self.run, self.parameters, one) for one in found}

    @cached_property
    def motion(self) -> TransmissionFindings:
        """Friction and ripple of motors and joints."""
        return transmission_findings(self.run, self.parameters)

    @property
    def bag(self) -> Bag:
        """The bag of the run."""
        return self.run.bag

    @property
    def duration(self) -> float:
        """Length of what was recorded of the arm, s: from the first to the last stamp, or log time without stamps."""
        prefix = "" if self.is_foreign else f"{self.namespace}/"
        own = [one for name, one in self.bag.topics.items() if name.startswith(prefix) and len(one.log_time_ns)]
        stamped = [one.stamp_ns for one in own if isinstance(one, STAMPED) and len(one.stamp_ns)]
        chosen = stamped or [one.log_time_ns for one in own]
        return (max(map(np.max, chosen), default=0) - min(map(np.min, chosen), default=0)) / 1e9

    @property
    def namespace(self) -> str:
        """Of the arm."""
        return self.run.namespace

    def lacking(self, *names: str) -> tuple[str, ...]:
        """Those of some topics that were not recorded."""
        return lacking(self.run, *names)

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
