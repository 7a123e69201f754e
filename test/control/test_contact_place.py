"""Where a force acts: where it is pinned, sliding with the link, or at an estimate that is good enough."""

import math

import numpy as np
import pytest
from arms import CONFIGURATION, WAM

from wam_control.force.contact_place import (
    ContactPlace,
    ForcePlace,
    anywhere_sd,
    pinned_position,
    slid_position,
    torque_of_position,
)
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.task import AxisKind, TaskAxis
from wam_description.signals import NO_CONTACT, Contact, ForceCommand

COVERS = WAM.covers
OWN = CONFIGURATION.node("force_loop", ForceLoopParameters)
OUTER, INNER = "outer_link", "inner_link"
LENGTH = COVERS.length_of(OUTER)
SURE = Contact(OUTER, 0.1, (0.0, 1.0, 0.0), 0.001, 1.0)
ANYWHERE = anywhere_sd(COVERS, OUTER, OWN.contact_position)


def force(cover: str = "", position: float | None = None) -> TaskAxis:
    return TaskAxis(AxisKind.FORCE, -1, cover, position, (0.0, 0.0, -1.0), 5.0)


def at(axis: TaskAxis, contact: Contact, lean: float = 0.0) -> ForcePlace:
    """Where it acts; of all links that may be touched the outer one."""
    places = ContactPlace(COVERS).step(axis, contact, lean, OWN)
    assert len(places) == 1 or tuple(one.cover for one in places if not one.is_known) == COVERS.names
    return places[-1]


def test_a_command_pins_its_place_by_its_torque() -> None:
    given = (0.3, -4.0, 2.0)
    command = ForceCommand(OUTER, given, torque_of_position(given, 0.35))
    assert pinned_position(command) == (OUTER, pytest.approx(0.35))
    assert np.cross([0.35, 0.0, 0.0], given) == pytest.approx(command.torque)
    for none in (
        None,
        ForceCommand(OUTER, given),
        ForceCommand("base", given, (0.0, 1.0, 0.0)),
        ForceCommand(OUTER, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    ):
        assert pinned_position(none) is None


@pytest.mark.parametrize("contact", [NO_CONTACT, SURE, SURE._replace(cover=INNER)])
def test_a_pinned_place_is_not_overridden_and_known_as_well_as_declared(contact: Contact) -> None:
    found = at(force(OUTER, 0.28), contact)
    assert found == ForcePlace(OUTER, 0.28, OWN.contact_position_sd, is_pinned=True, is_known=True)


@pytest.mark.parametrize(("axis", "contact", "lean", "where", "is_known"), [
    (force(), NO_CONTACT, 0.0, (OUTER, 0.28, ANYWHERE), False),
    (force(INNER), NO_CONTACT, 0.0, (INNER, COVERS.length_of(INNER) / 2, ...), False),
    (force(), SURE, 0.0, (OUTER, 0.1, 0.001), True),
    (force(), SURE._replace(position_sd=math.nan), 0.0, (OUTER, 0.1, 0.0), True),
    (force(), SURE._replace(cover=INNER), 0.0, (INNER, 0.1, 0.001), True),
    (force(), SURE._replace(position=math.nan), 0.0, (OUTER, 0.28, ANYWHERE), False),
    (force(), SURE._replace(probability=0.5), 0.0, (OUTER, 0.28, ANYWHERE), False),
    (force(OUTER), SURE._replace(cover=INNER), 0.0, (OUTER, 0.28, ANYWHERE), False),
    (force(), SURE, 0.42, (OUTER, 0.1, 0.001), True),
    (force(), SURE, 0.57, (OUTER, 0.28, ANYWHERE), False),
])  # fmt: skip
def test_an_estimated_place_is_used_where_it_is_good_enough(
    axis: TaskAxis, contact: Contact, lean: float, where: tuple[str, float, float], is_known: bool
) -> None:
    found = at(axis, contact, lean)
    assert found[:2] == (where[0], pytest.approx(where[1]))
    assert where[2] is ... or found.position_sd == pytest.approx(where[2])
    assert (found.is_pinned, found.is_known) == (False, is_known)


def test_the_last_certain_place_is_kept_while_something_is_touched_and_no_longer() -> None:
    place = ContactPlace(COVERS)
    steps = (SURE, SURE._replace(position=0.3, probability=0.5), NO_CONTACT)
    found = [place.step(force(), contact, 0.0, OWN)[0].position for contact in steps]
    assert found == [0.1, 0.1, OWN.contact_position]


@pytest.mark.parametrize(("position", "way", "expected"), [
    (0.2, 0.01, 0.19), (0.2, -0.01, 0.21), (0.2, 9.0, 0.0), (0.2, -9.0, LENGTH), (LENGTH, 0.01, LENGTH),
])  # fmt: skip
def test_the_link_slides_along_what_it_touches_but_its_end_takes_it_along(
    position: float, way: float, expected: float
) -> None:
    assert slid_position(COVERS, OUTER, position, way) == pytest.approx(expected)


def test_a_pinned_place_slides_until_another_is_commanded() -> None:
    place = ContactPlace(COVERS)
    found = []
    for position, way in ((0.2, 0.004), (0.2, 0.004), (0.2, 0.0), (0.25, 0.004), (0.25, 0.0)):
        found.append(place.step(force(OUTER, position), NO_CONTACT, 0.0, OWN)[0].position)
        place.slide(way)
    assert found == pytest.approx([0.2, 0.196, 0.192, 0.25, 0.246])


def test_anywhere_is_the_deviation_of_a_uniform_position() -> None:
    x = np.random.default_rng(0).uniform(0.0, LENGTH, 200_000)
    for position in (0.0, 0.28, LENGTH):
        assert anywhere_sd(COVERS, OUTER, position) == pytest.approx(np.sqrt(np.mean((x - position) ** 2)), rel=0.01)
