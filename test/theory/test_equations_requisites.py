"""Chapters 2 and 3: contact from two torques, impact, grasp, against vectors, small steps and geometry."""

import math

import numpy as np
import pytest

from wam_theory.planar_contact import planar_contact
from wam_theory.requisites import impact_force, largest_cylinder, secure_angle, useful_length


def torques_of(force: float, place: float, length: float, inner: float, elbow: float) -> tuple[float, float]:
    """Torques about both joints of a force normal to the outer link, by cross products in the plane."""
    joint = length * np.array([math.cos(inner), math.sin(inner)])
    along = np.array([math.cos(inner + elbow), math.sin(inner + elbow)])
    point, push = joint + place * along, force * np.array([-along[1], along[0]])
    arms = point, point - joint
    return tuple(float(arm[0] * push[1] - arm[1] * push[0]) for arm in arms)  # type: ignore[return-value]


def test_contact_is_found_in_every_pose_but_the_right_angle() -> None:
    for inner, elbow in ((0.3, 0.0), (-1.0, 0.7), (2.0, -1.2), (0.0, 2.5)):
        tau_1, tau_2 = torques_of(-7.0, 0.3, 0.56, inner, elbow)
        found = planar_contact(tau_1, tau_2, 0.56, elbow)
        assert tuple(map(float, found)) == pytest.approx((-7.0, 0.3))
    tau_1, tau_2 = torques_of(7.0, 0.3, 0.56, 0.4, math.pi / 2)
    assert tau_1 == pytest.approx(tau_2)  # the inner joint feels nothing of its own
    assert np.isnan(planar_contact(tau_1, tau_2, 0.56, math.pi / 2)).all()


def test_printed_contact_is_that_of_the_straight_arm_alone() -> None:
    for elbow, right in ((0.0, True), (1.0, False)):
        tau_1, tau_2 = torques_of(7.0, 0.3, 0.56, 0.2, elbow)
        printed = (tau_1 - tau_2) / 0.56, tau_2 * 0.56 / (tau_1 - tau_2)
        found = planar_contact(tau_1, tau_2, 0.56, elbow)
        assert (printed == pytest.approx((float(found.force), float(found.position)))) is right
    assert printed[0] == pytest.approx(7.0 * math.cos(1.0))


def test_contact_without_force_has_no_position_and_arguments_broadcast() -> None:
    found = planar_contact([[0.0], [1.0]], [0.0, 0.2, 0.5], 0.5, 0.0)
    assert found.force.shape == found.position.shape == (2, 3)
    assert found.force[0, 0] == 0.0
    assert math.isnan(found.position[0, 0])
    assert found.position[1, 2] == pytest.approx(0.5)


def test_impact_of_a_driven_link_is_that_of_its_effective_mass_and_not_of_the_link() -> None:
    """Link 0.5 kg m^2 and a rotor of 4e-5 behind 1:60 meet 2000 N/m at 0.7 m and 1.2 m/s, all rigid."""
    total, lever = 0.5 + 60.0**2 * 4e-5, 0.7
    angle, speed, h, greatest = 0.0, 1.2 / lever, 1e-5, 0.0
    while speed > 0.0:
        speed -= h * 2000.0 * lever * lever * angle / total
        angle += h * speed
        greatest = max(greatest, 2000.0 * lever * angle)
    assert impact_force(1.2, total / lever**2, 2000.0) == pytest.approx(greatest, rel=1e-3)
    assert impact_force(1.2, 0.5 / lever**2, 2000.0) < 0.9 * greatest
    assert impact_force(1.2 / lever, total, 2000.0 * lever**2) / lever == pytest.approx(greatest, rel=1e-3)


def blocked_length(width: float, theta: float) -> float:
    """How far from the joint the inner face of one link is still inside the other link, by bisection."""
    other = np.array([math.cos(theta), math.sin(theta)])

    def is_inside(along: float) -> bool:
        point = np.array([along, width / 2.0])  # a point of the inner face of the link on the x axis
        return bool(abs(other[0] * point[1] - other[1] * point[0]) < width / 2.0)

    low, high = width / 2.0 * math.tan(theta / 2.0) * 1.000001, 1e4 * width
    while high - low > 1e-12 * high:
        middle = (low + high) / 2.0
        low, high = (middle, high) if is_inside(middle) else (low, middle)
    return high


@pytest.mark.parametrize(("aspect", "mu"), [(5.0, 0.3), (9.0, 0.8), (3.0, 0.4)])
def test_useful_length_and_largest_cylinder_are_those_of_two_bars(aspect: float, mu: float) -> None:
    theta = float(secure_angle(mu))
    free = 1.0 - blocked_length(1.0 / aspect, theta)
    assert useful_length(aspect, theta) == pytest.approx(free, rel=1e-9)
    # circle on the bisector, tangent to both inner faces; it grows until it leaves the ends of the links
    low, high = 0.0, 10.0
    while high - low > 1e-13:
        centre = (low + high) / 2.0
        low, high = (centre, high) if centre * math.cos(theta / 2.0) < 1.0 else (low, centre)
    radius = low * math.sin(theta / 2.0) - 0.5 / aspect
    assert largest_cylinder(aspect, mu) == pytest.approx(2.0 * radius, rel=1e-9)
    # the line between both contacts leans against each normal by theta/2: it just does not slip
    assert math.tan(theta / 2.0) == pytest.approx(mu)


def test_stubby_links_grasp_nothing_and_slender_ones_nearly_all() -> None:
    assert useful_length([0.5, 1e6], 0.3) == pytest.approx([0.0, 1.0], abs=1e-5)
    assert largest_cylinder([1.0, 1e6], 0.3) == pytest.approx([0.0, 0.6], abs=1e-5)
    assert useful_length(1e6, secure_angle(0.0)) == largest_cylinder(1e6, 0.0) == 0.0  # nothing holds without friction
