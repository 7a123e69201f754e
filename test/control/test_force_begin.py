"""A force along another axis begins as in a new loop: nothing is left of the force before it."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from test_force_loop import ARM, BODY, DOWN, DRIVEN, DT, GIVEN, POSE, STILL, down, force_loop, lever

from wam_control.force.force_loop import ForceCommand, ForceLoop, ForceOutput
from wam_description.event import Code
from wam_description.signals import NO_CONTACT, Contact, State

OWN = replace(
    GIVEN,
    guard=replace(GIVEN.guard, mode="off"),
    limits=replace(GIVEN.limits, impact=0.0, free_travel=1e9),
    contact_source="pinned",
    friction_feedforward=0.7,
    force_filter=0.0,
    blend_time=0.0,
)
WEAK = replace(OWN, sensing=replace(OWN.sensing, force_sd_limit=0.0, force_sd_fraction=1e-3))
ON_OUTER = Contact("outer_link", 0.28, (0.0, 5.0, 0.0), 0.001, 0.99)
ON_INNER = Contact("inner_link", 0.3, (0.0, 8.0, 0.0), 0.001, 0.99)
Period = tuple[list[float], float, str, Contact, bool]  # posture, N along DOWN, link it is on, estimate, commanded


def turned(by: float) -> list[float]:
    """The posture with the elbow and shoulder turned, rad, so that the outer link slides along what it touches."""
    return [POSE[0], POSE[1] + by, POSE[2], POSE[3] - 2.0 * by]


def sliding() -> Iterator[Period]:
    for k in range(120):
        yield turned(0.002 * k), 5.0, "outer_link", ON_OUTER, True


def moved_between() -> Iterator[Period]:
    yield from sliding()
    for k in range(120):
        yield turned(0.24 + 0.002 * k), 5.0, "outer_link", ON_OUTER, False


def elsewhere() -> Iterator[Period]:
    for _ in range(30):
        yield turned(0.1), 0.0, "outer_link", NO_CONTACT, True
    for _ in range(30):
        yield turned(0.2), 8.0, "inner_link", ON_INNER, True


def played(loop: ForceLoop, periods: Iterator[Period], frame: str) -> list[ForceOutput]:
    """Outputs for given postures and forces; the command is 5 N along DOWN in a frame."""
    outputs = []
    for q, force, link, contact, commanded in periods:
        strain = BODY.gravity_torque(q) + force * lever(q, DOWN, link, 0.28)
        rotation = np.eye(3) if frame == "base" else BODY.cover_pose(q, frame).rotation
        command = ForceCommand(frame, tuple((rotation.T @ np.array(down(5.0))).tolist())) if commanded else None
        sensors, joints = State(q, STILL, strain.tolist()), State(q, STILL, DRIVEN)
        outputs.append(loop.step(joints, sensors, contact, None, command, q, None, DT))
    return outputs


def pressed_on() -> Iterator[Period]:
    """After what was before: the same force in another frame, from where the arm is."""
    for k in range(80):
        yield turned(0.3 + 0.001 * k), 5.0, "outer_link", ON_OUTER, True


def on_the_inner_link() -> Iterator[Period]:
    for _ in range(80):
        yield turned(0.3), 8.0, "inner_link", ON_INNER, True


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parameters", "before", "after", "reaction"),
    [
        (OWN, sliding, pressed_on, Code.NONE),
        (OWN, moved_between, pressed_on, Code.NONE),
        (WEAK, sliding, pressed_on, Code.NOT_SENSED),
        (replace(OWN, contact_source="estimated"), elsewhere, on_the_inner_link, Code.OTHER_LINK),
    ],
)
def test_a_force_in_another_frame_begins_as_in_a_new_loop(
    parameters: object, before: Callable[[], Iterator[Period]], after: Callable[[], Iterator[Period]], reaction: object
) -> None:
    used, new = force_loop(ARM, parameters), force_loop(ARM, parameters)  # type: ignore[arg-type]
    played(used, before(), "base")
    found, expected = (played(loop, after(), "outer_link") for loop in (used, new))
    assert used.reaction.code is new.reaction.code is reaction
    for one, other in zip(found, expected, strict=True):
        assert one.point == other.point
        assert one.velocity == pytest.approx(other.velocity, abs=1e-12)
        assert one.effort == pytest.approx(other.effort, abs=1e-12)
