"""An arm that holds its position gives way to a surface that comes to it, on the simulated arm and by itself."""

import re
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
from arms import CONFIGURATION, WAM
from test_force_lasting import DIRECTION, OUTER, PLACE, POSE, press
from test_force_plant import MOTORS

from wam_control.force.arm_push import ArmPush
from wam_control.force.contact_position import torque_of_position
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.given_way import GivenWay
from wam_control.force.held_arm import HeldArm
from wam_control.task.scenario import Push, ScenarioStep
from wam_description.event import Code
from wam_description.event_text import sentence
from wam_description.rigid_body import RigidBody
from wam_description.signals import ForceCommand
from wam_sim.simulation import Simulation
from wam_studies.force_benchmark.surfaces import Surface, obstacles
from wam_studies.force_benchmark.tasks import RANGES, triple
from wam_studies.force_benchmark.trial import with_accepted_gain

pytestmark = pytest.mark.slow  # seconds each: the plant in contact

BODY = RigidBody(WAM)
OWN = CONFIGURATION.node("force_loop", ForceLoopParameters)
DOWN = np.array(DIRECTION)
ASIDE = BODY.cover_pose(POSE, OUTER).rotation[:, 2]
WAY = OWN.limits.free_travel
FAR = {"driver:world.obstacles.positions": [3.0, 3.0, 3.0]}
NOTHING_NEAR = 0.165  # m, further than the arm may move through free space


class Moment(NamedTuple):
    """Place, m, and speed, m/s, of the tool at a time, s, and what the arm reports."""

    time: float
    tool: np.ndarray
    speed: float
    reaction: Code
    reason: str


def came(
    step: ScenarioStep, begin: float, cover: str = OUTER, place: float = PLACE, away: float = 0.0, **changes: Any
) -> tuple[float, Code, str]:
    """Largest force of a surface that comes at 20 mm/s by 30 mm, N, and what the arm reports at the end."""
    across = -BODY.cover_pose(POSE, cover).rotation[:, 1]
    surface = Surface(
        cover, place, triple(across), 4000.0, 0.3, False, triple(-0.03 * across), 0.106, RANGES.release + begin
    )
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
    run = Simulation(configuration, [ScenarioStep("release", RANGES.release, request="enable"), step])
    peak, loop = 0.0, run.nodes["force_loop"]
    while not run.step():
        peak = max(peak, float(np.linalg.norm(run.driver.true_contact.force)))
        reaction, reason = loop.reaction.code, sentence(loop.reaction)
    return peak, reaction, reason


def force(newtons: float, direction: np.ndarray, seconds: float) -> ScenarioStep:
    return ScenarioStep("press", seconds, force=ForceCommand("base", triple(newtons * direction)))


