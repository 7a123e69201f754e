"""The contact as markers: what a viewer is told to draw."""

import math
from typing import Any

import pytest

from wam_description.signals import Contact, ContactView, LikelyRange
from wam_ros.markers import METRES_PER_NEWTON, contact_markers

Marker = pytest.importorskip("visualization_msgs.msg").Marker
PARTS = (LikelyRange("outer_link", 0.2, 0.3), LikelyRange("inner_link", 0.4, 0.5588))


def drawn(cover: str, place: float, force: tuple[float, float, float]) -> list[Any]:
    return contact_markers(1, ContactView(Contact(cover, place, force), PARTS)).markers


def test_every_message_begins_by_deleting_what_was_drawn_before() -> None:
    for cover in ("", "outer_link"):
        markers = drawn(cover, 0.25, (0.0, 5.0, 0.0))
        assert markers[0].action == Marker.DELETEALL
        assert (len(markers) == 1) == (not cover)


def test_the_arrow_ends_at_the_place_and_is_as_long_as_the_force() -> None:
    _, arrow, sphere, *_ = drawn("outer_link", 0.25, (0.0, 3.0, 4.0))
    tail, tip = arrow.points
    assert (tip.x, tip.y, tip.z) == (0.25, 0.0, 0.0)
    assert math.dist((tail.x, tail.y, tail.z), (tip.x, tip.y, tip.z)) == pytest.approx(5.0 * METRES_PER_NEWTON)
    assert sphere.pose.position.x == 0.25
    assert arrow.header.frame_id == "outer_link"


def test_bands_lie_along_the_links_where_the_contact_is_likely() -> None:
    bands = drawn("outer_link", 0.25, (0.0, 5.0, 0.0))[3:]
    assert [band.header.frame_id for band in bands] == ["outer_link", "inner_link"]
    for band, part in zip(bands, PARTS, strict=True):
        assert band.scale.z == pytest.approx(part.high - part.low)
        assert band.pose.position.x == pytest.approx(0.5 * (part.low + part.high))
        turn = band.pose.orientation  # z of the cylinder comes to lie along x
        assert 2.0 * (turn.x * turn.z + turn.w * turn.y) == pytest.approx(1.0)


def test_an_unknown_place_is_grey_and_stands_in_the_middle_of_what_is_likely() -> None:
    _, arrow, sphere, *_ = drawn("inner_link", math.nan, (0.0, 5.0, 0.0))
    assert sphere.pose.position.x == pytest.approx(0.4794)
    assert arrow.color.r == arrow.color.g == arrow.color.b
