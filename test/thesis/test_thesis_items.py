"""Items of the thesis: the product's numbers next to those of `own_thesis`, which imports nothing of it.

Within 1 % of what the thesis prints, within 1e-9 where it has an equation.
"""

import ast
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import own_thesis as own
import pytest
from own_thesis import INCH, INCH_POUND, OUNCE_INCH_SECOND2, POUND, Node

from wam_description.configuration import Configuration, packaged
from wam_description.rigid_body import RigidBody
from wam_studies.scorecard import measures
from wam_theory import cable, describing_function, linear_loop, regimes, requisites, resonance, stiction
from wam_theory import tension_element as element
from wam_theory.planar_contact import planar_contact

EQUATION, PRINTED = 1e-9, 0.01
N, CONTACT = 14.0, 1464.28  # of 5.6
ROTOR, LINK = 0.0057 * OUNCE_INCH_SECOND2, 64.0 * OUNCE_INCH_SECOND2  # 4.3.2
K_TR = 2.0 * 262.0 * POUND / INCH * (0.375 * INCH) ** 2  # of its two strands, at the motor
TWO = ROTOR, LINK, K_TR, CONTACT, N
UNIT = Node(1.0, 1.0, 2.0, 2.0, 1.0, 1.0)  # J = b = K = 1, k_tr = k_c: figure 5.7
ZETA = 0.25  # of UNIT
STICKY = Node(1.0, 0.5, 2.0, 2.0, 1.0, 1.4)
OMEGA = 1.0 + math.exp(-math.pi * 0.125 / math.sqrt(1.0 - 0.125**2))  # (5.10) of it
SLOW = 1e-3  # G_I, so that (5.11) is far below 1
TESTBED = Node(0.4519, 0.05 * 2.0 * math.sqrt(0.4519 * 3096.1), 1631.8, 1464.3)  # 5.6, zeta 0.05
POSE = (0.3, -0.7, 0.5, 0.9)
STRAIN = 60.0 / 0.375 / 9500.0  # 6.4.5: (T2 - T1)/EA at the peak torque of 60 in-lb
WAM = Configuration.load(packaged("wam"))
ARM, SCORES = WAM.shared.arm, measures(WAM)


def acceleration(ratio: float) -> float:
    """Of the link without contact, rad/s^2 per torque of the motor, its cable rigid."""
    return ratio / (LINK + ratio**2 * ROTOR)


def psi(gamma: float) -> float:
    (_, first), (_, second) = own.breakaways(UNIT, gamma, 1.0, 2)
    return -second / first


def overshoot() -> float:
    """Travel of a slip with the motor at rest over that to its equilibrium."""
    _, x, _ = own.slip(STICKY, 1e-15, 0.0, STICKY.static / STICKY.k_tr, 1.0)
    return x * (STICKY.k_tr + STICKY.k_c) / (STICKY.static - STICKY.dynamic)


def stiction_period() -> float:
    """Two waits of a symmetric cycle: from the spring that a slip leaves to the opposite friction."""
    left = STICKY.static - OMEGA * (STICKY.static - STICKY.dynamic)
    error = 0.5 * OMEGA * (STICKY.static - STICKY.dynamic) * STICKY.k_c / (STICKY.k_tr + STICKY.k_c)
    return 2.0 * (STICKY.static + left) / (STICKY.k_tr * SLOW * error)


def predicted_cycle() -> float:
    """(5.16): the damping that friction must add at gamma 1.5, as amplitude of F_c."""
    damping = own.bisect(lambda b: own.marginal_gain(UNIT._replace(damping=b)) > 1.5, 1.0, 3.0)
    speed = own.square_wave_gain(damping - UNIT.damping)
    frequency = np.abs(np.linalg.eigvals(own.loop(UNIT._replace(damping=damping), 1.5)).imag).max()
    return float(UNIT.k_c * speed / frequency)


def efficiency_of_testbed() -> float:
    """Of its two stages, in pounds and inches."""
    return cable.efficiency(cable.stage_loss(60.0, 0.375, [9500.0, 9500.0 * 3.74166], 1.0, [1.0, 3.74166]))


