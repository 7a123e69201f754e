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


MODEL = ModelThresholds()
