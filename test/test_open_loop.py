"""Force without feedback: the play of friction, and errors over the workspace within what statics allows."""

import numpy as np
import pytest

from wam_description.configuration import Configuration, packaged
from wam_driver.driver import DriverParameters
from wam_experiments.figures.open_loop import KNOWN, OpenLoopArm
from wam_theory.stiction import play


def test_friction_is_a_deadband_from_rest_and_a_play_of_twice_its_width_on_the_way_back() -> None:
    up, down = np.linspace(0.0, 10.0, 101), np.linspace(10.0, 0.0, 101)
    force = play(np.concatenate([up, down]), 3.0)
    np.testing.assert_allclose(force[:101], np.maximum(up - 3.0, 0.0))
    np.testing.assert_allclose(force[101:], np.minimum(7.0, down + 3.0))
    assert play(up, 0.0) == pytest.approx(up)


def test_play_is_where_a_friction_node_between_two_springs_comes_to_rest() -> None:
    """By relaxation: the node moves while springs pull it with more than its friction."""
    desired, friction, x, found = 8.0 * np.sin(np.linspace(0.0, 9.0, 400)) ** 2, 1.5, 0.0, []
    for wanted in desired:  # the motor is a torque source: the node feels F_des and the contact spring, k_c = 2
        net = wanted - 2.0 * x
        if abs(net) > friction:
            x += (net - np.sign(net) * friction) / 2.0
        found.append(2.0 * x)
    np.testing.assert_allclose(play(desired, friction), found, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("quiet", [True, False])
def test_no_error_is_beyond_that_of_statics_and_some_are_near_it(quiet: bool) -> None:
    arm = OpenLoopArm(quiet)
    shares = [abs(arm.error(q, 0.3 * f)) / arm.bound(q, 0.3 * f) for q, f in arm.pushes()[:12]]
    assert 0.3 < max(shares) < 1.0


@pytest.mark.slow
def test_feed_forward_of_friction_and_cogging_halves_the_error() -> None:
    plain, known = OpenLoopArm(False), OpenLoopArm(False, KNOWN)
    pushes = plain.pushes()[:12]
    before, after = (np.median([abs(arm.error(q, 0.1 * f)) for q, f in pushes]) for arm in (plain, known))
    assert after < 0.65 * before


def test_arm_with_cogging_has_the_measured_breakaway_torque_of_its_motors() -> None:
    """Its friction, that by tension and its cogging are together the friction of config/wam.yaml."""
    measured = Configuration.load(packaged("wam")).shared.arm.motors.static_friction
    parts = Configuration.load(packaged("thesis-effects"))
    arm, effects = parts.shared.arm, parts.node("driver", DriverParameters).effects
    tension = 2.0 * np.multiply(effects.tension_friction, arm.cables.pretension)
    together = arm.motors.static_friction + tension + np.array(effects.ripples.amplitude[:4])
    np.testing.assert_allclose(together, measured, rtol=0.01)