def torque_for_ten_pounds() -> Any:
    """Of each motor, N m, for a vertical force at the tip: (A.7), and (A.5) of a 2:1 differential by its turns."""
    first, second, third, fourth = own.wam_jacobian(POSE)[2] * 10.0 * INCH_POUND
    return (
        first / 29.97,
        -second / 2.0 / 30.4 - third / 2.0 / 15.2,
        second / 2.0 / 30.4 - third / 2.0 / 15.2,
        fourth / 19.15,
    )


def full_slip() -> float:
    """Difference from the pretension at which the arc of slip is the whole of pi, by bisection."""

    def is_beyond(d: float) -> bool:
        return math.log((100.0 + d) / (100.0 - d)) > 0.2 * math.pi

    return own.bisect(is_beyond, 0.0, 99.0)


def of_equations() -> Iterator[tuple[str, Any, Any]]:
    """Section and what; the own number; that of the product."""
    yield (
        "1.1.1 frequency of two masses",
        own.two_masses(1.0, 3.0, 2.0, 5.0, 1.0)[0],
        resonance.force_resonances(1.0, 3.0, 2.0, 5.0, 1.0).lower,
    )
    yield "2.1.1 (2.1) force", 7.0, planar_contact(7.0 * (0.5 * math.cos(1.0) + 0.2), 1.4, 0.5, 1.0).force
    yield "2.1.1 (2.2) position", 0.2, planar_contact(7.0 * (0.5 + 0.2), 1.4, 0.5, 0.0).position
    yield "3.2.2 (3.1) by energy", math.sqrt(2.0 * 900.0 * 0.5 * 3.0 * 0.4**2), requisites.impact_force(0.4, 3.0, 900.0)
    yield "3.2.4 (3.2) two bars", 1.0 - 0.05 / 0.4, requisites.useful_length(10.0, requisites.secure_angle(0.4))
    yield "3.2.4 (3.3) cylinder", 2.0 * 0.4 * (1.0 - 0.05 / 0.4), requisites.largest_cylinder(10.0, 0.4)
    yield (
        "4.1.2 (4.1) two lines in series",
        1.0 / (0.3 / (N**2 * 5.0) + 0.7 / (N * 5.0)),
        cable.stiffness_with_reducer(5.0, 1.0, N, 0.3),
    )
    yield (
        "4.1.2 N_m, of the greatest acceleration",
        own.bisect(lambda n: acceleration(1.1 * n) < acceleration(n / 1.1), 1.0, 1e3),
        resonance.matched_ratio(ROTOR, LINK),
    )
    yield "4.2 (4.2)", math.sqrt(N**2 * K_TR / LINK), resonance.position_bandwidth(LINK, K_TR, N)
    yield "4.3.1 (4.3) at 20 Hz", own.force_for_torque(20.0, *TWO), abs(resonance.force_transfer(40j * math.pi, *TWO))
    yield "4.3.1 (4.4) both", own.two_masses(*TWO), resonance.force_resonances(*TWO)
    yield (
        "4.3.1 (4.6), a rotor on the cable of a held link",
        np.abs(np.linalg.eigvals([[0.0, 1.0], [-K_TR / ROTOR, 0.0]])).max(),
        resonance.hard_contact_bandwidth(ROTOR, K_TR),
    )
    yield (
        "4.4 (4.10) where the asymptotes cross",
        own.bisect(lambda k: k / ROTOR > CONTACT / LINK, 1e-6, 1e3),
        resonance.best_transmission_stiffness(ROTOR, LINK, CONTACT),
    )
    yield "5.3 (5.1)", 20.0 / (1.0 + 3.0), linear_loop.proportional_error(20.0, 3.0 / 7.0, 7.0)
    yield (
        "5.3 (5.2)",
        -1.0 / math.log(own.exponential(np.array([[-0.4 * 7.0]]), 1.0)[0, 0]),
        linear_loop.integral_time_constant(0.4, 7.0),
    )
    yield "5.4 (5.3)", 1.5 / (0.4 * 2.0 * 3.0), stiction.breakaway_delay(0.4, 2.0, 1.5, 3.0)
    yield "5.4 (5.8)", OMEGA * 0.4 * 0.5, stiction.stiction_cycle_force(2.0, 2.0, 1.4, 1.0, 0.125)
    yield "5.4 (5.9)", stiction_period(), stiction.stiction_cycle_period(SLOW, 2.0, 2.0, 1.4, 1.0, 0.125)
    yield "5.4 (5.10)", overshoot(), stiction.slip_overshoot(0.125)
    yield "5.5 (5.15)", own.marginal_gain(UNIT), linear_loop.routh_gain(*UNIT[:4])
    yield "5.5.1 N(A)", own.square_wave_gain(0.7), describing_function.coulomb_describing_function(1.0, 0.7)
    yield "5.5.1 (5.16)", predicted_cycle(), describing_function.predicted_unstable_cycle(1.5, *UNIT[:4], 1.0).force
    yield "5.5.2 (5.18) Psi", psi(1.5), regimes.psi(1.5, ZETA)
    yield "5.5.2 Psi in domain I", psi(0.9), regimes.psi(0.9, ZETA)
    yield "5.5.2 gamma_III", own.bisect(lambda g: psi(g) > 1.0, 1.5, 3.0), regimes.gamma_3(ZETA)
    yield "5.5.3 (5.20)", (1.5 - -1.5) / 2.0, regimes.actuator_cycle(1.5, 2.0, 0.9, ZETA)
    yield "5.5.3 (5.21)", 0.5 * 2.0 * (1.5 / 2.0) ** 2, regimes.actuator_cycle_work(1.5, 2.0)
    yield "5.5.3 (5.22)", 0.5625 / (2.0 * 1.5 / (0.4 * 2.0 * 3.0)), regimes.actuator_cycle_power(0.4, 3.0, 1.5)
    yield (
        "5.6 sampled at 50 Hz",
        own.sampled_margin(TESTBED, 0.02, False),
        linear_loop.sampled_margin(*TESTBED[:4], 0.02).gain,
    )
    yield (
        "5.6 one sample later",
        own.sampled_margin(TESTBED, 0.02, True),
        linear_loop.sampled_margin(*TESTBED[:4], 0.02, 1).gain,
    )
    yield "5.7 (5.23)", 1.0 / (1.0 / (1.0 / 2.0 + 1.0 / 2.0 + 0.5)), linear_loop.routh_gain(*UNIT[:4], 0.5)
    yield "6.2.4 (6.15)", (1.0 - STRAIN) ** 2, efficiency_of_testbed()
    yield "6.2.5 (6.16)", own.arc_of_slip(100.0, 150.0, 0.2), element.slip_arc(100.0, 150.0, 0.2)
    yield "6.2.5 the whole arc slips", math.pi, element.slip_arc(100.0 - full_slip(), 100.0 + full_slip(), 0.2)
    yield "6.3.1 (6.19) out and back", 2.0 * 5.0 * 3.0 / 0.01 / 4e4, cable.creep(10.0, 3.0, 0.01, 4e4)
    yield "6.4.4 (6.22) of a pulley", 0.5 * (3.0 / 0.01) ** 2 / 4e4 * 0.01, element.coulomb_like_torque(3.0, 0.01, 4e4)
    yield (
        "7.2.2 torque of the motors for 10 lb at the tip",
        torque_for_ten_pounds(),
        ARM.transmission.joint_from_motor.T @ RigidBody(ARM).tool_jacobian(POSE)[2] * 10.0 * POUND,
    )
    yield "A (A.3) tip", own.wam_frames(POSE)[-1][:3, 3] * INCH, RigidBody(ARM).tool_pose(POSE).position
    yield "A (A.6) differential", [[-30.4, -15.2], [30.4, -15.2]], ARM.transmission.motor_from_joint[1:3, 1:3]
    yield "A (A.7) Jacobian", own.wam_jacobian(POSE) * INCH, RigidBody(ARM).tool_jacobian(POSE)


