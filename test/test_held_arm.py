"""An arm that holds its position gives way to a surface that comes to it, on the simulated arm and by itself."""

from typing import Any

import numpy as np
import pytest
from arms import CONFIGURATION, WAM
from test_force_lasting import DIRECTION, OUTER, PLACE, POSE
from test_force_plant import MOTORS

from wam_control.arm_push import ArmPush
from wam_control.force_hold import ForceReaction
from wam_control.held_arm import HeldArm
from wam_control.scenario import ScenarioStep
from wam_description.rigid_body import RigidBody
from wam_description.signals import ForceCommand
from wam_experiments.force_benchmark.surfaces import Surface, obstacles
from wam_experiments.force_benchmark.tasks import RELEASE, triple
from wam_experiments.force_benchmark.trial import with_accepted_gain
from wam_sim.simulation import Simulation

pytestmark = pytest.mark.slow  # seconds each: the plant in contact

BODY = RigidBody(WAM)
DOWN = np.array(DIRECTION)
ASIDE = BODY.cover_pose(POSE, OUTER).rotation[:, 2]
NOTHING_NEAR = 0.165  # m, further than the arm may move through free space


def came(
    step: ScenarioStep, begin: float, cover: str = OUTER, place: float = PLACE, away: float = 0.0, **changes: Any
) -> tuple[float, ForceReaction, str]:
    """Largest force of a surface that comes at 20 mm/s by 30 mm, N, and what the arm reports at the end."""
    across = -BODY.cover_pose(POSE, cover).rotation[:, 1]
    surface = Surface(cover, place, triple(across), 4000.0, 0.3, False, triple(-0.03 * across), 0.106, RELEASE + begin)
    given = {
        "arm.joints.start": list(POSE),
        "force_loop:guard.posture": list(POSE),
        "force_loop:contact_cover": OUTER,
        "force_loop:contact_position": PLACE,
        **obstacles(BODY, POSE, [surface]),
    }
    here = np.array(given["driver:world.obstacles.positions"])
    given["driver:world.obstacles.positions"] = (here + away * across).tolist()
    configuration = with_accepted_gain(CONFIGURATION.with_values({**given, **changes}))
    run = Simulation(configuration, [ScenarioStep("release", RELEASE, request="enable"), step])
    peak, loop = 0.0, run.nodes["force_loop"]
    while not run.step():
        peak = max(peak, float(np.linalg.norm(run.driver.true_contact.force)))
        reaction, reason = loop.force_reaction, loop.reason
    return peak, reaction, reason


def force(newtons: float, direction: np.ndarray, seconds: float) -> ScenarioStep:
    return ScenarioStep("press", seconds, force=ForceCommand("base", triple(newtons * direction)))


@pytest.mark.parametrize(
    ("step", "given", "reaction", "most"),
    [
        (force(4.0, DOWN, 3.5), {"driver:mismatch.payload": 0.3}, ForceReaction.NOT_SENSED, 8.0),
        (force(1.0, ASIDE, 3.5), {}, ForceReaction.NOT_SENSED, 4.0),
        (force(8.0, DOWN, 5.5), {"away": NOTHING_NEAR, "begin": 2.8}, ForceReaction.NOTHING_TOUCHED, 12.0),
        (force(8.0, DOWN, 3.0), {"cover": "inner_link", "place": 0.45}, ForceReaction.OTHER_LINK, 12.0),
        # what the motors do not detect yet presses harder
        (force(1.0, ASIDE, 3.5), MOTORS, ForceReaction.NOT_SENSED, 9.0),
        (
            force(15.0, DOWN, 3.0),
            {"cover": "inner_link", "place": 0.45, **MOTORS},
            ForceReaction.OTHER_LINK,
            22.0,
        ),
    ],
)
def test_a_surface_that_comes_to_an_arm_that_holds_is_pressed_no_harder_than_commanded(
    step: ScenarioStep, given: dict[str, Any], reaction: ForceReaction, most: float
) -> None:
    """It had not pressed before, and stayed where it was: 27 to 69 N, and nothing was said of it.

    What is above the commanded force is the speed of the surface over the gain of the force, 1.4 N.
    """
    peak, found, reason = came(step, **{"begin": 0.2, **given})
    assert peak < most
    assert found is reaction
    assert "something touches the arm" in reason


def test_a_false_contact_does_not_make_the_arm_wander() -> None:
    """Torques that nothing pushes with move the arm that holds by the largest way, and no further."""
    held, q, place = HeldArm(BODY), np.array(POSE), (OUTER, PLACE)
    torques = np.array([1.0, 3.0, -0.5, 2.0])
    held.hold(q.tolist(), 0.1)
    way = 0.0
    for _ in range(3000):
        push = ArmPush(torques, np.full(4, 0.025), place, 1.0, 0.015)
        velocity, _ = held.step(q.tolist(), [], push, 8.0, 1.5, 0.005)
        jacobian = BODY.point_jacobian(q, OUTER, (PLACE, 0.0, 0.0))
        way += float(np.linalg.norm(jacobian @ velocity)) * 0.005
        q = q + np.array(velocity) * 0.005
    assert way == pytest.approx(0.1, rel=0.05)
    assert np.abs(velocity).max() < 1e-9
    assert "something touches the arm" in held.push
