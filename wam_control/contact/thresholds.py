"""Thresholds of the contact estimator: values that no parameter sets, each with its unit and reason."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ContactThresholds:
    """When a contact is detected, where it may be, how it may move, and how model errors are learned."""

    # detection
    # of the threshold, that of the faster estimate, whose covariance is rather too large: in 13 min of motion without
    # contact, of arms with errors, its statistic was at most 16, that of the slower one 28
    sudden: float = 0.75
    shaking_time: float = 0.3  # s after a contact, in which the cables vibrate: the faster estimate is not used
    # times the threshold: detected in one period, and where cables vibrate in two, as a smaller one elsewhere
    alone: float = 2.0
    settled: float = 2.0  # time constants of the observer, from the first sample until the estimate is ready
    # position, force and link of one contact
    smallest_force: float = 1e-6  # N, avoids a division by zero where there is no force
    search_depth: float = 8.0  # of the log of probability; positions further below the maximum are neglected
    peak_positions: int = 12  # pieces of a refined peak; one of fewer than half as many is refined
    refinements: int = 4  # of a peak, each by a factor of two or more
    weak_prior: float = 1e-9  # of the force prior: avoids a division by zero in directions that no joint measures
    end_length: float = 0.01  # m, length of the end of a link
    end_slopes: tuple[float, ...] = (0.05, 0.5)  # force across the tube per force along it, on its end
    reported_probability: float = 0.9  # probability of the set that is reported, of contacts
    largest_exponent: float = 500.0  # beyond it, the exponential function overflows
    negligible: float = 1e-300  # avoids the logarithm of 0, and a division by it
    # N m, of external torques: below that rounding decides where a contact is, or on which link
    smallest_sd: float = 1e-4
    # probability of a force along the tube above which that is a reason why the link is not identified
    noted_probability: float = 0.05
    # several instants of one contact
    # s, between instants: one and a half time constants of the observer, within which errors are alike; the contact
    # moves on so long after the last one
    instant_interval: float = 0.03
    instants: int = 6  # past ones
    # N m, sd of the errors of one instant, below which rounding decides what instants have in common
    finest_sd: float = 1e-3
    # difference of inner products that are equal but for rounding, above which it decides what they are
    rounding: float = 1e-4
    pose_change: float = 2e-3  # rad, of any joint: another pose. In one pose the errors of the model stay
    force_turn: float = 0.15  # of the size of the force: sd of the change of its components from instant to instant
    slip: float = 0.03  # m/rad: sd of the way of a contact along its link, per way of the joints
    drift: float = 0.02  # m/s: the same, of what touches an arm that does not move
    slide_speed: float = 0.5  # m/s: sd of the speed along its link of a contact that slides
    slide_probability: float = 0.05  # probability of such a contact
    any_force: float = 2.0  # of its size: sd of the force of a contact, where only its speed counts
    any_position: float = 0.1  # m: sd of the position of a contact, where only its speed counts
    most_growth: float = 4.0  # by which the torques of a contact grow or fall from its last instant
    freedom: float = 10.0  # degrees of freedom
    unknowns: int = 3  # of a contact: its position and the force across the link
    different: float = 4.0  # chi^2 per degree of freedom above which instants are not of the same contact
    # errors of the model
    learn_interval: float = 0.01  # s, between samples that are learned from
    hindsight: float = 0.1  # s; what is learned is so old, so that a contact is noticed before its beginning is learned
    rest_left: float = 0.005  # rad, from a pose where the arm has rested: what was learned there is no longer true
    correlated: float = 8.0  # of R: the rest stays for so many samples, of which each is learned from
    gate: float = 12.0  # of the detection statistic, above which nothing is learned
    hold_off: float = 0.25  # of the length of a contact: for that time after it nothing is learned
    longest_hold_off: float = 0.5  # s, the longest such time
    noise_time: float = 1.0  # s, in which the noise of the motors is followed
    trust_time: float = 5.0  # s of motion, in which the size of the errors is followed
    margin: float = 2.0  # of that size: errors in contact are larger, and some come rarely
    largest_size: float = 4.0  # of that size
    sure: float = 2.0  # sd of an error that it must have beyond what is tolerable
    # errors of the model above which it is off
    tolerable_motion: float = 0.2  # per friction, or per torque of the acceleration
    tolerable_mass: float = 0.04  # per torque
    tolerable_torque: float = 0.05  # of load friction and torque constants, per torque
    tolerable_centre: float = 0.02  # m, of a centre of mass
    tolerable_delay: float = 3e-3  # s, of the torques
    tolerable_payload: float = 0.05  # kg
    # sd of an identified friction, per friction: what changes from the identification to the use
    identified_friction_sd: float = 0.02
    # friction of shafts
    slow: float = 1.2  # Stribeck velocities: speed over which what the law of friction leaves out decays
    assumed_stribeck: float = 3.0  # by which a Stribeck velocity that was not identified may be too small
    usual_stribeck: float = 10.0  # rest velocities: Stribeck velocity of a shaft of which no model is known
    # the angle over which friction builds up after a reversal, in seconds at the rest velocity: from that of a rigid
    # bearing to that of a soft seal
    shortest_presliding: float = 0.04
    longest_presliding: float = 4.0
    presliding_count: int = 4  # angles that stand for all between
    rest_noise: float = 3.0  # sd of the measured velocity that the rest velocity is at least
    # of the cycle of a dither, in which a shaft that slips in both directions has surely been at both its limits
    slips_both_ways: float = 0.25
    # s, damping of cables over their stiffness, of the links that the motors drive: more than cables have, as the
    # modelled vibration would soon be out of phase with theirs
    cable_damping: float = 3e-3
    # velocity of a motor
    half_windows: tuple[int, ...] = (0, 1, 2, 4)  # samples on each side of the fitted one
    longest_window: float = 0.0081  # s, of a window: motion is nearly uniform in it
    velocity_sd: float = 0.04  # rad/s, above which the next longer window is taken, while there is one
    follow_up: float = 5e-3  # per sample, how fast the mean size of the errors is followed as it grows
    follow_down: float = 2.5e-3  # the same as it falls
    largest_step: float = 1.0  # rad, of a third difference; more is a false reading
    uniform: float = 0.01  # relative difference of two periods that count as equal


CONTACT = ContactThresholds()
