"""What the evaluations of the experiments allow, and over which times and ranges they measure."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class ThesisBounds:
    """Allowed deviations, relative unless a unit is given, and what is measured of a recording."""

    # every evaluation
    within: float = 0.02  # of a prediction: rounding of the recording, steps of the plant
    rounding: float = 1e-6  # s

    # thesis.transmission
    averaged_frequencies: int = 5  # neighbouring frequencies over which spectra are averaged
    lowest: float = 0.25  # of the lower resonance, from which the response is compared
    highest: float = 1.5  # of the upper resonance, up to which it is
    resonance_fit: float = 0.06  # relative to a frequency, range of the linear fit around it

    # thesis.groping
    position_known_after: float = 0.05  # s after a contact was detected, when its position is known better
    surface_height: float = 0.01  # m; the position along the link is the least certain
    surface_across: float = 0.02  # m; the position along the link is the least certain
    surface_along: float = 0.03  # m; the position along the link is the least certain

    # thesis.force_accuracy
    settled_force: float = 0.5  # s at the end of a step, over which a settled force is averaged
    least_contact: float = 0.02  # N; the force from which contact counts

    # thesis.limit_cycles
    neglected: float = 1.0  # allowed deviation of (5.8) and (5.9) over the left side of (5.11), which they neglect

    # thesis.one_link
    settled_span: float = 0.02  # of the step, remaining span of a settled response
    steady_span: float = 0.1  # relative change of the span between two windows, below which a cycle is steady
    stuck_speed: float = 1e-5  # rad/s of the joint; far below any motion, far above the noise of a stuck one

    # thesis.quantised
    neglected_delays: float = 0.05  # allowed of the period: the slip and two samples are neglected
    frictionless_end: float = 1.5  # s at the end of a run without friction
    neglected_harmonics: float = 0.15  # of the describing function, which neglects them

    # thesis.cables
    creep_left: float = 0.05  # of the creep, that is left of it: friction and acceleration of the rotor count as load
    rest_before: float = 0.1  # s before the motor turns, to average a small oscillation of the link

    # thesis.testbed
    standstills_until: float = 2.0  # s, enough for two standstills
    shortest_standstill: float = 0.005  # s, of a standstill
    least_swing: float = 1e-4  # N, far below any swing that is measured
    mode_transient: float = 0.4  # s after a step, before the growing mode dominates
    small_step: float = 0.3  # N, a step at the margin with the rod
    long_cycle: float = 0.05  # of a cycle with a long transient
    plain_steps: int = 2  # steps of a run, up to which the last one is drawn with its prediction

    # thesis.arm_forces
    steady_press: float = 0.8  # s at the end of a press
    slide_start: float = 0.5  # s of a slide before its evaluation
    force_at_rest: float = 0.05  # of the commanded force, at rest
    force_sliding: float = 0.2  # of the commanded force, while sliding: friction reverses with the motion
    estimate: float = 0.05  # of the true force
    smallest_estimate_error: float = 0.4  # N; a third of the standard deviation that is stated at 5 N
    position: float = 0.04  # m
    outside_set: float = 0.002  # m, by which a position may be outside the part that is stated to hold it
    latency: float = 0.1  # s until a push is detected
    wrong_link: float = 0.05  # of the time of a push, with another link or no detection
    push_in_motion: float = 0.15  # of the force of a push while the arm moves
    arm_cycle: float = 0.02  # of the force, peak to peak of a limit cycle
    single_slip: float = 0.2  # N, or a tenth of a small force; a joint that still slips once, by stiction, is no cycle


BOUNDS: Final = ThesisBounds()