@pytest.mark.parametrize(
    ("step", "given", "reaction", "most"),
    [
        (force(4.0, DOWN, 3.5), {"driver:mismatch.payload": 0.3}, Code.NOT_SENSED, 8.0),
        (force(1.0, ASIDE, 3.5), {}, Code.NOT_SENSED, 4.0),
        (force(8.0, DOWN, 5.5), {"away": NOTHING_NEAR, "begin": 2.8}, Code.NOTHING_TOUCHED, 12.0),
        (force(8.0, DOWN, 3.0), {"cover": "inner_link", "place": 0.45}, Code.OTHER_LINK, 12.0),
        # what the motors do not detect yet presses harder
        (force(1.0, ASIDE, 3.5), MOTORS, Code.NOT_SENSED, 9.0),
        (
            force(15.0, DOWN, 3.0),
            {"cover": "inner_link", "place": 0.45, **MOTORS},
            Code.OTHER_LINK,
            22.0,
        ),
    ],
)
def test_a_surface_that_comes_to_an_arm_that_holds_is_pressed_no_harder_than_commanded(
    step: ScenarioStep, given: dict[str, Any], reaction: Code, most: float
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
    given = GivenWay(BODY)
    held, q, place = HeldArm(BODY, given), np.array(POSE), (OUTER, PLACE)
    own = replace(OWN, limits=replace(OWN.limits, free_travel=0.1))
    torques = np.array([1.0, 3.0, -0.5, 2.0])
    held.hold(q.tolist())
    push = ArmPush(torques, np.full(4, 0.025), place, 1.0, 0.015)

    def step() -> np.ndarray:
        given.step(q.tolist(), 0.005)
        return np.array(held.step(q.tolist(), [], push, np.eye(4), own)[0])

    for _ in range(3000):
        velocity = step()
        q = q + velocity * 0.005
    assert np.linalg.norm(BODY.tool_pose(q).position - BODY.tool_pose(POSE).position) == pytest.approx(0.1, rel=0.05)
    assert np.abs(velocity).max() < 1e-9
    for _ in range(300):  # what overpowers the motors does not make it give way again
        q = q + np.array([0.0, 0.001, 0.0, 0.0])
        assert float(step() @ torques) < 1e-9
    assert held.pushed > 0.0


def pushed(command: ForceCommand, hand: Push, pulses: int, pose: list[float], **near: Any) -> list[Moment]:
    """What an arm does that is pushed at times by a hand, from before the first push on."""
    given = {"arm.joints.start": pose, "force_loop:guard.posture": pose, **near}
    steps = [ScenarioStep("release", RANGES.release, request="enable"), ScenarioStep("press", 2.0, force=command)]
    steps += [ScenarioStep(f"pushed {k}", 2.2, force=command, push=hand) for k in range(pulses)]
    run = Simulation(CONFIGURATION.with_values(given), steps)
    loop, found = run.nodes["force_loop"], []
    while not run.step():
        time, plant = 1e-9 * run.driver.stamp - RANGES.release - 2.0, run.driver.plant
        if run.driver.is_outer and time > 0.0:
            speed = float(np.linalg.norm(BODY.tool_jacobian(plant.q) @ plant.qd))
            tool = BODY.tool_pose(plant.q).position
            found.append(Moment(time, tool, speed, loop.reaction.code, sentence(loop.reaction)))
    return found


def test_what_pushes_an_arm_again_and_again_moves_it_no_further_than_it_may() -> None:
    """A hand on the inner link, five times: the tool had moved by 1.77 m.  A force is not stated as larger than it is.

    25 N, with 8 N that the arm presses, were stated as 180 N.
    """
    pose = [0.0, -1.8, 0.0, 1.45]
    across = -BODY.cover_pose(pose, OUTER).rotation[:, 1]
    surface = Surface(OUTER, PLACE, triple(across), 4000.0, 0.3, False)
    command = ForceCommand(OUTER, (0.0, -8.0, 0.0), torque_of_position((0.0, -8.0, 0.0), PLACE))
    hand = Push("inner_link", 0.4, (0.0, 0.0, 25.0), 0.2, 1.4, WAM.covers.aside("inner_link", 0.4))
    moments = pushed(command, hand, 5, pose, **obstacles(BODY, pose, [surface]))
    assert max(float(np.linalg.norm(one.tool - moments[0].tool)) for one in moments) < WAY + 0.03
    stated = [
        float(size) for one in moments for size in re.findall(r"pushes with (?:at least )?([\d.]+) N", one.reason)
    ]
    assert stated
    assert max(stated) < 1.5 * (25.0 + 8.0)


def test_an_arm_that_was_pushed_away_goes_back_no_faster_than_it_may_come_to_a_surface() -> None:
    """From a push on another link it goes back to where it was free; it came at 1.56 rad/s, 1 m/s."""
    pose = [0.0, -1.0, 0.0, 1.55]
    hand = Push("inner_link", 0.4, (0.0, 20.0, 0.0), 0.2, 1.4, WAM.covers.aside("inner_link", 0.4))
    moments = pushed(ForceCommand("base", (0.0, 0.0, 1.0)), hand, 1, pose, **FAR)
    assert moments[0].reaction is Code.NOT_SENSED
    assert moments[-1].reaction is Code.OTHER_LINK
    assert max(float(np.linalg.norm(one.tool - moments[0].tool)) for one in moments) < WAY + 0.03
    assert max(one.speed for one in moments if one.time > 1.6) < 0.05


@pytest.mark.parametrize("as_task", [False, True])
@pytest.mark.parametrize(("is_near", "newtons"), [(True, 10.0), (True, 20.0), (False, 14.0)])
def test_what_pushes_against_the_commanded_force_is_followed_no_further_than_the_arm_may_go(
    is_near: bool, newtons: float, as_task: bool
) -> None:
    """On its way to a surface and on one: the arm went back by 0.35 m and more within 8 s, as long as it was pushed."""
    near = obstacles(BODY, POSE, [Surface(OUTER, PLACE, DIRECTION, 4000.0, 0.3, False)]) if is_near else FAR
    given = {"arm.joints.start": list(POSE), "force_loop:guard.posture": list(POSE), **near}
    given |= {"force_loop:contact_source": "pinned", "force_loop:contact_position": PLACE}
    hand = Push(OUTER, PLACE, triple(-newtons * (BODY.cover_pose(POSE, OUTER).rotation.T @ DOWN)), 0.0, 9.0)
    steps = [ScenarioStep("release", RANGES.release, request="enable"), press(8.0, 0.4, as_task)]
    run = Simulation(
        with_accepted_gain(CONFIGURATION.with_values(given)), [*steps, press(8.0, 9.0, as_task, push=hand)]
    )
    places, found = [], set()
    while not run.step():
        places.append(float(DOWN @ BODY.point(run.driver.plant.q, OUTER, (PLACE, 0.0, 0.0))))
        found.add(run.nodes["force_loop"].reaction.code)
    assert max(places) - min(places) < WAY + 0.02
    assert Code.NOTHING_TOUCHED in found
