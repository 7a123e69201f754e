"""A recording: what is in a bag, prepared for the sections of an analysis; each is found where it is first used."""

from functools import cached_property

import numpy as np

from wam_analysis.contact_list import ListedContact, TouchedLink, listed_contacts, true_contacts
from wam_analysis.findings.held_force import HeldForce, Theory, held_force, theory_of
from wam_analysis.findings.prediction import admitted
from wam_analysis.findings.transmission import TransmissionFriction, transmission_friction
from wam_analysis.foreign.source import Source
from wam_analysis.foreign.sources import alternates, shared_parts, sources
from wam_analysis.foreign.topic_map import COMMAND, NOTHING_GIVEN, TopicMap
from wam_analysis.held_messages import live_numbers
from wam_analysis.holds import Hold, RecordedTask, holds_of, task_forces, tasks_of
from wam_analysis.recorded import PredictionParameters, prediction_parameters
from wam_analysis.traces import Traces, traces_of
from wam_analysis.unplanned_contact import UnplannedContacts, unplanned_contacts
from wam_bag.arrays import Mask
from wam_bag.bag import Bag, JointColumns, PointColumns, WrenchColumns
from wam_bag.losses import CUT
from wam_description.event import Code
from wam_description.status import diagnosed_name
from wam_sim.reactions import SETTLING_TIME, RecordedReaction, RecordedStep, too_short, unassessed, watched_times
from wam_sim.recorded_run import messages_of, recorded_run, status_of

STAMPED = (JointColumns, WrenchColumns, PointColumns)
MOVING = ("motor_states", "joint_sensors", "joint_states", "sim/joint_states")  # where motion is seen, the best first
UNFINISHED = "not finished: the recording ends before the scenario does"
RATE = "rate [Hz]"  # of a loop in realtime, among the facts that its driver reports


