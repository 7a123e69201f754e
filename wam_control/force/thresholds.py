"""Thresholds of the force loop and its guard: values that no parameter sets, each with its unit and reason."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ForceThresholds:
    """When a surface counts as touched, when a force is kept or reported, and how the arm moves meanwhile."""

    # measured force
    steady_time: float = 0.1  # s, time constant of the torques that are taken as zero
    slow: float = 0.3  # rad/s of a joint: faster, torques show no payload; nor is it faster back from beyond its end
    payload_rest: float = 0.05  # of the torques at rest: what a payload may leave of them
    least_sd: float = 1e-6  # N m, of an estimated torque: one without any error would be all that counts
    certain: float = 3.0  # standard deviations of the torques, within which they show nothing
    unexplained: float = 16.0  # chi^2 of torques above which they are not those of the force
    # direction and lever of a force
    least_lever: float = 1e-3  # m; a shorter lever is none: such a force cannot be applied, such a torque is none
    least_normal: float = 0.5  # cosine of the angle of a force to the normal of the side of a link
    sized_force: float = 1.0  # N, for the size of tangential forces
    hand: float = 10.0  # N, of a hand that leads the arm, as an unknown of the other forces
    negligible: float = 1e-12  # of what is 1 where it counts
    rounded_speed: float = 1e-7  # rad/s, of the solution of a limited problem
    # touch and link
    touch: float = 0.2  # of the commanded force, from which something is touched
    impact_time: float = 0.1  # s after a touch, in which its impact turns the force and looks like another contact
    # speed along a force
    settled: float = 3.0  # time constants within the settling time
    creep: float = 3e-3  # m, least way within the settling time, and back from a link: friction turns less into jerks
    identified_rise: float = 0.3  # s, in which the force may rise at a place that is not known
    finest_motion: float = 1.2e-5  # m, of the arm against its friction: a force is not set more finely
    kept: float = 0.3  # of the tolerance, up to which an error is left alone
    surface_slope: float = 0.01  # of a surface that moves across the force
    friction_turn: float = 0.3  # s, in which the friction of the arm turns round, or comes to rest
    slide_slope: float = 0.3  # of a surface along which a posture moves the link
    slow_posture: float = 0.2  # rad/s, below which a posture waits while a force is kept
    # a force that is commanded, after the touch
    ramp: float = 4.0  # latencies of the measured force, in which it goes to the one that is desired
    shown: float = 2.0  # of these, after which a force or a touch is measured: the arm follows late, too
    # feed-forward
    friction_time: float = 0.04  # s, time constant of the friction that is fed forward: at once, it chatters
    slow_motor: float = 0.04  # rad/s, of a motor, below which less of the dry friction is fed forward
    slow_joint: float = 0.002  # rad/s, the same of a joint
    # shaking by a dither
    watched_time: float = 0.2  # s, for which it is watched before the arm moves, or a whole cycle
    balances: int = 30  # steps, in which friction and vibration balance
    # events
    hysteresis: float = 1.25  # of the doubt, above which an arm that has not touched yet holds again; spare of advice
    quarter: float = 0.25  # of the settling time, in which a force that has been reached may be off
    turns: int = 4  # of the force within the settling time, above which it oscillates
    faint_swing: float = 0.5  # of a swing that is reported, from which the arm is slowed down
    slowed: float = 0.5  # of the speed along the force, from then on; twice at most
    lasting: float = 0.2  # s, for which a push is reported after the last time
    stopped: float = 0.5  # of the velocity without limits, below which a joint is at its end
    singular: float = 0.14  # of the largest lever of a point: a motion with a smaller one is slowed down
    # advice
    pins: tuple[float, ...] = (0.8, 0.6, 0.3)  # of a link, where a force is tried whose place is not known
    more: tuple[float, ...] = (1.25, 1.6, 2.0, 3.0, 5.0)  # times the commanded force, tried in this order
    turned: tuple[float, ...] = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.3, 1.6)  # rad, by which a joint is turned
    spare: float = 0.1  # rad, from where a joint may be no further: the arm moves on as it presses


@dataclass(frozen=True, slots=True)
class GuardThresholds:
    """Where the guard searches for the limits of stability, and what it takes as stable."""

    # margins of the linear loop
    largest_scale: float = 10.0  # scale of the gains up to which a margin is searched
    least_scale: float = 1e-6  # of the gains: with one that is stable only below it, no force is controlled
    halvings: int = 6  # of the gain of the posture, in search of one with which some force gain is stable
    slack: float = 0.003  # the search for a margin ends within 0.2 %
    # N, of commands at which parameters are assessed: the sensed force depends on them
    forces: tuple[float, ...] = (1.0, 40.0)
    # while the arm moves
    turn: float = 0.1  # rad, of a joint or of the force direction, after which the loop is assessed again
    shift: float = 0.02  # m, of the contact position or its uncertainty, after which it is assessed again
    growth: float = 1.5  # of the commanded force, after which it is assessed again
    # of the required scale, all of which have to be stable
    scales: tuple[float, ...] = (0.02, 0.05, 0.1, 0.25, 0.5, 0.75, 1.0)


FORCE = ForceThresholds()
GUARD = GuardThresholds()
