"""Thresholds of the analysis, by concern, each with its unit and reason; and the layout of its reports."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ShaftThresholds:
    """When a shaft is at rest, what its friction can be known from, and when they are certain."""

    # rest and motion
    motor_rest: float = 0.05  # rad/s; a slower motor is at rest
    joint_rest: float = 0.002  # rad/s or m/s; a slower joint is at rest
    shortest_phase: float = 0.01  # s; a shorter stick or slip is chatter
    window: float = 0.03  # s over which friction is averaged, and at most a velocity that is made from positions
    widest_window: float = 0.24  # s, likewise, of a joint whose motions are long
    of_motion: float = 0.25  # of a motion in one direction: so much of it is averaged over
    # of a joint without velocities: standard deviations of its position, within which it stays at rest
    stays: float = 10.0
    slow: float = 0.05  # of its largest speed: slower motions are rest, where this takes a long time
    noisy: float = 6.0  # standard deviations of the noise of a velocity: a joint that is slower is at rest
    far: float = 20.0  # resolutions of a position: who moves so far has moved
    rest_samples: int = 3  # of a rest between motions: fewer may be a turn
    turn: float = 10.0  # times the way within a turn: in as much time after it, a parabola leads 8 times as far
    window_samples: int = 6  # in that window
    disobeyed: float = 0.5  # of the time at rest, in which a joint was commanded to move: it sticks
    turning: float = 5.0  # % of the time at rest; a joint with less does not stick
    passing: float = 0.25  # of the speed of rest: samples of a rest that are slower show no passage through zero
    still: float = 0.01  # of the speed of rest: below it the shaft has not begun to move
    # friction
    # of the way in one direction: less in the other is a deflection, as by a push, and shows no friction
    both_ways: float = 0.05
    fewest_samples: int = 20  # below which a signal is not evaluated
    fewest_signals: int = 100  # instants of all motors and joints, with fewer of which their friction is not
    agreeing: int = 3  # breakaways of which the least is taken for the highest: no single one decides
    precise: float = 0.01  # of the torque, or of the largest speed: noise at a breakaway, or of a made velocity
    sigmas: float = 3.0  # standard errors by which a number may differ from its prediction, or from the truth
    neglected: float = 2e-3  # of a number: what its fit neglects, where a recording without noise leaves no error
    freedom: float = 2.0  # least degrees of freedom: with fewer, an error could be anything
    # of the rise of static above dynamic friction: what creep at a speed that is taken for rest may hide of it
    creep: float = 0.5
    # of dry friction, by which it changes with load and position: over few speeds that looks like viscous
    uneven: float = 0.003
    singular: float = 1e12  # condition of normal equations beyond which a column has no information
    # of a direction that the recording does not show, from which on a factor is not determined
    undetermined: float = 1e-3
    # robust standard deviations of the residual beyond which a sample is left out (impacts, contacts)
    jump: float = 6.0
    unsure: float = 0.25  # of a number; with a larger standard error it is not identifiable
    hidden: float = 10.0  # times the torque of the cables; rotors that take more hide every loss
    much_better: float = 0.5  # of the rest of a fit: one with a lag leaves less
    better: float = 0.9  # the same of another lag than the reversals show
    tried_samples: int = 20_000  # of a joint, on which these laws of friction are tried
    stribeck: tuple[float, float, int] = (0.01, 0.4, 12)  # of the largest speed, and how many are tried between
    longest_effort_lag: float = 0.06  # s of the effort behind the motion, or before it
    # of the acceleration that is not alike a weight; below it, inertia and weight cannot be separated
    apart: float = 0.1
    filtered: int = 4  # lags of an effort after which a filter, of that time constant, has left 2 % of a step
    turning_steps: float = 3.0  # times as often as at the step before a value is at its last one, where it is limited
    limited: float = 0.1  # of the time, in which an effort is exactly at its bounds
    agree: float = 0.1  # by which a recorded velocity may differ from the rate of the position
    late: float = 0.02  # of a velocity, by which a delay or a scale changes it: less is not seen in the friction
    way: float = 1.0  # s, in which they are compared: longer than a velocity is late, shorter than an encoder slips
    least_work: float = 1e-3  # J below which no efficiency is given
    release: int = 200_000_000  # ns after the brakes were released
    # s; with a longer period, cable torques do not show what a resonance does between samples
    slowest_period: float = 0.006
    # ns before and after a push or an estimated contact: it begins before it is detected, cables swing
    around_contact: int = 200_000_000


@dataclass(frozen=True, slots=True)
class CycleThresholds:
    """When a signal repeats, steps, settles or responds, and how certain that is."""

    # limit cycles
    phases: int = 192  # of a cycle that are resolved, if there are enough samples
    phase_samples: int = 8  # samples for each of them
    few_samples: float = 8.0  # of a cycle, which are not folded: they may all miss its peak
    cycles: int = 3  # cycles that are needed
    # of the highest correlation; the shortest lag that reaches it is the period, not a multiple
    correlated: float = 0.9
    sure: float = 0.8  # confidence from which a limit cycle is reported as one
    seen: float = 0.02  # of the force; a smaller cycle is not reported
    episode_cycles: int = 5  # cycles of an episode or a line; fewer repeat by chance, or are of a drift
    window_samples: int = 64  # samples of a window, at least
    slowest_cycles: int = 4  # cycles in a window, slower changes are drift when a cycle is looked for
    same_period: float = 0.05  # relative difference of two periods, or frequencies, that are the same
    # of its size: the second half of a limit cycle that follows a decaying motion has so much of the first
    steady: float = 0.95
    edge: float = 1.5  # cycles at an end within the recording that are not evaluated: it is not known better
    swings: int = 3  # swings that a verdict needs
    swings_alike: float = 0.05  # of their mean: swings that differ by less are those of one cycle
    quiet: float = 1.5  # longest of the last swings; after so long without another one the motion has ended
    late_part: float = 0.7  # of a hold, at its end: its range is that of a cycle, without the approach
    least_swing: float = 0.05  # of the range: a smaller change is no swing
    loud_swing: float = 8.0  # standard deviations of the noise: likewise
    still_shaft: float = 1e-4  # rad; a shaft that moves less does not swing
    loud: float = 4.0  # standard deviations of the noise: a smaller cycle is not reported
    # of a cycle: a smaller command does not cause it; of a command: a smaller cycle is a part of it
    commanded: float = 0.2
    longest_lag: float = 0.15  # s by which a joint may follow its command
    lags: int = 40  # steps of that lag at most
    singular: float = 1e-8  # of the largest singular value: smaller ones of a command are rounding
    harmonics: int = 20  # of a commanded motion that are taken off before another cycle is looked for
    # of a frequency: what remains so near to the first harmonics is the command with a changing size
    near_harmonic: float = 0.1
    lines: int = 3  # of a spectrum, that are reported
    # of a size: a cycle whose second half has less of the first, or more, is reported as changing
    changing: float = 0.8
    # lines of a spectrum
    lobe: int = 3  # bins on each side of a line that its window widens it to
    # bins on each side at least and at most, half of the frequency, from which the noise is known
    neighbours: tuple[int, int] = (8, 24)
    euler_gamma: float = 0.5772  # of Euler: the mean logarithm of the power of noise is so much below that of its mean
    sure_line: float = 25.0  # power of a line over that of the noise, less the logarithm of the number of bins
    apart: int = 4  # times higher or lower frequencies, between which a line is reported if it is the strongest
    clear_line: float = 0.01  # of the largest line: smaller ones are not reported
    # a signal that follows a command
    compared: int = 4000  # samples at most
    longest_delay: float = 0.5  # s, up to which it is looked for first
    delays: int = 101  # of a search, to both sides
    sections: int = 10  # golden ones, until a play is known to 1 % of what it may be
    # steps
    halvings: int = 4  # of an end until it is steady, at most; its means are those of twice as many parts
    one_way: float = 0.8  # of the range of these means, by which the last is off the first where the end still moves
    at_end: float = 0.2  # of the settling band: a smaller motion is none
    # part of the settling band that noise may fill after smoothing, four standard deviations of it
    step_quiet: float = 0.1
    step_loudest: float = 0.5  # the same, where so much smoothing would make the rise longer
    sharp: float = 4.0  # widths of the smoothing in a rise: it is longer by 2 % then


@dataclass(frozen=True, slots=True)
class HoldThresholds:
    """Which commanded forces are evaluated, and what of them."""

    shortest: float = 0.3  # s; a shorter one is part of a ramp
    equal_force: float = 0.01  # N; commanded forces that differ by less are equal
    steady: float = 0.4  # fraction of a hold, at its end, taken as steady
    band: float = 0.05  # of the step: settled within it
    before: float = 0.1  # s before a step, whose mean is where it begins
    loud: float = 0.1  # of the force: an error that stays within it has settled; a smaller change is no step
    fresh: float = 0.2  # s; the force of a more recent contact is that of the impact
    # of a force: where the loop measured less by that of what acted before a command, it had no measurement
    far: float = 0.5
    typical_press: float = 10.0  # N, of a press
    certain: float = 0.1  # left side of (5.11) up to which (5.8) and (5.9) are exact enough for a comparison
    force_tolerance: float = 10.0  # % of the commanded force
    arrival: float = 0.5  # s after a step, in which the arm, which follows late, may still come to its posture


@dataclass(frozen=True, slots=True)
class TouchThresholds:
    """Which contacts are one, which command they belong to, and how well they are estimated."""

    # ns; a shorter loss of contact does not end the contact, no shorter part of one is listed, and the force of a push
    # or a press may last for so long after its command
    bounce: int = 100_000_000
    lasting: float = 0.5  # of a contact, above which a reason belongs to it; a value known for less of it is unknown
    steady_link: float = 0.9  # of the time of a contact, below which it is reported that the estimated link changed
    position_tolerance: float = 0.04  # m
    false_tolerance: float = 10.0  # % of the time without contact, in which one may be estimated
    ending: float = 0.2  # s: one of less may be a contact that has just ended, before a recording did
    # N, below which a true force is printed as 0.00 N: a spring at its rest, which touches nothing
    least_force: float = 5e-3


@dataclass(frozen=True, slots=True)
class IdentificationThresholds:
    """What a recording of free motion can identify, and what is assumed before it."""

    # the motion
    window: float = 0.05  # s, over which the equations of motion are averaged
    thinning: float = 0.5  # windows from one sample to the next
    shortest: float = 10.0  # s of motion
    largest_gap: float = 3.5  # periods that are bridged
    least_contact: float = 1e-3  # of the time of a recording, below which such a force is not reported
    braked: float = 1e-9  # N m; the torque of a motor that has no current
    slowest_motor: float = 0.3  # rad/s; below it, friction depends on what a shaft did before
    slowest_joint: float = 0.02  # rad/s, the same of a joint
    short: float = 20.0  # s of motion in one direction, less of which is warned about
    few_parts: int = 6  # parts of the motion in which a motor turns both ways
    # assumed before it: standard deviations
    friction: float = 0.5  # of the present Coulomb friction
    load: float = 0.1  # friction per transmitted torque
    viscous: float = 1.0  # of the present viscous friction
    stribeck: float = 3.0  # rad/s, and the least that a fit begins with: amid the usual ones, from 0.5 to 20
    rotor: float = 0.2  # of the present rotor inertia
    constants_difference: float = 0.012  # half the difference of two torque constants, each calibrated to 3 %, uniform
    mass: float = 0.3  # of the present mass
    centre: float = 0.05  # m
    inertia: float = 0.5  # of the present inertia of the link
    least_sd: float = 1e-6  # of everything whose present value is 0
    least_motion: float = 2.0  # s of motion of a motor, with less of which its torques show nothing
    kept_weight: float = 1e-3  # N m, sd of the weight at a joint that the motion does not show
    # the fit
    parts: int = 20  # of the motion
    iterations: int = 5  # the load on friction and the links' inertia are not linear in the parameters
    huber: float = 1.5  # standard deviations from which a residual counts less
    law: float = 0.003  # standard deviation of friction, per friction, by what its law leaves out
    asymmetry: float = 0.1  # sd of the part of a shared joint's load friction that has one sign, per load friction
    averaged: int = 9  # windows, over which equations are averaged to see what the estimate depends on
    identified: float = 0.3  # standard deviation per prior one, up to which the motion shows a parameter
    pinned: float = 1e-6  # prior standard deviation, of its own, of a parameter at its limit
    lightest: float = 0.1  # of the present mass of a link and inertia of a rotor, below which no estimate goes
    unexplained: float = 1.5  # rms of held-out motion per rms of the estimate's own
    remaining: float = 0.1  # rms that stays unexplained, per Coulomb friction
    least_inertia: float = 1e-6  # kg m^2; an inertia that came out negative
    least_column: float = 1e-12  # size of a column that the motion does not show
    least_variance: float = 1e-30  # variance of a combination that has none
    # a motion that contradicts the configured arm
    contradicted: float = 0.25  # rms that stays unexplained, per Coulomb friction: it is not that of a free arm
    least_friction: float = 1e-4  # N m of a motor, for a ratio to it
    heavier: float = 1.4  # weight, or torque, per configured one, that no configured arm is wrong by
    least_share: float = 0.05  # of the configured friction, below which none is left
    misfit: float = 0.15  # rms of the recorded torques beyond those of the configured arm, per torque
    poses: int = 100  # random ones, in which the columns of parameters are compared
    seed: int = 1  # of these poses


@dataclass(frozen=True, slots=True)
class StreamThresholds:
    """Which messages and stamps are used, and for how long a message holds."""

    held: int = 100_000_000  # ns for which a message is held; after that the signal is unknown
    thinned: int = 2  # periods of a thinned topic for which a message is held
    fewest: int = 10  # messages of which the period of a topic is known
    filled: float = 5.5  # periods of the longest gap that is filled by interpolation
    shown: int = 3  # messages of a topic that is shown
    pace: float = 0.2  # by which the median period of the receptions may differ from that of the stamps
    # ns by which a stamp goes back where a clock was reset; two clocks that differ by more are two
    reset: int = 1_000_000_000
    late: int = 50_000_000  # ns after which few messages are received
    ahead: int = 2_000_000  # ns before its stamp that no message is received, by clocks that are kept equal
    away: int = 31_536_000_000_000_000  # ns, a year: a stamp so far from its reception is no time, if most are near
    live: float = 0.1  # of the time that the stamps take: receptions in less are those of a file that was converted
    drift: float = 1e-3  # of its speed, by which a clock is wrong: of quartz 1e-4 at most, while it is adjusted 5e-4
    parts: int = 8  # instants at which two clocks are compared
    near: int = 20  # messages on both sides of a stamp that goes back, whose ages show whether the clock was set back
    faster: float = 30.0  # times the receptions: stamps that go on so fast are not in s
    slowest: float = 0.5  # s from message to message: fewer messages are hardly those of a robot
    quickest: float = 2e-5  # s from message to message: nor are more messages
    usual: float = 0.01  # s from message to message, by which the unit of stamps is guessed
    latest: float = 9e9  # s since 1970, beyond which no time in ns has 64 bits
    seconds: float = 1e18  # a time below this is in seconds or less, above it in ns since 1970
    repeated: float = 0.01  # of the stamps: more that repeat the one before are those of a coarse clock
    spikes: float = 0.02  # of the steps of a position: so many may lead to single wrong values and back
    steps: int = 64  # from stamp to stamp, from which a rate is known
    changes: float = 1.5  # periods: a step that is longer lacks a message, and a period that is longer is another one
    regular: float = 0.6  # of the steps, within `pace` of whole periods: with fewer no message is known to be missing
    evenly: float = 0.9  # of the changes of a signal: so many are as far apart, if it is held over between them
    counts: float = 2.0  # smallest changes: those of an encoder are mostly smaller
    turns: tuple[float, ...] = (
        2.0 * math.pi,
        4.0 * math.pi,
        360.0,
    )  # rad, after which an angle wraps; or degrees as rad
    wraps: float = 0.75  # of the range of a counter: by more it jumps where it begins again
    alike: float = 3.0  # times the largest other step: in a wrap an angle moves by less than that
    within: float = 1.01  # of a turn, which an angle that wraps does not leave
    zero: float = 5.0  # times the usual change, or what the velocity leaves of it: more is a jump
    beyond: float = 2.0  # times the largest step by the velocity: a larger one does
    around: int = 2  # steps on each side that show the velocity where none was recorded
    rounding: float = 1e-9  # of the range of a signal: a smaller change is one of the arithmetic
    irregular: float = 0.01  # of a period: stamps that differ more are put on a constant rate
    averaged: float = 0.2  # s, over which a recorded velocity is compared with the rate of the position


@dataclass(frozen=True, slots=True)
class ReportLayout:
    """Sizes of reports and pictures."""

    # text
    width: int = 100  # columns of text, at most
    narrowest: int = 40  # columns of text, at least
    name: float = 0.4  # width of a name in a table at most, of all
    column: int = 12  # width of a number in a table at least, columns
    stated: int = 3  # sentences of a line of the verdict
    named: int = 5  # changes of parameters, or motions
    # pictures
    points: int = 6000  # points of a line
    digits: int = 6  # of a number
    arm: tuple[float, float] = (5.6, 4.2)  # inches, of the picture of the arm
    first_charts: int = 2  # before the sections: with the picture of the arm they fill a screen
    pedestal: float = 0.07  # m, radius of the drawn base, which is not in the parameters
    floor: float = -1.0  # m, height of the foot of the drawn base
    metres_per_newton: float = 0.015  # length of an arrow


SHAFT = ShaftThresholds()
CYCLE = CycleThresholds()
HOLD = HoldThresholds()
TOUCH = TouchThresholds()
IDENTIFY = IdentificationThresholds()
STREAM = StreamThresholds()
LAYOUT = ReportLayout()
