"""What the refusal of a force advises is computed, and is accepted when it is followed word for word."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from test_force_hold import PINNED, QUIET, bent, press, radial
from test_force_loop import ARM, BODY, DRIVEN, DT, STILL, force_loop

from wam_control.force.contact_position import ForceCase, ForcePoint
from wam_control.force.force_axis import ForceAxes
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.sensing_advice import Advice, OtherForces, Turnable
from wam_control.force.thresholds import FORCE
from wam_description.event import Code
from wam_description.event_text import sentence
from wam_description.signals import BASE, NO_CONTACT, ForceCommand, State

LONG = 60  # periods, in which all is tried
HELD = "; the arm holds its position"


class Refused:
    """A commanded force and what the loop makes of it."""

    def __init__(
        self,
        own: ForceLoopParameters,
        q: Sequence[float],
        direction: np.ndarray,
        force: float,
        frame: str = BASE,
        sd: float = 0.0,
    ) -> None:
        self.own, self.q, self.force, self.frame, self.sd = own, list(q), force, frame, sd
        self.along = direction if frame == BASE else BODY.cover_pose(q, frame).rotation.T @ direction
        self.loop = force_loop(ARM, own)
        state, sensed = State(self.q, STILL, DRIVEN), State(self.q, STILL, BODY.gravity_torque(q).tolist())
        command = ForceCommand(frame, tuple((force * self.along).tolist()))
        external, known = (STILL, [sd] * 4) if sd else (None, None)
        for _ in range(LONG):
            self.loop.step(state, sensed, NO_CONTACT, external, command, None, None, DT, external_sd=known)

    @property
    def ways(self) -> list[str]:
        """What is advised and can be followed."""
        _, _, advised = sentence(self.loop.reaction).partition(f"{HELD}: ")
        return [way for way in advised.split(", or ") if re.match("turn|command [0-9]|pin", way)]

    def followed(self, way: str, sd_factor: float = 1.0) -> Code:
        """What becomes of it with an advice."""
        q, force, own = list(self.q), self.force, self.own
        for name, angle in re.findall(r"turn (\w+) from \S+ to (\S+) rad", way):
            q[ARM.joints.names.index(name)] = float(angle)
        for newtons in re.findall(r"command (\S+) N", way):
            force = float(newtons)
        if "pin the position" in way:
            own = replace(own, contact_source="pinned")
        along = self.along if self.frame == BASE else BODY.cover_pose(q, self.frame).rotation @ self.along
        return Refused(own, q, along, force, self.frame, sd_factor * self.sd).loop.reaction.code


def moving(speed: float) -> ForceLoopParameters:
    return replace(PINNED, limits=replace(PINNED.limits, surface_speed=speed))


MOTORS = replace(PINNED, feedback="contact_estimate")
UNPINNED_MOTORS = replace(MOTORS, contact_source="estimated")
ALONE = "accepted with a margin"
PIN = "pin the position (by a force in the frame of outer_link; computed for 0.28 m)"


@pytest.mark.parametrize("frame", [BASE, "outer_link"])
@pytest.mark.parametrize(
    ("own", "bend", "force", "sd", "kinds"),
    [
        (PINNED, 0.4, 10.0, 0.0, ["turn", "command"]),
        (PINNED, 0.1, 2.0, 0.0, ["turn"]),
        (QUIET, 0.6, 10.0, 0.0, ["turn", "pin"]),
        (QUIET, 0.3, 10.0, 0.0, ["turn"]),  # a pinned position does not help here
        (MOTORS, 0.8, 3.0, 0.05, ["turn", "command"]),
        (UNPINNED_MOTORS, 0.5, 3.0, 0.1, ["pin"]),  # and a joint turned
        (moving(5e-3), 0.3, 5.0, 0.0, ["turn"]),
    ],
)
def test_what_is_advised_is_accepted_word_for_word(
    own: ForceLoopParameters, bend: float, force: float, sd: float, kinds: list[str], frame: str
) -> None:
    """Before, a force in the base frame at an estimated position got neither; a pinned position was always named."""
    q = bent(bend)
    refused = Refused(own, q, radial(q), force, frame, sd)
    assert refused.loop.reaction.code.holds
    assert [way.split()[0] for way in refused.ways] == kinds, sentence(refused.loop.reaction)
    for way in refused.ways:
        # what the estimator states of its torques is not the same in every pose
        assert not refused.followed(way, sd_factor=1.15).holds, way


def test_a_change_is_advised_together_with_a_pinned_position_only_where_neither_helps_alone() -> None:
    q = bent(0.5)
    refused = Refused(UNPINNED_MOTORS, q, radial(q), 3.0, sd=0.1)
    (way,) = refused.ways
    assert way == f"{PIN} and turn joint2 from -1.00 to 0.6 rad"
    for part in way.split(" and "):
        assert refused.followed(part).holds


def test_what_would_be_sensed_but_is_refused_for_another_reason_is_not_advised() -> None:
    """A surface that moves needs a faster arm than there is in the poses in which the force would be sensed."""
    q = bent(0.4)
    sensed = Refused(moving(0.0), q, radial(q), 5.0)
    fast = Refused(moving(1e-2), q, radial(q), 5.0)
    assert sensed.ways
    assert {Refused.followed(fast, way) for way in sensed.ways} == {Code.TOO_SLOW}
    assert not fast.ways


@pytest.mark.parametrize(
    ("own", "sd", "text"),
    [
        (moving(1e-2), 0.0, f"{ALONE}: command another direction or position"),
        (
            UNPINNED_MOTORS,
            0.5,
            f"{ALONE}, with a pinned position or without: command another direction or position, or use joint sensors",
        ),
    ],
)
def test_where_nothing_computed_helps_the_reason_states_it(own: ForceLoopParameters, sd: float, text: str) -> None:
    q = bent(0.4)
    refused = Refused(own, q, radial(q), 5.0, sd=sd)
    nothing = "no force up to 5 times and no angle of one joint up to 1.6 rad away was found that would be"
    assert f"{HELD}; {nothing} {text}" in sentence(refused.loop.reaction)


def test_every_refusal_before_the_motion_advises_what_is_computed() -> None:
    """It was "command more force", without a number, for a surface too stiff for the force."""
    stiff = replace(QUIET, guard=replace(QUIET.guard, contact_stiffness=2.2e4), feedback="contact_estimate")
    pose = (0.0, -1.8, 0.0, 1.45)
    refused = Refused(stiff, pose, np.array([0.0, 0.0, -1.0]), 20.0, sd=1e-3)
    assert refused.loop.reaction.code is Code.TOO_SLOW
    assert [way.split()[0] for way in refused.ways] == ["command", "pin"]
    for way in refused.ways:
        assert not refused.followed(way).holds


def test_the_advice_is_that_for_the_present_force_and_within_the_limits() -> None:
    loop, q = force_loop(ARM, PINNED), bent(0.4)
    press(loop, q, radial(q), 2.0, LONG)
    assert "command" not in sentence(loop.reaction).partition(HELD)[2]
    press(loop, q, radial(q), 10.0)
    assert sentence(loop.reaction).endswith(HELD), "it is looked for again"
    press(loop, q, radial(q), 10.0, LONG)
    assert sentence(loop.reaction) == sentence(Refused(PINNED, q, radial(q), 10.0).loop.reaction)
    assert "command 16 N" in sentence(loop.reaction)
    narrow = replace(PINNED, limits=replace(PINNED.limits, joint_margin=2.1))
    assert "turn joint4" not in sentence(Refused(narrow, q, radial(q), 10.0).loop.reaction)
    weak = replace(PINNED, limits=replace(PINNED.limits, contact_force=15.0))
    for limited in (replace(PINNED, force_limit=15.0), weak):
        assert "command " not in sentence(Refused(limited, q, radial(q), 10.0).loop.reaction).partition(HELD)[2]


def test_few_ways_are_tried_in_a_period() -> None:
    """All of them took longer than a period of the force loop."""
    q, tried, angles = bent(0.1), 0, set()
    axes, point = ForceAxes(ARM, BODY, PINNED.sensing), ForcePoint("outer_link", 0.28, 0.1, *(False,) * 4, "", "")
    joints = [Turnable(i, ARM.joints.names[i], -2.0, 2.0) for i in (3, 2)]

    def at(pose: Sequence[float], force: float, is_pinned: bool) -> ForceCase:
        nonlocal tried
        tried += 1
        angles.add(pose[3])
        return ForceCase(axes.axis(pose, point.pressed(radial(q), force)), point, force)

    advice, counts = Advice(), []
    while not advice.is_complete:
        before = tried
        advice.step(2.0, "", lambda: OtherForces(q, joints, "here", at), lambda _: False)
        counts.append(tried - before)
    assert max(counts) == FORCE.each
    assert tried > 50
    assert max(angles) == 1.8, "not at the end of the joint: the arm moves on as it presses"
    assert advice.ways == []