def of_print() -> Iterator[tuple[str, Any, Any]]:
    """The same of numbers that the thesis prints."""
    yield "4.3.2 (4.9), 638 lb/in", 638.0 * POUND * INCH * 36.0**2, resonance.best_contact_stiffness(ROTOR, LINK, K_TR)
    yield "5.6 (5.15) of the testbed", 1.21e-3 / INCH_POUND, linear_loop.routh_gain(*TESTBED[:4])
    yield "6.4.5 two stages, 0.966 in print", 0.966, efficiency_of_testbed()
    yield "6.4.5 one stage, 0.983 in print", 0.983, cable.efficiency([STRAIN])
    yield "6.5 (6.23), 2 in-lb in print", 2.0, np.ptp(cable.eccentric_ripple(0.01, 50.0, np.linspace(0.0, 6.3, 1000)))
    yield "7.2.1 aspect ratios of 5 and 9", (22.0 / 4.4, 18.0 / 2.0), SCORES.aspect_ratio
    yield "7.2.2 efficiency of two stages at 43 in-lb", (1.0 - 43.0 / 0.375 / 9500.0) ** 2, SCORES.efficiency
    yield "7.2.2 pretension over half of the full-torque tension", 1.0, SCORES.pretension


def test_item_is_that_of_an_own_computation() -> None:
    count = 0
    for within, items in ((EQUATION, of_equations()), (PRINTED, of_print())):
        for name, own_number, of_product in items:
            np.testing.assert_allclose(of_product, own_number, rtol=within, atol=1e-2 * within, err_msg=name)
            count += 1
    assert count == 48


