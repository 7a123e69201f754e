"""What pushes an arm that moves or presses is given way to: a rod that comes from the side, on the simulated arm."""

import math
from typing import Any

import mujoco
import numpy as np
import pytest
from arms import CONFIGURATION, WAM
from test_force_lasting import BODY, DIRECTION, OUTER, POSE, press

from wam_control.task.scenario import ScenarioStep
from wam_description.event import Code, Level
from wam_description.signals import ForceCommand, NodeStatus
from wam_sim.simulation import Simulation
from wam_studies.force_benchmark.surfaces import NAMES, Surface, obstacles
from wam_studies.force_benchmark.tasks import RANGES, draw, triple
from wam_studies.force_benchmark.trial import perform

pytestmark = pytest.mark.slow  # seconds each: the plant in contact

SPEED, WAY = 0.02, 0.02  # m/s, m: a rod that comes so fast, to both sides of where it would touch
INNER = "inner_link"
UNBOUND = {"force_loop:limits.whole_force": 1e9}


def pushed(
    step: ScenarioStep, cover: str, place: float, pinned: bool = False, **changes: Any
) -> tuple[float, set[Code]]:
    """Largest force of a rod of 40 000 N/m from the side, N, and what the arm reports once it comes."""
    aside = -BODY.cover_pose(POSE, cover).rotation[:, 2]
    still = Surface(OUTER, 0.25, DIRECTION, 4000.0, 0.3, False)
    moves = triple(-WAY * aside), SPEED / (2.0 * math.pi * WAY), 2.0
    rod = Surface(cover, place, triple(aside), 40000.0, 0.3, False, *moves)
    given = {
        "arm.joints.start": list(POSE),
        "force_loop:guard.posture": list(POSE),
        "force_loop:contact_source": "pinned" if pinned else "estimated",
        "force_loop:contact_cover": OUTER,
        "force_loop:contact_position": 0.25,
        **obstacles(BODY, POSE, [still, rod]),
        **changes,
    }
    configuration = CONFIGURATION.with_values(given)
    run = Simulation(configuration, [ScenarioStep("release", RANGES.release, request="enable"), step])
    model, data, present = run.driver.plant.model, run.driver.plant.data, [NodeStatus(Level.OK, "")]
    run.listen("status", lambda _, status: present.append(status), "force_loop")
    geom, wrench, peak, periods = model.geom(NAMES[1]).id, np.zeros(6), 0.0, 0
    found = set[Code]()
    while not run.step():
        periods += 1
        for i in range(data.ncon):
            if geom in data.contact.geom[i]:
                mujoco.mj_contactForce(model, data, i, wrench)
                peak = max(peak, abs(float(wrench[0])))
        if periods > 1e3 * (RANGES.release + 2.0):
            found |= {event.code for event in present[-1].events}
    return peak, found


@pytest.mark.parametrize(
    ("cover", "place", "pinned", "most", "before"), [(OUTER, 0.35, False, 20.0, 25.0), (INNER, 0.35, True, 40.0, 40.0)]
)
def test_a_rod_that_comes_from_the_side_to_an_arm_that_presses_is_given_way_to(
    cover: str, place: float, pinned: bool, most: float, before: float
) -> None:
    """8 N are pressed, 12 N are allowed; at a position that is not known, where it takes the least force for them."""
    peak, reactions = pushed(press(8.0, 3.5), cover, place, pinned)
    assert peak < most
    assert Code.PUSHED in reactions
    peak, _ = pushed(press(8.0, 3.5), cover, place, pinned, **UNBOUND)
    assert peak > before


@pytest.mark.parametrize(("cover", "place"), [(OUTER, 0.35), (INNER, 0.5)])
def test_an_arm_without_a_command_gives_way_above_the_largest_contact_force(cover: str, place: float) -> None:
    """On the inner link no torque shows the position: the force counts that explains them at its far end."""
    step = ScenarioStep("rest", 3.5)
    peak, reactions = pushed(step, cover, place, **{"force_loop:limits.contact_force": 20.0})
    assert peak < 30.0
    assert Code.PUSHED in reactions
    peak, _ = pushed(step, cover, place, **{"force_loop:limits.contact_force": 1e6})
    assert peak > 100.0


def test_the_force_with_which_the_brakes_stop_the_arm_is_no_push() -> None:
    start = CONFIGURATION.shared.arm.joints.start
    steps = [
        ScenarioStep("release", RANGES.release, request="enable"),
        ScenarioStep("turn", 0.5, posture=(start[0], start[1] - 0.4, start[2], start[3] + 0.5)),
        ScenarioStep("back", 0.4, posture=(*start[:3], start[3] + 0.2)),
        ScenarioStep("brake", 0.2, request="disable"),
    ]
    run = Simulation(CONFIGURATION, steps)
    assert not run.play()
    assert not run.reactions


def test_a_force_along_what_the_arm_touches_does_not_press_it_ever_harder() -> None:
    """The arm lies on the packaged box; 8 N across are no force of that contact, so the link slides and may climb."""
    above, down = (0.0, -1.8, 0.0, 1.45), (0.0, -2.1, 0.0, 1.45)
    steps = [
        ScenarioStep("release", RANGES.release, request="enable"),
        ScenarioStep("above", 1.5, posture=above),
        ScenarioStep("lower", 3.0, posture=down, until_force=1.5),
        ScenarioStep("press", 2.0, force=ForceCommand(OUTER, (0.0, 0.0, 8.0))),
    ]
    run, peak = Simulation(CONFIGURATION, steps), 0.0
    while not run.step():
        peak = max(peak, math.hypot(*run.driver.true_contact.force))
    assert 1.5 < peak < 1.5 * 8.0


def test_an_arm_that_has_touched_too_hard_does_not_swing_as_it_gives_way() -> None:
    """It pressed with up to 36 N: what was commanded and the way back were nearly one direction, and it went across."""
    task = draw(WAM, 9504, 388)
    assert 0.5 < perform(CONFIGURATION, task).peak / task.force < 2.5
