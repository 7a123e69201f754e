"""Thresholds of models, messages and configurations, each with its unit and reason."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ModelThresholds:
    """Numbers of MuJoCo's model without effect, and how exact the numbers of an arm are."""

    never_slack: float = 1e3  # rad of stretch before a strand is slack, if slack is switched off
    far: float = 1e6  # rad or m, beyond the range of every tendon
    # N m; a yield torque that is never reached adds the creep to MuJoCo's state
    never_yields: float = 1e9
    far_away: float = 50.0  # m; position of pushers before their start
    rotor_mass: float = 1e-3  # kg; without effect, as a rotor turns about its centre of mass
    condition: float = 1e8  # of joint_from_motor, at most
    same_point: float = 1e-3  # m, by which numbers that describe the same point may differ
    rounded: float = 1e-6  # of an inertia, by which it may be rounded
    small: float = 1e-9  # m, lever arms that are zero apart from rounding


@dataclass(frozen=True, slots=True)
class FileThresholds:
    """What is named of a configuration, and what can be none."""

    longest_value: int = 60  # characters of a value that is refused
    differences: int = 12  # parameters that are named as different from the base
    longest_difference: int = 100  # characters of two values
    disagreements: int = 3  # parameters that are named where two nodes have different ones
    deepest: int = 50  # nested mappings and lists in YAML; the loader in C recurses
    similar: float = 0.8  # of the letters of a section and of a node, which is then meant
    slowest: float = 1e-3  # of timing.real_time_factor: 1 s of the arm takes 17 min, and a period of 0.1 s nearly two


@dataclass(frozen=True, slots=True)
class InputThresholds:
    """How the inputs of a step go together."""

    # ns, by which a clock goes on at once where a node was late; a longer jump needs two messages
    longest_jump: int = 200_000_000
    ahead: int = 1000  # messages ahead of the clock that are kept
    early: int = 64  # messages of a session that was announced, kept until its first state comes
    longest_wait: int = 10  # outer periods by which states go on before a step is made without an earlier input
    # of the age of the oldest: topics of this age have stopped with it, younger ones are only late
    together: float = 0.7


MODEL = ModelThresholds()
FILES = FileThresholds()
INPUTS = InputThresholds()