def test_own_computation_imports_nothing_of_the_product() -> None:
    tree = ast.parse(Path(own.__file__).read_text(encoding="utf-8"))
    modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    modules |= {name.name for node in ast.walk(tree) if isinstance(node, ast.Import) for name in node.names}
    assert {str(module).partition(".")[0] for module in modules} <= sys.stdlib_module_names | {"numpy"}


def test_margin_falls_with_the_stiffness_of_the_environment() -> None:
    gains = [own.marginal_gain(UNIT._replace(k_c=k)) for k in (0.5, 2.0, 8.0, 32.0)]
    assert gains == sorted(gains, reverse=True)
    assert gains == pytest.approx(linear_loop.routh_gain(1.0, 1.0, 2.0, [0.5, 2.0, 8.0, 32.0]), rel=EQUATION)


def test_a_tenth_of_the_stiffness_costs_6_9_times_the_torque_at_50_hz() -> None:
    stiff, soft = (own.force_for_torque(50.0, ROTOR, LINK, k, CONTACT, N) for k in (K_TR, 0.1 * K_TR))
    assert stiff / soft == pytest.approx(6.94, rel=0.01)


def test_cycle_is_larger_than_5_8_where_5_11_is_near_one() -> None:
    """At zeta 0.5; with less damping the loop is beyond the Routh limit at this number."""
    node, damped = STICKY._replace(damping=2.0), math.sqrt(1.0 - 0.5**2)
    jump = (1.0 + math.exp(-math.pi * 0.5 / damped)) * 0.4 * 0.5
    for number, size in ((0.01, 1.0), (0.98, 1.505)):
        errors = [e for _, e in own.breakaways(node, 2.0 * number * damped, 2.0, 40)[-3:]]
        assert np.abs(np.diff(errors)) / jump == pytest.approx([size] * 2, rel=0.01)


def test_a_higher_gain_costs_power_and_margin_and_saves_delay() -> None:
    gains = np.array([0.3, 0.6])
    delay, power = stiction.breakaway_delay(gains, 2.0, 1.5, 3.0), regimes.actuator_cycle_power(gains, 3.0, 1.5)
    of_margin = linear_loop.gain_ratio(gains, *UNIT[:4])
    assert [values[1] / values[0] for values in (delay, power, of_margin)] == pytest.approx([0.5, 2.0, 2.0])


def test_loss_of_a_stage_goes_with_its_tension() -> None:
    """6.4.1: the same power at twice the speed has half of the tension; the loss is that of the speeds, (6.3)."""
    ea, loose, difference = 4e4, 100.0, np.array([600.0, 300.0])
    lost = 1.0 - (1.0 + loose / ea) / (1.0 + (loose + difference) / ea)
    assert cable.stage_loss(difference * 0.01, 0.01, ea, 1.0, 1.0) == pytest.approx(lost, rel=0.02)
