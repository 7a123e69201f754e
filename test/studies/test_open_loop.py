"""Force without feedback: the play of friction, and errors over the workspace within what statics allows."""

import numpy as np
import pytest
from arms import CONFIGURATION, WAM, changed

from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError
from wam_driver.driver import Driver, DriverParameters
from wam_driver.plant import Plant
from wam_studies.figures.conditions import CASE
from wam_studies.figures.open_loop import OpenLoopArm
from wam_studies.plant.ideal_testbed import EMPTY
from wam_theory.stiction import play


def test_friction_is_a_deadband_from_rest_and_a_play_of_twice_its_width_on_the_way_back() -> None:
    up, down = np.linspace(0.0, 10.0, 101), np.linspace(10.0, 0.0, 101)
    force = play(np.concatenate([up, down]), 3.0)
    np.testing.assert_allclose(force[:101], np.maximum(up - 3.0, 0.0))
    np.testing.assert_allclose(force[101:], np.minimum(7.0, down + 3.0))
    assert play(up, 0.0) == pytest.approx(up)


@pytest.mark.slow
@pytest.mark.parametrize("quiet", [True, False])
def test_no_error_is_beyond_that_of_statics_and_some_are_near_it(quiet: bool) -> None:
    arm = OpenLoopArm(quiet)
    shares = [abs(arm.error(q, 0.3 * f)) / arm.bound(q, 0.3 * f) for q, f in arm.pushes()[:12]]
    assert 0.3 < max(shares) < 1.0


@pytest.mark.slow
def test_feed_forward_of_friction_and_cogging_halves_the_error() -> None:
    plain, known = OpenLoopArm(False), OpenLoopArm(False, CASE.fed_forward)
    pushes = plain.pushes()[:12]
    before, after = (np.median([abs(arm.error(q, 0.1 * f)) for q, f in pushes]) for arm in (plain, known))
    assert after < 0.65 * before


def test_arm_with_cogging_has_the_measured_breakaway_torque_of_its_motors() -> None:
    """Its friction, that by tension and its cogging are together the friction of config/wam.yaml."""
    for name in ("wam", "plain-motors", "thesis-effects"):
        parts = Configuration.load(packaged(name))
        arm, effects = parts.shared.arm, parts.node("driver", DriverParameters).effects
        tension = 2.0 * np.multiply(effects.tension_friction, arm.cables.pretension)
        together = effects.dry(arm).static_friction + tension + np.array(effects.ripples.amplitude[:4])
        np.testing.assert_allclose(together, WAM.motors.static_friction, rtol=0.01)


def breakaway(q: float) -> float:
    """Torque at which rotor 1 of the configured plant, without gravity, starts to turn from a joint angle q."""
    arm = changed(WAM, joints={"start": (q, *WAM.joints.start[1:])}, gravity=(0.0, 0.0, 0.0))
    plant = Plant(arm, EMPTY, CONFIGURATION.node("driver", DriverParameters).effects, CASE.open_loop_step)
    plant.brake(False)
    begin, torque = plant.theta[0], 0.03
    while abs(plant.theta[0] - begin) < 1e-7:
        torque += 5e-5
        assert torque < 0.1
        plant.step([torque, 0.0, 0.0, 0.0])
    return torque


def test_configured_rotor_breaks_away_at_the_measured_torque_where_cogging_is_against_it() -> None:
    """And a twice the cogging below it where cogging helps."""
    turn = 2.0 * np.pi / 24 * WAM.joint_from_motor[0]
    torques = [breakaway(turn * k / 12) for k in range(12)]
    assert max(torques) == pytest.approx(WAM.motors.static_friction[0], rel=0.01)
    assert min(torques) == pytest.approx(WAM.motors.static_friction[0] - 2.0 * 0.00128, rel=0.005)


def test_more_cogging_than_friction_that_includes_it_is_refused_with_what_to_do() -> None:
    smooth = CONFIGURATION.with_values(
        {"arm.motors.static_friction": [0.004] * 4, "arm.motors.dynamic_friction": [0.0] * 4}
    )
    with pytest.raises(
        ParameterError, match=r"motor1 are 0\.00508.*up to its static friction, 0\.004.*included_in_friction: false"
    ):
        Driver(smooth.shared, smooth.node("driver", DriverParameters))
    added = smooth.with_values({"driver:effects.included_in_friction": False})
    Driver(added.shared, added.node("driver", DriverParameters))
