"""An arm that holds its position, or is pushed: it gives way, no further than allowed, and presses no harder."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from test_force_belief import POSES, axis_at
from test_force_loop import ARM, BODY, CONFIGURATION, DRIVEN, DT, POSE, STILL, down, force_loop

from wam_control.force.force_axis import ForceAxes
from wam_control.force.force_loop import ForceInput, ForceLoop
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.held_arm import PushedArm
from wam_description.event import Code
from wam_description.signals import NO_CONTACT, Contact, ForceCommand, State

Array = NDArray[np.float64]
PACKAGED = CONFIGURATION.node("force_loop", ForceLoopParameters)
LIMIT = "limits.contact_force"
OWN = replace(
    PACKAGED,
    contact_source="pinned",
    guard=replace(PACKAGED.guard, mode="off"),
    sensing=replace(PACKAGED.sensing, zero_limit=0.0),
)
HOLDS = replace(OWN, limits=replace(OWN.limits, doubt=0.01))  # nothing is known well enough
MIDDLE = ARM.covers.on_axis("outer_link", 0.28)
UP = np.array([0.0, 0.0, 1.0])


class Pushed:
    """Velocity servos without error, and a hand that pushes at the middle of the outer link with a force."""

    def __init__(self, own: ForceLoopParameters = OWN, press: float = 0.0) -> None:
        self.loop: ForceLoop = force_loop(ARM, own)
        self.q, self.force = list(POSE), down(press)
        self.codes: set[Code] = set()

    @property
    def at(self) -> Array:
        return BODY.point(self.q, "outer_link", MIDDLE)

    def go(self, seconds: float, hand: Any = (0.0, 0.0, 0.0), contact: Contact = NO_CONTACT) -> None:
        """Push with a force of the world, N."""
        for _ in range(round(seconds / DT)):
            torques = np.array(hand) @ BODY.point_jacobian(self.q, "outer_link", MIDDLE)
            sensors = State(self.q, STILL, (BODY.gravity_torque(self.q) - torques).tolist())
            command = ForceCommand("base", self.force) if any(self.force) else None
            joints = State(self.q, STILL, DRIVEN)
            out = self.loop.step(ForceInput(joints, DT, sensors, contact, command=command))
            self.codes |= {event.code for event in self.loop.events}
            self.q = [a + v * DT for a, v in zip(self.q, out.velocity, strict=True)]


@pytest.mark.parametrize("shift", [0.002, 0.02, 0.3])
def test_an_arm_that_holds_goes_back_to_where_it_held_with_no_more_energy_than_an_allowed_impact(shift: float) -> None:
    own = replace(HOLDS, limits=replace(HOLDS.limits, joint_acceleration=0.0))
    arm, inertia = Pushed(own, 5.0), ForceAxes(BODY, own.sensing).moved_inertia(np.add(POSE, shift))
    arm.go(3 * DT)
    assert arm.q == list(POSE)
    for _ in range(2):  # and not to where it was a period ago
        arm.q = np.add(POSE, shift).tolist()
        arm.go(DT)
        found = (np.array(arm.q) - POSE - shift) / DT
        assert (found < 0.0).all()
        peak = math.sqrt(float(found @ inertia @ found) * own.guard.contact_stiffness)
        assert peak <= own.limits.impact * 5.0 * (1.0 + 1e-9)
        if shift < 0.01:
            assert found == pytest.approx([-shift * own.posture_gain] * 4)


@pytest.mark.slow
@pytest.mark.parametrize(("own", "press"), [(OWN, 0.0), (OWN, 8.0), (HOLDS, 8.0)])
@pytest.mark.parametrize("size", [300.0])
def test_an_arm_that_is_pushed_gives_way_no_further_than_allowed_and_comes_back(
    own: ForceLoopParameters, press: float, size: float
) -> None:
    arm = Pushed(own, press)
    arm.go(0.3)
    begin = arm.at
    arm.go(2.0, size * UP)
    way = float(UP @ (arm.at - begin))
    assert 0.05 < way < own.limits.free_travel + 0.03
    assert Code.PUSHED in arm.codes
    if not press:
        arm.go(6.0)
        assert float(np.linalg.norm(arm.at - begin)) < 0.01
        assert not arm.loop.events


@pytest.mark.slow
def test_pushes_again_and_again_move_it_no_further_than_one() -> None:
    arm = Pushed(HOLDS, 8.0)
    arm.go(0.3)
    begin, ways = arm.at, []
    for _ in range(5):
        arm.go(1.0, 60.0 * UP)
        ways.append(float(np.linalg.norm(arm.at - begin)))
        arm.go(0.3)
    assert max(ways) < OWN.limits.free_travel + 0.03


@pytest.mark.slow
def test_what_pushes_less_than_allowed_moves_nothing_until_a_command_allows_less() -> None:
    """What pushed before a command, and is no payload, pushes on."""
    arm = Pushed(replace(OWN, sensing=PACKAGED.sensing))
    begin = arm.at
    arm.go(1.0, 60.0 * UP)
    assert arm.at == pytest.approx(begin, abs=1e-6)
    assert not arm.codes
    arm.force = 0.0, 5.0, 0.0
    arm.go(0.3, 60.0 * UP, Contact("outer_link", 0.28, (0.0, 60.0, 0.0), 0.001, 1.0))
    assert Code.PUSHED in arm.codes
    assert (arm.at - begin)[2] > 0.01


@pytest.mark.slow
@pytest.mark.parametrize(("hand", "goes"), [(7.0, False), (40.0, True)])
def test_an_arm_that_holds_presses_no_harder_than_commanded(hand: float, goes: bool) -> None:
    """A surface that came to it, and is pressed with more than the command, is let go of."""
    arm = Pushed(HOLDS, 8.0)
    begin = arm.at
    arm.go(0.1, hand * UP)
    assert arm.loop.event.code is Code.REFUSED
    assert arm.loop.event.holds
    assert (float(UP @ (arm.at - begin)) > 0.005) is goes
    arm.go(3.0)
    assert arm.at == pytest.approx(begin, abs=0.003), "it goes back"


def test_an_arm_that_touches_with_another_link_moves_away_from_what_it_touches() -> None:
    """Also if that is not along the force, and was touched before the command, so no place is known to be free."""
    limits, side = replace(OWN.limits, doubt=2.0), np.array([0.0, 1.0, 0.0])
    arm = Pushed(replace(OWN, contact_cover="inner_link", contact_position=0.4, limits=limits), 8.0)
    begin = arm.at
    arm.go(2.0, 2.0 * side, Contact("outer_link", 0.28, (0.0, 0.0, 2.0), 0.001, 1.0))
    assert arm.loop.event.code is Code.UNEXPLAINED
    assert side @ (arm.at - begin) == pytest.approx(0.003, rel=0.05)


def test_without_a_lever_an_arm_holds() -> None:
    """A force away from the shoulder of a straight arm: no joint turns along it."""
    arm, before = Pushed(), [0.0, -1.0, 0.0, math.pi / 2.0]
    arm.q = list(before)
    x, y, z = (5.0 * arm.at / np.linalg.norm(arm.at)).tolist()
    arm.force = x, y, z
    arm.go(0.2)
    assert arm.loop.event.code is Code.REFUSED
    assert arm.q == pytest.approx(before, abs=1e-3)


def test_a_push_is_reported_while_it_lasts_and_for_some_time_after() -> None:
    q, sd = POSES[0], np.full(4, 0.015)
    jacobian, pushed = BODY.tool_jacobian(q), PushedArm(BODY)

    def step(force: float, is_bouncing: bool = False, periods: int = 1) -> list[float]:
        torques = force * UP @ jacobian
        for _ in range(periods):
            rows = pushed.step(q, [], torques, sd, NO_CONTACT, 0.0, (20.0, LIMIT), True, is_bouncing, 0.03, OWN, DT)
        return [row.speed for row in rows]

    def direct(force: float) -> float:
        """Least force that such torques show."""
        size = np.linalg.norm(force * UP @ jacobian) - 3.0 * np.linalg.norm(sd)
        return float(size / np.linalg.norm(jacobian, 2))

    assert step(10.0)[0] < 0.0
    assert step(80.0, is_bouncing=True)[0] > 0.0, "the impact of the commanded touch"
    assert pushed.event is None
    assert step(200.0)[0] > 0.0
    assert pushed.event is not None
    assert pushed.event.code is Code.PUSHED
    found = {"cause": "pushed", "force": pytest.approx(direct(200.0)), "allowed": 20.0, "limit": LIMIT}
    assert pushed.event.values == found
    step(0.0, periods=39)
    assert pushed.event is not None
    step(0.0, periods=3)
    assert pushed.event is None
    assert step(0.0) == [], "noise is given no way"
    step(200.0, is_bouncing=True)
    assert pushed.event is not None, "above the largest contact force, also an impact is reported"


def test_a_force_that_was_allowed_and_falls_with_its_command_is_no_push() -> None:
    q, sd, pushed = POSES[0], np.full(4, 0.015), PushedArm(BODY)
    axis = axis_at(q, 40.0)
    for k in range(400):
        size = 40.0 if k < 100 else max(5.0, 40.0 - 0.2 * (k - 100))
        allowed = 1.5 * (40.0 if k < 100 else 5.0)
        pushed.step(q, [axis], -size * axis.along, sd, NO_CONTACT, 0.0, (allowed, LIMIT), True, False, 0.03, OWN, DT)
        assert pushed.event is None
