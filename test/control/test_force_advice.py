"""What the refusal of a force advises is found by trying, and is obeyed when it is followed."""

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest
from numpy import eye
from test_force_loop import ARM, BODY, DRIVEN, DT, STILL, force_loop
from test_held_arm import OWN

from wam_control.force.force_loop import ForceInput
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.task import AxisKind, TaskAxis, TaskCommand, unit
from wam_description.event import Code, Event
from wam_description.signals import NO_CONTACT, ForceCommand, State

LONG = 80  # periods, in which all is tried
UNPINNED = replace(OWN, contact_source="estimated")
MOTORS = replace(OWN, feedback="contact_estimate")


def bent(bend: float) -> tuple[float, ...]:
    return (0.0, -1.0, 0.0, math.pi / 2.0 - bend)


def radial(q: Sequence[float], newtons: float, frame: str) -> tuple[float, float, float]:
    """A force away from the shoulder at the end of the outer link, in a frame."""
    tip = BODY.point(q, "outer_link", (ARM.covers.length_of("outer_link"), 0.0, 0.0))
    turn = eye(3) if frame == "base" else BODY.cover_pose(q, frame).rotation
    x, y, z = (newtons / math.hypot(*tip) * turn.T @ tip).tolist()
    return x, y, z


def asked(
    own: ForceLoopParameters, q: Sequence[float], frame: str, force: tuple[float, ...], sd: float, is_task: bool = False
) -> Event:
    """The event of a force that is commanded in free space for some time, after a tenth of it."""
    loop = force_loop(ARM, own)
    joints, sensors = State(list(q), STILL, DRIVEN), State(list(q), STILL, BODY.gravity_torque(q).tolist())
    x, y, z = force
    for part in [0.1] * LONG + [1.0] * LONG:
        command = ForceCommand(frame, (part * x, part * y, part * z))
        against = unit((-x, -y, -z)), -part * math.hypot(x, y, z)
        task = TaskCommand(frame, (TaskAxis(AxisKind.FORCE, -1, own.contact_cover, own.contact_position, *against),))
        what = {"task": task} if is_task else {"command": command}
        loop.step(ForceInput(joints, DT, sensors, NO_CONTACT, STILL, [sd] * 4 if sd else None, **what))
    return loop.event


def ways(event: Event) -> list[str]:
    return [name for name in ("turn", "more_force", "pin") if name in event.values]


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["outer_link"])
@pytest.mark.parametrize(("own", "bend", "newtons", "sd"), [
    (OWN, 0.15, 5.0, 0.0), (OWN, 0.3, 2.0, 0.0), (UNPINNED, 0.3, 2.0, 0.0), (MOTORS, 0.8, 3.0, 0.05),
])  # fmt: skip
def test_advice_is_obeyed(own: ForceLoopParameters, bend: float, newtons: float, sd: float, frame: str) -> None:
    q = bent(bend)
    force = radial(q, newtons, frame)
    refused = asked(own, q, frame, force, sd)
    assert refused.code is Code.REFUSED
    assert refused.holds
    assert ways(refused), "something helps"
    values = refused.values
    if "turn" in values:
        turned = list(q)
        turned[ARM.joints.names.index(str(values["turn"]))] = float(values["turn_to"])
        assert not asked(own, turned, frame, force, sd).holds
    if "more_force" in values:
        factor = float(values["more_force"]) / newtons
        assert not asked(own, q, frame, tuple(factor * part for part in force), sd).holds
    if "pin" in values:
        pinned = replace(own, contact_source="pinned", contact_position=float(values["pin"]))
        assert not asked(pinned, q, frame, force, sd).holds


@pytest.mark.slow
def test_where_nothing_helps_all_was_tried_and_nothing_is_advised() -> None:
    q = bent(0.3)
    hard = replace(OWN, limits=replace(OWN.limits, surface_speed=1.0))
    refused = asked(hard, q, "base", radial(q, 5.0, "base"), 0.0)
    assert "searched" in refused.values
    assert not ways(refused)


@pytest.mark.slow
@pytest.mark.parametrize("is_task", [False, True])
def test_no_more_force_is_advised_than_may_be_commanded(is_task: bool) -> None:
    q = bent(0.3)
    force = radial(q, 2.0, "base")
    free, limited = (asked(replace(OWN, force_limit=most), q, "base", force, 0.0, is_task) for most in (60.0, 2.4))
    assert "more_force" in free.values
    assert "more_force" not in limited.values
