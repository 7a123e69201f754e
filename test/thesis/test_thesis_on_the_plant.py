"""Laws of the thesis on the simulated plant, where no figure and no experiment has them."""

import numpy as np
import pytest

from wam_studies.figures.closed_forms import line_of, resonances
from wam_studies.figures.stability import closed_loop_map, equal_node
from wam_studies.plant.ideal_testbed import (
    against_spring,
    force_step,
    frequencies,
    ideal_testbed,
    link_inertia,
    loop_arm,
    loop_node,
    released_plant,
)
from wam_theory.friction_model import FrictionNode
from wam_theory.linear_loop import routh_gain
from wam_theory.regimes import gamma_3, psi
from wam_theory.resonance import force_resonances
from wam_theory.stiction import breakaway_delay

ZETA = 0.25
CONTACT = 1464.28  # k_c of 5.6, N m/rad


def margin_of(node: FrictionNode) -> float:
    """G_I of (5.15), rad/s/(N m)."""
    return float(routh_gain(node.inertia, node.damping, node.transmission_stiffness, node.contact_stiffness))


@pytest.mark.parametrize("contact", [200.0, CONTACT, 6000.0, 2e4])
def test_plant_is_marginal_at_the_gain_of_routh_whatever_the_contact(contact: float) -> None:
    """(5.15), and 2.2: a stiffer environment needs a lower gain."""
    node = loop_node(loop_arm(20.0, (0.0, 0.0)), contact)
    for share in (0.99, 1.01):
        matrix, _ = closed_loop_map(node, share * margin_of(node))
        assert bool(np.abs(np.linalg.eigvals(matrix)).max() < 1.0) is (share < 1.0)


@pytest.mark.parametrize("share", [0.95, 1.05])
def test_errors_of_the_plant_grow_by_psi_beyond_gamma_3_and_shrink_before(share: float) -> None:
    node, gamma = equal_node(ZETA), share * float(gamma_3(ZETA))
    gain = gamma * margin_of(node)
    found = force_step(1.0, node.contact_stiffness, gain, node.damping, (2.0, 2.0), 0.7, step=6e-5)
    moves = np.abs(found.velocity) > 1e-5
    rests = np.flatnonzero(moves[:-1] & ~moves[1:])
    errors = np.abs(1.0 - found.force[rests])
    assert errors[1:6] / errors[:5] == pytest.approx(float(psi(gamma, ZETA)), rel=0.01)


def test_half_the_friction_halves_delay_and_travel_of_the_plants_motor() -> None:
    """5.7; the delay is that of (5.3)."""
    delays, travels = [], []
    for friction in (6.0, 3.0):
        found = force_step(5.0, CONTACT, 4.3e-2, 18.7, (friction, friction), 4.0)
        delays.append(found.time[np.abs(found.velocity) > 1e-5][0])
        predicted = breakaway_delay(4.3e-2, found.node.transmission_stiffness, friction, 5.0)
        assert delays[-1] == pytest.approx(float(predicted), abs=5e-4)  # two steps
        travels.append(np.ptp(found.motor[found.time > 0.15]))
    assert delays[1] / delays[0] == pytest.approx(0.5, rel=0.03)  # a step of the plant
    assert travels[1] / travels[0] == pytest.approx(0.5, rel=0.02)


@pytest.mark.parametrize("ratio", [14.0, 30.0])
def test_reducer_at_the_joint_has_the_higher_lower_resonance(ratio: float) -> None:
    """4.4, on 638 lb/in at the tip: (4.4) with the stiffness of (4.1), sqrt(N) less with the reducer at the motor."""
    contact, found = 93419.0, []
    for share in (1.0, 0.0):
        arm = line_of(ratio, share, None)
        own = arm.motors.inertia[0], link_inertia(arm), arm.circuits[0].stiffness, contact, ratio
        found.append(frequencies(released_plant(arm, against_spring(contact)))[0])
        assert found[-1] == pytest.approx(float(force_resonances(*own).lower), rel=0.01)
    assert found[0] > 1.5 * found[1]


@pytest.mark.slow
def test_in_domain_one_small_and_large_steps_of_the_plant_end_in_one_stiction_cycle() -> None:
    node, sizes = equal_node(ZETA), []
    for desired in (1.0, 20.0):
        gain = 0.8 * margin_of(node)
        found = force_step(desired, node.contact_stiffness, gain, node.damping, (1.3, 1.0), 4.0, step=1e-4)
        sizes.append(np.ptp(found.force[found.time > 2.0]))
    assert sizes[0] == pytest.approx(sizes[1], rel=0.01)
    assert sizes[0] > 0.2


def test_frequencies_of_the_plant_are_those_of_4_7_for_a_small_ratio_and_of_4_8_for_a_large_one() -> None:
    arm = ideal_testbed()
    rotor, link, cable = arm.motors.inertia[0], link_inertia(arm), arm.circuits[0].stiffness
    for contact in (0.1 * cable * link / rotor, 10.0 * cable * link / rotor):
        expected = np.sort(np.sqrt([contact / link, cable / rotor]))
        assert resonances(1.5, np.array([contact])).ravel() == pytest.approx(expected, rel=0.01)
    assert resonances(900.0, np.array([CONTACT]))[0] == pytest.approx(np.sqrt(CONTACT / rotor) / 900.0, rel=0.01)