class AnalysedRecording:
    """What the sections of an analysis take from a bag.

    Parameters
    ----------
    bag : of this stack, or of another robot, as read by `wam_analysis.foreign.reading`.
    namespace : of an arm of this stack, '' for the one with the most topics.
    given : topics, joints, fields and units of another robot's recording; None of one of this stack.
    """

    def __init__(self, bag: Bag, namespace: str = "", given: TopicMap | None = None) -> None:
        self.is_foreign = given is not None
        # of another robot a topic has no meaning by its name
        self.run = recorded_run(Bag(bag.path, {}, {}, {}, {}) if self.is_foreign else bag, namespace)
        self.bag = bag if self.is_foreign else self.run.bag
        self.given = given or NOTHING_GIVEN

    @property
    def namespace(self) -> str:
        """Of the arm."""
        return self.run.namespace

    @cached_property
    def parameters(self) -> PredictionParameters:
        """What predictions need, as far as the bag has it."""
        return prediction_parameters(self.run.parameters)

    @property
    def duration(self) -> float:
        """Length of what was recorded of the arm, s: from the first to the last stamp, or log time without stamps."""
        if self.is_foreign:
            return float(np.ptp([one.time[[0, -1]] for one in self.sources]))
        prefix = f"{self.namespace}/"
        own = [one for name, one in self.bag.topics.items() if name.startswith(prefix) and len(one.log_time_ns)]
        stamped = [one.stamp_ns for one in own if isinstance(one, STAMPED) and len(one.stamp_ns)]
        chosen = stamped or [one.log_time_ns for one in own]
        return (max(map(np.max, chosen), default=0) - min(map(np.min, chosen), default=0)) / 1e9

    # joints and wrenches

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

    @property
    def analysed(self) -> tuple[Source, ...]:
        """All but those of a topic that two publishers share."""
        left_out = {one.topic for one in self.mixed}
        return tuple(one for one in self.sources if one.topic not in left_out)

    @cached_property
    def states(self) -> tuple[Source, ...]:
        """What was measured."""
        return tuple(one for one in self.analysed if not one.is_command)

    @property
    def commands(self) -> tuple[Source, ...]:
        """What was commanded to another robot."""
        return tuple(one for one in self.analysed if one.is_command)

    def command_of(self, source: Source) -> Source | None:
        """The command of a joint by its name, of a wrench in its frame or with none; of several the most alike by name.

        A command is of the states whose topics share most parts with its own: of two robots, as /left/joint_states and
        /right/joint_states, neither has that of the other.  What a controller reports with its command does not count.
        Once another one has taken over, it is not known any more.
        """
        own = [
            one for one in self.commands if one.name == source.name and (source.is_joint or source.shares_frame(one))
        ]
        for one in tuple(own):
            others = (two for two in self.states if two.name == source.name and f"{two.topic} {COMMAND}" != one.topic)
            if shared_parts(one, source) < max((shared_parts(one, two) for two in others), default=0):
                own.remove(one)
        best = max(own, key=lambda one: shared_parts(one, source), default=None)
        later = [one.time[0] for one in own if one.time[0] > best.time[-1]] if best else []
        return best and best._replace(away=np.sort([*best.away, *later]))

    # the run

    @property
    def steps(self) -> tuple[RecordedStep, ...]:
        """Steps of the scenario, with the one in which the recording ends."""
        return self.run.begun

    @property
    def outcome(self) -> str:
        """DONE, why the scenario failed, or that the recording ended before."""
        return self.run.outcome or UNFINISHED

    @property
    def is_part(self) -> bool:
        """Whether it was cut out of a longer recording."""
        return CUT in self.bag.metadata

    @property
    def failure(self) -> str:
        """Why the run failed or that it was cut off; '' where it did not, or had neither a scenario nor a fault.

        A part that was cut out of a recording is none.
        """
        if self.run.outcome or self.is_part:
            return "" if self.run.outcome in ("", Code.DONE) else self.run.outcome
        return self.run.faults[-1].reason if self.run.faults else UNFINISHED * bool(self.run.steps)

    @cached_property
    def loop(self) -> list[dict[str, str]]:
        """What the driver reported of its loop every second."""
        arrays = messages_of(self.bag, "/diagnostics")
        statuses = (status for array in arrays for status in map(status_of, array.status))
        return [dict(one.facts) for one in statuses if one.node == diagnosed_name(self.namespace, "driver")]

    @property
    def mode(self) -> str:
        """'lockstep', 'realtime' or 'unknown'."""
        is_timed = any(RATE in facts for facts in self.loop)
        mode = self.run.bag.mode
        return "realtime" if mode == "unknown" and is_timed else mode

    @property
    def lost(self) -> list[str]:
        """Sentences about what the bag lacks, none if no loss is known."""
        return self.bag.losses.sentences(self.bag.first)

    # forces

    @cached_property
    def tasks(self) -> list[RecordedTask]:
        """Each task with its times; none if the arm is not known."""
        return tasks_of(self.run, self.parameters.arm)

    @property
    def task_forces(self) -> list[Hold]:
        """The forces at points of links in all tasks, in the order of time."""
        return list(task_forces(self.tasks))

    @cached_property
    def traces(self) -> Traces:
        """Forces and contacts over time."""
        return traces_of(self.run, self.parameters.arm, self.task_forces)

    @cached_property
    def reactions(self) -> tuple[RecordedReaction, ...]:
        """Those of the force loop to what was commanded, and faults of the driver."""
        ends = [int(stamp) for stamp in self.traces.stamp[-1:]] + [step.end for step in self.steps[-1:]]
        return self.run.reactions(max(ends, default=0))

    @cached_property
    def holds(self) -> tuple[Hold, ...]:
        """The constant forces that were commanded."""
        return holds_of(self.run, self.steps, self.task_forces, self.reactions)

    @cached_property
    def held(self) -> tuple[HeldForce, ...]:
        """Each of them, and how it was reached and held."""
        return tuple(held_force(self.run, self.traces, self.parameters, hold) for hold in self.holds)

    @cached_property
    def theories(self) -> dict[str, Theory]:
        """What is predicted for each of them, by name; nothing where it was refused."""
        parameters, _ = self.admitted
        return {
            one.hold.name: Theory() if one.hold.is_refused else theory_of(self.run, parameters, one)
            for one in self.held
        }

    @cached_property
    def admitted(self) -> tuple[PredictionParameters, str]:
        """As `wam_analysis.findings.prediction.admitted`."""
        return admitted(self.parameters)

    @property
    def unassessed(self) -> tuple[list[RecordedStep], str]:
        """The steps that are too short to be assessed, and that in words."""
        settling = live_numbers(self.run, SETTLING_TIME)
        watched = watched_times(self.tasks)
        found = unassessed(self.reactions, watched, self.steps, settling)
        return found, too_short(settling, found)

    # contacts

    @cached_property
    def contacts(self) -> tuple[ListedContact, ...]:
        """All that were estimated."""
        return listed_contacts(self.run, self.traces, self.steps)

    @cached_property
    def blind(self) -> Mask:
        """Whether nothing can be estimated at each instant: under the brakes, where the motors alone are observed."""
        estimator = self.run.parameters.nodes.get("contact_estimator", {})
        return self.run.braked(self.traces.stamp) & (not estimator.get("use_joint_sensors", True))

    @cached_property
    def seen(self) -> Traces:
        """The signals, the true force only where it can be estimated."""
        return self.traces._replace(true=self.traces.true.unknown(self.blind))

    @cached_property
    def touched(self) -> tuple[TouchedLink, ...]:
        """The true contacts, estimated or not."""
        return true_contacts(self.seen, self.steps)

    @property
    def missed(self) -> tuple[TouchedLink, ...]:
        """True contacts that were not estimated."""
        return tuple(one for one in self.touched if one.is_missed)

    @cached_property
    def unplanned(self) -> UnplannedContacts:
        """Contacts without a command of a force, harder than allowed."""
        return unplanned_contacts(self.run, self.traces, self.steps)

    # the transmission

    @cached_property
    def friction(self) -> TransmissionFriction:
        """Friction of motors and joints."""
        return transmission_friction(self.run, self.parameters)
