"""The study that docs/plant.md shows: its numbers stay within what the document promises."""

from dataclasses import replace

import pytest

from wam_studies.plant.effects import actuator_cycle_with_backlash, errors, table, torque_loop_response
from wam_studies.plant.ideal_testbed import IMMOVABLE, STEP, ideal_testbed, released_plant

# relative to theory
PROMISED = {
    "impact on a damped surface at 0.5 ms": 1e-2,  # a contact begins between two steps
    "backlash in the loop": 1e-2,
    "backlash in a torque loop": 2e-3,  # a step of the plant is a thousandth of a cycle
    "stiction cycle at 0.5 ms": 0.1,  # a step lets the motor go on within a slip; zeta 0.05
}


@pytest.mark.slow
def test_effects_are_as_near_to_theory_as_promised() -> None:
    found = errors()
    assert {name: error for name, error in found.items() if error >= PROMISED[name]} == {}
    assert all(f"| {name} |" in table(found) for name in PROMISED)


def torque_controlled(torque: float, speed: float) -> tuple[float, float]:
    """Torque of the cables on a link that turns at a speed, and power lost over the speed of the motor, N m.

    The motor's torque is against the link's motion for a positive speed, which the link's inertia keeps.
    """
    arm = ideal_testbed(damping=0.02)
    plant = released_plant(replace(arm, joints=replace(arm.joints, armature=(IMMOVABLE,))), creep=True)
    plant.data.qpos[0] = torque / arm.circuits[0].stiffness
    plant.data.qvel[:] = (14.0 * speed, speed)
    plant.step([torque], round(0.3 / STEP))
    theta, q = plant.theta[0], plant.q[0]
    plant.step([torque], round(0.5 / STEP))
    travel = plant.theta[0] - theta
    return plant.cable_torque[0], torque * (travel - 14.0 * (plant.q[0] - q)) / abs(travel)


@pytest.mark.slow
@pytest.mark.parametrize(("torque", "speed"), [(4.0, 0.5), (4.0, -0.5), (1.0, 0.5), (6.0, 0.5)])
def test_loss_under_torque_control_is_creep_and_no_friction_of_the_torque(torque: float, speed: float) -> None:
    """6.4.4 calls it friction, (6.22): the joint has all of the torque, and the motor turns further."""
    at_joint, loss = torque_controlled(torque, speed)
    assert at_joint == pytest.approx(14.0 * torque, rel=1e-6)
    by_hand = torque**2 / (9.525e-3 * 42258.1) + torque**2 * 3.74166 / (9.525e-3 * 158116.0)
    assert loss == pytest.approx(by_hand, rel=0.01)


@pytest.mark.slow
def test_play_is_without_effect_while_a_force_above_the_friction_keeps_the_flank_loaded() -> None:
    travel = actuator_cycle_with_backlash(20.0).plant
    assert travel == pytest.approx(travel[0], rel=0.01)


@pytest.mark.slow
def test_a_velocity_feedback_ends_the_cycle_of_backlash_in_a_torque_loop() -> None:
    """2.2, "eliminated through proper compensation": damping that also acts within the play."""
    for damping, ends in ((1.2, True), (0.5, False)):
        _, torque = torque_loop_response(477.0, damping)
        late = abs(torque[-2000:]).max() / abs(torque[:2000]).max()
        assert (late < 0.05) == ends
