"""Thresholds of the force loop and its guard: values that no parameter sets, each with its unit and reason."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ForceThresholds:
    """When a force is reached, kept, lost or refused, and how the arm moves meanwhile."""

    # measured force and torque
    steady_time: float = 0.1  # s, time constant of the torques that are taken as zero
    least_weight: float = 1e-12  # 1/kg^2, of a weight that no joint carries
    certain: float = 3.0  # standard deviations of the torques, within which they show nothing
    shortest_lever: float = 1e-6  # m, lever of a point on the joints
    one_sided: float = 0.5  # of the time in which it is off, above which it is off to one side
    # m, lever of the part of a torque that is not that of the force at a position on the cover
    cross_lever: float = 1e-3
    # N; a smaller force is none: its direction is a rounding, and nothing can be divided by it
    smallest_force: float = 1e-6
    negligible: float = 1e-12  # square of a component of a direction that counts as zero
    # direction and lever of a force
    least_lever: float = 1e-3  # m; a force with a shorter lever on the joints cannot be applied
    least_normal: float = 0.5  # cosine of the angle of a force to the normal of the side of a link
    axis_certain: float = 2.0  # standard deviations
    sized_force: float = 1.0  # N, for the size of tangential forces
    # feed-forward of friction
    # s, time constant of the friction that is fed forward: at once, it chatters where the lever is short
    friction_time: float = 0.04
    slow_motor: float = 0.04  # rad/s, of a motor, below which less of the dry friction is fed forward
    slow_joint: float = 0.002  # rad/s, the same of a joint
    # a force that is held: reached, conflict, creep
    tolerance: float = 0.1  # of the commanded force, within which it is reached, and at least limits.least_tolerance
    touch: float = 0.2  # of the commanded force, from which something is touched
    unexplained: float = 16.0  # chi^2 of torques above which they are not those of the commanded force
    turned: float = 3.0  # chi^2 of a change of the torques at a settled force: above it something else acts
    turned_back: float = 1.0  # the same: below it, no more
    conflict_time: float = 0.1  # s, after which another contact counts
    uncertain_time: float = 0.5  # s, after which a contact counts of which it is not known on which link it is
    # s, in which the force on the stiffest surface may rise to the commanded one at an unknown position
    identified_rise: float = 0.3
    detection_time: float = 0.04  # s, until a touch is detected there
    # s, the same as `identified_rise` where the position is known: the measured force and the arm's speed are late
    known_rise: float = 0.1
    # s, the same with the estimate from the motors, which detect most of a small force at once, and late
    motors_rise: float = 0.2
    fed_time: float = 0.3  # s, in which the torque of the force is fed forward after the touch
    crept: float = 1.5  # settling times in which the arm has moved less than `little_way`, and touched nothing
    little_way: float = 9e-3  # m
    # of a surface that moves across the force, or of the link on it, against the direction of its motion
    surface_slope: float = 0.01
    friction_turn: float = 0.3  # s, in which the friction of the arm turns round on a surface that moves
    settled: float = 3.0  # time constants within the settling time
    # of the errors that are stated of torques; those of friction on a surface are as large as stated
    likely: float = 0.6
    # m, least way towards a surface within the settling time: slower, friction moves the arm in jerks
    creep: float = 3e-3
    # of the time without a touch, by which that with it is reduced: a link that bounces is touched
    free_rate: float = 0.2
    fine_way: float = 4e-4  # m, way of the whole force up to which the band in which it is kept is as wide as below
    coarse_way: float = 1e-3  # m, way of the whole force below which jerks of friction are larger than its error
    settle: float = 0.03  # of the commanded force: errors below which it is kept
    leave: float = 0.06  # of the commanded force: errors up to which it is kept
    # of the settling time, after which a force that is too large, or has been reached and left, is reported
    left_after: float = 0.25
    bouncing_time: float = 0.1  # s after the first touch, in which an impact turns the force as often as a limit cycle
    few_turns: int = 2  # turns of the late force of the motors, after which the arm is slowed down
    # of a swing that is reported, from which it is: a cycle that grows is seen late, and with a wrong size
    faint_swing: float = 0.5
    slowed: float = 0.5  # of the speed along the force, from then on
    shake_samples: int = 8  # outer periods, at least: a dither of 25 Hz
    resonance: float = 4.0  # largest swing on a surface, per swing without resonance
    # s, for which the shaking is watched before the arm moves, or for a whole cycle of a slower dither
    watched_time: float = 0.2
    # by how much worse another force may be known, and the arm slower, so that it still would be accepted
    reserve: float = 1.2
    not_slowed: float = 0.95  # of the speed along the force
    resume: float = 0.8  # of the largest standard deviation, below which a force is controlled again
    swing_cycles: int = 2  # that have to be seen
    # contact on another link than commanded, payload
    fast: float = 0.3  # rad/s, above which a payload is not known from the torques of the motion
    # rad/s, velocity towards a posture below which it waits while a force on a stiff surface is kept
    slow_posture: float = 0.2
    way_back: float = 3e-3  # m, way back from another link than commanded
    near_end: float = 0.1  # of a link that is perhaps touched: where its force is taken to be
    middle: float = 0.5  # the same
    faint_position: float = 0.25  # of a link that may be touched, where its force has to be detected
    vague: float = 2.0  # times the largest sd of a measured force, up to which it is taken for a force on another link
    # of the torques at rest: what a payload may leave of them, as the masses are not known better
    payload_rest: float = 0.05
    # an arm that is pushed, that gives way, or that has left the surface
    lasting: float = 0.2  # s, for which a push counts after the last time: a swing is one, and the arm runs on
    left_angle: float = 0.05  # rad, motion of a joint by which it has left what it pressed on
    slowest: float = 1e-9  # rad/s
    push_back: float = 0.3  # rad/s, at which a joint beyond its end is brought back, at most
    slow_from: float = 0.9  # of the largest contact force, from which motion against it is slowed down
    # posture
    # of a surface to the force: as fast as this times the link slides on it, it comes towards the link
    slide_slope: float = 0.3
    # of the largest joint speed: on a path up to so fast the arm lags behind, and arrives in time
    caught_up: float = 1.25
    pause: float = 0.1  # s, after which a posture that changes is another goal, to which the arm goes as fast as it may
    rhythm: float = 1.5  # factor between two intervals of changes, up to which they are those of one path
    rounding: float = 1e-9  # s, rad
    pace: float = 5.0  # 1/s, velocity per posture error of an arm that arrives in time
    behind_angle: float = 0.05  # rad, by which an arm may be behind the one that arrives in time
    behind_time: float = 0.1  # s, in which that arm moves: it may be behind by that way, too
    short_for: float = 0.1  # s, after which it is reported
    # tasks
    lost_touch: float = 0.5  # s without a touch, after which another one begins
    short_lever: float = 0.05  # m or 1, lever below which a motion along an axis is slowed down
    lost_axis: float = 1e-3  # part of an axis that the others have to leave it
    least_friction: float = 0.01  # of surfaces that two forces press on
    hand: float = 10.0  # N, of a hand that leads the arm, as an unknown of the other forces
    # advice
    more: tuple[float, ...] = (1.25, 1.6, 2.0, 3.0, 5.0)  # times the commanded force, tried in this order
    # rad, by which a joint is turned, to both sides
    turns: tuple[float, ...] = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.3, 1.6)
    spare: float = 0.1  # rad, from where a joint may be no further: the arm moves on as it presses
    each: int = 5  # ways that are tried in a period
    another: float = 0.1  # of a force, by which another one differs that has an advice of its own


@dataclass(frozen=True, slots=True)
class GuardThresholds:
    """Where the guard searches for the limits of stability, and what it takes as stable."""

    # margins of the linear loop
    largest_scale: float = 10.0  # scale of the gains up to which a margin is searched
    slack: float = 0.003  # the search for a margin ends within 0.2 %
    # N, of commands at which parameters are assessed: the sensed force depends on them
    forces: tuple[float, ...] = (1.0, 40.0)
    on_the_circle: float = 1e-7  # growth of a mode in one period that counts as none
    longest_delay: int = 50  # periods
    close: float = 0.9  # of the margin; no plant is known better
    absurd: float = 1e12  # a number of the loop above it, or below its inverse but not 0, is a slip of the pen
    # saturation and friction
    # fractions of the largest contact stiffness that are considered
    softer: tuple[float, ...] = (1.0, 0.6, 0.35, 0.2, 0.1, 0.03)
    # of F_des, in saturations, which have to come to rest
    steps: tuple[float, ...] = (0.3, 0.8, 1.0, 1.5, 3.0, 10.0, 50.0)
    # saturations, in F_static
    candidates: tuple[float, ...] = (100.0, 50.0, 25.0, 12.0, 6.0, 4.0, 2.8, 2.0, 1.4, 1.0, 0.7, 0.5)
    # accepted fraction of the largest saturation found good: between the candidates tried, worse ones may be
    sure: float = 0.7
    events: int = 4000  # of the exact integrator, after which a response counts as not settled
    # rad of the node's own frequency per sample: a faster loop without delay is examined as a continuous one
    continuous: float = 0.1
    cycle_excess: float = 1.5  # largest cycle that counts as the stiction cycle, in sizes of (5.8)
    parts: int = 2  # steps in an inner period
    rest_fraction: float = 0.2  # of the saturation: peak to peak at the end of a response that counts as rest
    rises: float = 1.5  # duration of a trial, in times that the largest step takes at the saturated speed
    oscillations: float = 60.0  # of the node, added to that duration
    # saturations, in F_static
    trial_candidates: tuple[float, ...] = (60.0, 30.0, 15.0, 8.0, 5.0, 3.5, 2.5, 1.7, 1.2, 0.8, 0.5)
    # while the arm moves
    turn: float = 0.1  # rad, of a joint or of the force direction, after which the loop is assessed again
    shift: float = 0.02  # m, of the contact position or its uncertainty, after which it is assessed again
    growth: float = 1.5  # of the commanded force, after which it is assessed again
    # of the required scale, all of which have to be stable
    scales: tuple[float, ...] = (0.02, 0.05, 0.1, 0.25, 0.5, 0.75, 1.0)
    positions: tuple[float, ...] = (0.25, 0.5, 0.75, 1.0)  # of a cover's length, at which an uncertain contact may be


FORCE = ForceThresholds()
GUARD = GuardThresholds()
