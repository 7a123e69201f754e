"""What the guard accepts, how it refuses the rest, and that it is right."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from arms import BODY, LEVER, changed, one_joint

from wam_control.force.contact_place import anywhere_sd
from wam_control.force.force_loop import ForceCommand, ForceInput, ForceLoop, ForceLoopParameters
from wam_control.force.force_loop_parameters import task_of
from wam_control.force.sampled_loop import Feedback
from wam_control.force.stability_guard import GuardedContact, GuardedForces, StabilityGuard
from wam_control.velocity.servo_guard import ServoGuard
from wam_control.velocity.velocity_loop import VelocityLoopParameters
from wam_description.arm import Servo, Timing
from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError
from wam_description.signals import NO_CONTACT, Contact, State
from wam_studies.guard_validation import DIVERGES, GuardStudy, validate
from wam_theory.friction_verdict import Domain, friction_verdict, linear_margin, stable_errors
from wam_theory.loop_design import LoopDesign
from wam_theory.stick_slip import FrictionNode, IntegralLoop, Verdict, assess

WAM, TESTBED = (Configuration.load(packaged(name)) for name in ("wam", "testbed"))
ARM, CLOCK = WAM.shared.arm, WAM.shared.timing
PACKAGED = WAM.node("force_loop", ForceLoopParameters)
# the sensors of these tests are those of no arm at rest: no zero
OWN = replace(PACKAGED, sensing=replace(PACKAGED.sensing, zero_limit=0.0), guard=replace(PACKAGED.guard, mode="refuse"))
SERVO = WAM.shared.servo
FREE = replace(
    OWN.limits, joint_gain=0.0, joint_acceleration=0.0, doubt=1e9, contact_force=1e9, impact=0.0, free_travel=1e3
)
Loop = partial(ForceLoop, ARM, SERVO, timing=CLOCK)
UNSURE = anywhere_sd(ARM.covers, "outer_link", 0.28)


def guarded(own: ForceLoopParameters, **values: Any) -> ForceLoopParameters:
    return replace(own, guard=replace(own.guard, **values))


def bench(**values: Any) -> ForceLoopParameters:
    own = TESTBED.node("force_loop", ForceLoopParameters)
    return guarded(replace(own, **values), mode="refuse")


def bench_loop(own: ForceLoopParameters) -> ForceLoop:
    return ForceLoop(TESTBED.shared.arm, TESTBED.shared.servo, own, TESTBED.shared.timing)


def test_domains_are_those_of_figure_5_8() -> None:
    """J = b = K = 1: gamma is the gain; zeta 0.25, domain III from 2.186 on."""
    node = FrictionNode(1.0, 1.0, 2.0, 2.0, 1.0, 1.0)
    found = {gain: friction_verdict(node, IntegralLoop(gain)) for gain in (0.95, 1.1, 1.5, 2.0, 2.3)}
    assert [str(verdict.domain) for verdict in found.values()] == ["I", "II", "II", "II", "III"]
    assert found[0.95].stable_error == math.inf
    assert found[2.3].stable_error == 0.0
    for gain, largest_step in ((1.1, 25.3), (1.5, 3.45), (2.0, 1.17)):
        assert 0.3 * largest_step < found[gain].stable_error < largest_step


def test_in_domain_i_a_cycle_above_the_saturation_is_not_safe() -> None:
    """Close to its margin a loop with delay is kept swinging by Coulomb friction, with any step."""
    node = FrictionNode(1.0, 1.5012051, 2.1646104, 43.5124522, 1.0, 1.0)
    loop = IntegralLoop(0.1, 0.56938673, sample_period=0.7614, delay_samples=4)
    margin = linear_margin(node, loop)
    near = friction_verdict(node, replace(loop, gain=0.98052509 * margin))
    assert near.domain is Domain.I
    assert near.saturated_cycle == pytest.approx(2.1 * loop.error_limit, rel=0.05)
    assert "\nnot safe: lower the gain or the delay" in LoopDesign(node, loop, 0.0, 0.0, near).text()
    far = friction_verdict(node, replace(loop, gain=0.5 * margin))
    assert (near.stable_error, far.stable_error, far.saturated_cycle) == (0.0, math.inf, 0.0)


def test_a_loop_that_saturates_at_the_largest_stable_step_shakes_after_a_larger_one() -> None:
    node = FrictionNode(1.0, 1.0, 2.0, 2.0, 1.0, 1.0)
    largest_step = 3.45  # of gamma 1.5, by bisection
    at_the_step = IntegralLoop(1.5, error_limit=0.99 * largest_step)
    assert assess(node, at_the_step, 0.9 * largest_step).verdict is Verdict.SETTLED
    shakes = [assess(node, at_the_step, part * largest_step) for part in (1.5, 2.0, 3.0, 5.0, 10.0)]
    assert max(shake.peak_to_peak for shake in shakes if shake.verdict is Verdict.LIMIT_CYCLE) > 2.0 * largest_step
    accepted = replace(at_the_step, error_limit=stable_errors(node, IntegralLoop(1.5)).stable)
    for part in (1.5, 2.0, 3.0, 5.0, 10.0):
        assert assess(node, accepted, part * largest_step).verdict is Verdict.SETTLED


@pytest.mark.slow
def test_the_deadband_it_reports_removes_the_stiction_cycle() -> None:
    node, gain = FrictionNode(1.0, 0.5, 40.0, 20.0, 0.8, 1.2), 1e-3
    cycle = friction_verdict(node, IntegralLoop(gain)).cycle
    without = assess(node, IntegralLoop(gain), 3.0)
    assert without.verdict is Verdict.LIMIT_CYCLE
    assert cycle.peak_to_peak == pytest.approx(without.peak_to_peak, rel=0.05)
    assert cycle.deadband == pytest.approx(cycle.peak_to_peak / 2.0)
    with_it = IntegralLoop(gain, deadband=1.05 * cycle.deadband)
    assert assess(node, with_it, 3.0).verdict is Verdict.SETTLED
    too_small = IntegralLoop(gain, deadband=0.5 * cycle.deadband)
    assert assess(node, too_small, 3.0).verdict is Verdict.LIMIT_CYCLE


@pytest.mark.slow
def test_nothing_accepted_diverges_and_without_the_guard_much_would() -> None:
    study = GuardStudy(TESTBED, sets=10, testbed=0)
    found = list(map(validate, study.cases(8)))
    assert study.score(found).missed == []
    assert sum(one.end == DIVERGES for one in found) >= 2
    assert sum(one.is_accepted for one in found) >= 5, "a guard that refuses everything is none"


@pytest.mark.slow
def test_a_set_beyond_the_margin_is_refused_with_the_numbers_and_the_old_one_stays() -> None:
    loop = Loop(OWN)
    with pytest.raises(ParameterError) as refusal:
        loop.tune(replace(OWN, force_gain=(0.5,)))
    text = str(refusal.value)
    for part in (
        "force_gain [0.5, 0.5, 0.5] is ",
        "times the largest linearly stable one",
        "force along [0.343, 0, 0.939] in the base frame at 0.28 m along outer_link, posture [0, -1.8, 0, 1.45] rad",
        "domain II or III",
        "allowed: ",
    ):
        assert part in text
    assert loop.parameters == OWN
    allowed = float(text.split("force_gain up to [")[1].split(",")[0])
    loop.tune(replace(OWN, force_gain=(allowed,)))
    with pytest.raises(ParameterError):
        loop.tune(replace(OWN, force_gain=(1.02 * allowed,)))
    Loop(guarded(replace(OWN, force_gain=(0.5,)), mode="off"))
    warned = Loop(guarded(replace(OWN, force_gain=(0.5,)), mode="warn"))
    assert warned.supervision.report.is_warning
    assert warned.supervision.report.message.startswith("not stable: force_gain ")


@pytest.mark.slow
@pytest.mark.parametrize("gain", [0.3, 0.87])
def test_the_gain_that_a_refusal_allows_is_accepted(gain: float) -> None:
    for make, own in ((Loop, OWN), (bench_loop, bench())):
        with pytest.raises(ParameterError) as refusal:
            make(replace(own, force_gain=(gain,)))
        reported = str(refusal.value).split("force_gain up to [")[1].split("]")[0]
        assert make(replace(own, force_gain=(float(reported.split(",")[0]),))).supervision.assessment is not None


@pytest.mark.slow
@pytest.mark.parametrize("feedback", ["joint_sensors", "contact_estimate"])
def test_the_packaged_parameters_are_accepted_with_either_feedback(feedback: str) -> None:
    found = Loop(replace(PACKAGED, feedback=feedback)).supervision.assessment
    assert found is not None
    assert found.domain is Domain.I


@pytest.mark.slow
def test_a_bad_set_stops_the_loop_at_its_start() -> None:
    with pytest.raises(ParameterError, match=r"force_gain .* times the largest linearly stable one"):
        Loop(replace(OWN, force_gain=(9.0,)))
    assert Loop(replace(OWN, mode="open_loop", force_gain=(9.0,))).supervision.assessment is None


@pytest.mark.slow
@pytest.mark.parametrize(("gain", "is_lowered"), [(0.015, False), (1.0, True)])
def test_gains_of_joint_torques_are_taken_down_before_the_arm_moves(gain: float, is_lowered: bool) -> None:
    q, velocity = list(OWN.guard.posture), [0.0]
    state, free = State(q, [0.0] * 4, [1.0] * 4), State(q, [0.0] * 4, BODY.gravity_torque(q).tolist())
    loop = Loop(replace(OWN, torque_gain=(gain,), torque_error_limit=(1e3,), limits=FREE))
    while not any(velocity):
        velocity = loop.step(ForceInput(state, 0.005, free, NO_CONTACT, torque=[0.0, 1.0, 0.0, 0.0])).velocity
    factor = loop.supervision.factor
    assert (factor < 0.3) is is_lowered
    assert max(velocity) == pytest.approx(factor * gain, rel=1e-3)


@pytest.mark.slow
def test_a_stiffer_surface_leaves_less_gain_and_a_lag_of_the_feedback_no_more() -> None:
    def scale(own: ForceLoopParameters) -> float:
        assessment = Loop(guarded(own, mode="warn")).supervision.assessment
        assert assessment is not None
        return assessment.scale

    fast = replace(OWN, force_gain=(0.05,), feedback="contact_estimate")
    assert scale(guarded(fast, contact_stiffness=16000.0)) < 0.9 * scale(guarded(fast, contact_stiffness=1000.0))
    assert scale(guarded(fast, feedback_lag=0.02)) == pytest.approx(scale(guarded(fast, feedback_lag=0.0)), rel=0.01), (
        "a lag that steadies the loop is not relied on"
    )


STIFF = Servo(*(tuple(2.0 * gain for gain in gains) for gains in (SERVO.proportional_gain, SERVO.integral_gain)))


@pytest.mark.slow
def test_the_mean_over_a_cycle_of_the_dither_is_a_delay_that_leaves_less_gain() -> None:
    own = guarded(replace(OWN, feedback="contact_estimate"), contact_stiffness=1e5, mode="warn")
    own = guarded(own, posture=(-2.07, -0.11, -0.26, 1.58))
    margins = []
    for cycle in (0, 40):
        found = ForceLoop(ARM, SERVO, own, replace(CLOCK, dither_cycle=cycle)).supervision.assessment
        assert found is not None
        margins.append(found.scale)
    assert margins[1] < 0.6 * margins[0]


@pytest.mark.slow
def test_the_guard_relies_on_the_gains_of_the_velocity_loop() -> None:
    own = replace(OWN, force_gain=(0.09,))
    with pytest.raises(ParameterError, match="times the largest linearly stable one"):
        ForceLoop(ARM, STIFF, own, CLOCK)
    slightly = Servo(tuple(0.9 * gain for gain in SERVO.proportional_gain), SERVO.integral_gain)
    usual, other = (ForceLoop(ARM, servo, own, CLOCK).supervision.assessment for servo in (SERVO, slightly))
    assert usual is not None
    assert other is not None
    assert other.scale != usual.scale


@pytest.mark.slow
def test_gains_of_the_velocity_loop_are_taken_where_the_guard_only_warns_or_is_off() -> None:
    warned, silent = (
        ForceLoop(ARM, STIFF, guarded(replace(OWN, force_gain=(0.09,)), mode=mode), CLOCK) for mode in ("warn", "off")
    )
    assert warned.supervision.report.is_warning
    assert silent.supervision.assessment is None


def test_mode_limit_lowers_the_gains_to_what_a_refusal_allows() -> None:
    high = bench(force_gain=(0.2,), force_error_limit=(5.0,), force_proportional_gain=(0.0,))
    with pytest.raises(ParameterError, match="domain II or III; allowed: force_gain up to") as refusal:
        bench_loop(high)
    allowed = float(str(refusal.value).split("force_gain up to [")[1].split(",")[0])
    lowered = bench_loop(guarded(high, mode="limit"))
    assert lowered.parameters.force_gain == pytest.approx([allowed], rel=0.01)
    assert "lowered to be stable: force_gain [" in lowered.supervision.report.message
    assert lowered.supervision.assessment is not None
    assert lowered.supervision.assessment.domain is Domain.I


def test_mode_limit_lowers_the_posture_gain_where_the_velocity_loop_is_too_slow_for_it() -> None:
    slow = replace(SERVO, proportional_gain=tuple(0.4 * gain for gain in SERVO.proportional_gain))
    ServoGuard(ARM, CLOCK, WAM.node("velocity_loop", VelocityLoopParameters).guard).require_stable(slow)
    with pytest.raises(ParameterError, match=r"lower posture_gain to [\d.]+$") as refusal:
        ForceLoop(ARM, slow, OWN, CLOCK)
    ForceLoop(ARM, slow, replace(OWN, posture_gain=float(str(refusal.value).rpartition(" ")[2])), CLOCK)
    loop = ForceLoop(ARM, slow, guarded(OWN, mode="limit"), CLOCK)
    assert loop.parameters.posture_gain < 0.5 * OWN.posture_gain
    assert "lowered to be stable: posture_gain [" in loop.supervision.report.message


def follow(
    loop: ForceLoop,
    q: Sequence[float],
    contact: Contact = NO_CONTACT,
    periods: int = 300,
    force: tuple[float, float, float] = (0.0, 0.0, -6.0),
) -> float:
    """Factor of the gains after a while at a pose with a force commanded across the outer link."""
    state = State(list(q), [0.0] * len(q), [1.0] * len(q))
    cover = loop.parameters.contact_cover
    for _ in range(periods):
        command = ForceCommand(cover, force)
        loop.step(ForceInput(state, 0.005, state, contact, [0.0] * len(q), command=command))
    assert loop.supervision.watch is not None
    return loop.supervision.watch.factor


STIFF_POSE = (-0.5, -0.3, 0.3, 1.3)  # where the joint sensors see the foam through a lesser margin than at the box


@pytest.mark.slow
def test_gains_are_taken_down_where_the_pose_would_leave_the_domain_and_come_back() -> None:
    own = replace(OWN, force_gain=(0.09,))
    loop, here = Loop(own), list(own.guard.posture)
    seen = loop.supervision
    assert seen.report.facts["pose of margin here"].startswith("that of `margin`, until")
    assert follow(loop, here) == 1.0
    assert seen.watch is not None
    assert seen.report.facts["margin here"].startswith(f"{seen.watch.scale:.4g}"), "also where the factor stays"
    factor = follow(loop, STIFF_POSE)
    assert factor < 0.75
    assert seen.report.facts["pose of margin here"].startswith("posture [-0.5, -0.3, 0.3, 1.3] rad, when a force")
    assert f"each is multiplied by {factor:.3g}" in seen.report.message
    guard = StabilityGuard(ARM, SERVO, CLOCK, own.guard, own.sensing)
    task = task_of(loop.parameters)
    touch = GuardedContact(STIFF_POSE, "outer_link", 0.28, UNSURE, normal(guard, STIFF_POSE), 6.0)
    taken = replace(task.law, gain=tuple(factor * gain for gain in task.law.gain))
    share = own.guard.stability_fraction
    assert min(guard.scales(task._replace(law=taken), [touch])) == pytest.approx(1.0 / share, rel=0.02)
    assert min(guard.scales(task, [touch])) < 1.0 / share, "without the factor the margin is spent"
    assert follow(loop, here) == 1.0
    warned = Loop(guarded(own, mode="warn"))
    follow(warned, STIFF_POSE)
    assert warned.supervision.report.facts["gains multiplied by"] == "1"


def test_gains_far_above_their_margin_are_followed_where_the_guard_only_warns() -> None:
    own = guarded(bench(force_gain=(5.0,)), mode="warn")
    loop = bench_loop(own)
    assert loop.supervision.assessment is not None
    assert 0.0 < loop.supervision.assessment.scale < 0.01
    assert follow(loop, own.guard.posture, force=(0.0, 1.0, 0.0)) == 0.0
    assert loop.supervision.report.facts["gains multiplied by"] == "1"


def normal(guard: StabilityGuard, q: Sequence[float]) -> tuple[float, float, float]:
    """Of the command of `follow`."""
    x, y, z = guard.contacts(q, "outer_link", 0.28, UNSURE)[-1].direction
    return -x, -y, -z


@pytest.mark.slow
def test_the_velocity_obeys_the_factor() -> None:
    loop = Loop(replace(OWN, force_gain=(0.09,), force_error_limit=(1e9,), joint_speed_limit=4.0, limits=FREE))
    follow(loop, OWN.guard.posture)
    state, command = State(list(STIFF_POSE), [0.0] * 4, [1.0] * 4), ForceCommand("outer_link", (0.0, 0.0, -6.0))
    speeds = []
    for _ in range(300):
        out = loop.step(ForceInput(state, 0.005, state, NO_CONTACT, command=command, posture=list(STIFF_POSE)))
        speeds.append(float(np.linalg.norm(out.velocity)) / abs(out.error[2]))
    assert loop.supervision.factor < 0.75
    assert speeds[-1] == pytest.approx(loop.supervision.factor * speeds[0], rel=1e-6)


ROD = changed(one_joint(), motors={"inertia": (2e-3,)}, joints={"viscous_friction": (4.0,)})
FAST = Timing("lockstep", 1e-4, 1, 10, 0, 10, 0, 5.0, 0.0, 0, 0)


@pytest.mark.parametrize("place", [0.4, 0.6])
def test_the_margin_of_a_joint_torque_follows_the_square_of_the_contact_position(place: float) -> None:
    """Routh, (5.15): the margin is b/J (1/k_tr + 1/k_c), and k_c at the joint goes with the square of the place.

    The loop samples, at 1 kHz, and its servo is not rigid, which takes some per cent.
    """
    own = guarded(bench(force_filter=0.0), contact_stiffness=1500.0, stability_fraction=1.0, feedback_lag=0.0)
    guard = StabilityGuard(ROD, Servo((10.0,), (1000.0,)), FAST, own.guard, own.sensing)
    task, one = task_of(own), np.eye(1)

    def margin(at: float) -> float:
        pressed = [
            GuardedForces((each,), one, one, np.array([0.004]), np.zeros(1), 0.0 * one, 0.0 * one, ())
            for each in guard.contacts([0.0], "tube", at, 0.0)
        ]
        return min(guard.scales(task._replace(feedback=Feedback("contact_estimate", (), 0.0)), pressed))

    ktr = 14.0**2 * 8.33
    expected = (1.0 / ktr + 1.0 / (1500.0 * place**2)) / (1.0 / ktr + 1.0 / (1500.0 * LEVER**2))
    assert margin(place) / margin(LEVER) == pytest.approx(expected, rel=0.1)


@pytest.mark.slow
def test_a_force_that_turns_is_judged_again_though_the_arm_is_at_rest() -> None:
    own = guarded(replace(OWN, force_gain=(0.09,)), mode="warn")
    along_y, along_z = (0.0, -6.0, 0.0), (0.0, 0.0, -6.0)
    fresh = {}
    for force in (along_y, along_z):
        loop = Loop(own)
        follow(loop, STIFF_POSE, force=force)
        assert loop.supervision.watch is not None
        fresh[force] = loop.supervision.watch.scale
    assert abs(fresh[along_y] / fresh[along_z] - 1.0) > 0.1
    for force in (along_y, along_z):
        follow(loop, STIFF_POSE, force=force)
        assert loop.supervision.watch is not None
        assert loop.supervision.watch.scale == fresh[force]
