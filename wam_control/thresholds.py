"""Thresholds of motions, trajectories and the inner loop, each with its unit and reason."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MotionThresholds:
    """When the arm is at rest or at a goal, and which lines and trajectories can be followed."""

    at_rest: float = 0.05  # rad/s, speed of a joint below which the arm is at rest
    arrived: float = 0.02  # rad, of each joint from a posture, within which the arm is there
    left_angle: float = 0.05  # rad, motion of a joint by which the arm has left what it pressed on
    caught_up: float = (
        1.25  # of the largest joint speed: on a path up to so fast the arm lags behind, and arrives in time
    )
    # s before a trajectory, in which the arm must be at rest, and after it, in which it must be there
    goal_time: float = 1.0
    nodes: int = 200  # of a line, between which the joint angles are interpolated
    steepest: float = 15.0  # rad/m, of a joint on a line
    exact: float = 1e-10  # m, of the nodes of a line
    reached: float = 1e-6  # m, between a node and the line; what is further from it is out of reach
    rounding: float = 1e-9  # of sums of periods, s, and of angles, lengths and forces, rad, m and N
    shortest: float = 1e-6  # s, of a part of a trajectory: its fifth power is a number, too
    longest: float = 1e6  # s, of a part of a trajectory
    slowest_chirp: float = 1e-6  # Hz; the ratio of two frequencies is a number, too
    fastest_chirp: float = 500.0  # Hz: half of the usual inner rate


@dataclass(frozen=True, slots=True)
class VelocityThresholds:
    """Which gains of the velocity loop are accepted, and what its amplifiers do."""

    # least damping ratio of a slow mode: what the integral gain alone holds swings on its spring
    least_damping: float = 0.03
    slow_mode: float = 0.6  # rad per period, up to which a mode is slow
    # of the peak torque: a smaller one may be lost in the deadband of an amplifier, not in brakes
    deadband: float = 0.02
    shortest_cycle: int = 4  # periods; a shorter one is no sine


MOTION = MotionThresholds()
VELOCITY = VelocityThresholds()
