"""The arm and its controllers as they were when a bag was recorded, built from the parameters in the bag."""

from typing import NamedTuple, TypeVar

from wam_bag.bag import BagError
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_description.arm import Arm, Servo, Timing
from wam_description.configuration import Configuration, packaged
from wam_description.effects import Effects
from wam_description.parameters import build_part
from wam_description.world import World
from wam_sim.recorded_parameters import RecordedParameters

T = TypeVar("T")


class RecordedArm(NamedTuple):
    """The arm and its surroundings; `note` names where they come from if not from the bag."""

    arm: Arm
    world: World
    note: str


class PredictionParameters(NamedTuple):
    """What predictions need; None for a part that the bag does not have.

    Attributes
    ----------
    world : the surroundings.
    effects : of the simulated transmission.
    commutation : torque ripple of each simulated motor as a fraction of its torque, and its cycles per turn.
    force_loop : gains and limits.
    servo : gains of the velocity loop.
    note : why parts are missing, '' if none is.
    """

    arm: Arm | None
    world: World | None
    timing: Timing | None
    effects: Effects | None
    commutation: tuple[tuple[float, int], ...]
    force_loop: ForceLoopParameters | None
    servo: Servo | None
    note: str

    @property
    def of_force_loop(self) -> tuple[Arm, Servo, Timing, ForceLoopParameters] | None:
        """What the force loop is made from, where the bag has all of it."""
        arm, servo, timing, loop = self.arm, self.servo, self.timing, self.force_loop
        if arm is None or servo is None or timing is None or loop is None:
            return None
        return arm, servo, timing, loop


def prediction_parameters(recorded: RecordedParameters) -> PredictionParameters:
    """Everything that predictions need, as far as the bag has it."""
    notes: dict[str, None] = {}

    def part(cls: type[T], node: str, prefix: str = "") -> T | None:
        try:
            return recorded.part(node, cls, prefix)
        except BagError as error:
            lacks = bool(recorded.nodes) and node not in recorded.nodes
            text = f"no parameters of the packaged {node} were recorded" if lacks else str(error)
            notes[text.removeprefix(f"{recorded.source}: ")] = None  # the reader of a report knows the bag
            return None

    driver = recorded.nodes.get("driver", {})  # one that simulates no amplifiers has none of these
    ripples = (driver.get(f"amplifier.{name}", ()) for name in ("torque_ripple", "ripple_cycles"))
    return PredictionParameters(
        arm=part(Arm, "driver", "arm."),
        world=part(World, "driver", "world."),
        timing=part(Timing, "driver", "timing."),
        effects=part(Effects, "driver", "effects."),
        commutation=tuple(zip(*ripples, strict=False)),
        force_loop=part(ForceLoopParameters, "force_loop"),
        servo=part(Servo, "velocity_loop", "servo."),
        note="; ".join(notes),
    )


def recorded_arm(recorded: PredictionParameters) -> RecordedArm:
    """The arm of the bag, or that of the packaged configuration 'wam' if the bag has none."""
    if recorded.arm is not None and recorded.world is not None:
        return RecordedArm(recorded.arm, recorded.world, "")
    configuration = Configuration.load(packaged("wam"))
    world = build_part(World, configuration.sections["driver"], "world.")
    note = f"the arm in the picture is that of the packaged configuration 'wam': {recorded.note}"
    return RecordedArm(configuration.shared.arm, world, note)
