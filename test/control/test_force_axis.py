"""How a force is measured: without shrinkage, as a passive arm, and with the uncertainty that is stated."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from arms import BODY, CONFIGURATION, WAM
from numpy.typing import NDArray

from wam_control.force.force_axis import ForceAxes, ForceAxis, ForcePlace
from wam_control.force.force_loop_parameters import ForceLoopParameters

Array = NDArray[np.float64]
SENSING = replace(CONFIGURATION.node("force_loop", ForceLoopParameters).sensing, least_apparent_mass=0.6)
OUTER, TIP = "outer_link", WAM.covers.length_of("outer_link")
POSES = ((0.3, -1.2, 0.2, 1.0), (0.0, -1.0, 0.0, 1.2), (0.5, 0.2, -0.4, 0.3))


def bent(bend: float) -> tuple[float, ...]:
    return (0.0, -1.0, 0.0, math.pi / 2.0 - bend)


def radial(q: Sequence[float]) -> Array:
    tip = BODY.point(q, OUTER, (TIP, 0.0, 0.0))
    return tip / np.linalg.norm(tip)


def lateral(q: Sequence[float]) -> Array:
    return BODY.cover_pose(q, OUTER).rotation[:, 2]


def axis_of(q: Sequence[float], direction: Array, force: float = 10.0, at: float = 0.28, sd: float = 0.0) -> ForceAxis:
    return ForceAxes(BODY, SENSING).axis(q, ForcePlace(OUTER, at, sd), direction, force)


def test_at_every_pose_a_force_is_sensed_without_shrinkage_and_as_a_passive_arm() -> None:
    random, lightest = np.random.default_rng(4), math.inf
    forces = ForceAxes(BODY, SENSING)
    loose = ForceAxes(BODY, replace(SENSING, least_apparent_mass=0.0))
    for _ in range(300):
        q = random.uniform(WAM.joints.lower, WAM.joints.upper)
        direction = random.normal(size=3)
        pressed = ForcePlace(OUTER, 0.28, 0.01), direction / np.linalg.norm(direction), 10.0
        axis = forces.axis(q, *pressed)
        if not math.isfinite(axis.force_sd):
            continue
        assert axis.sense @ axis.press == pytest.approx(1.0, rel=1e-6)
        assert axis.apparent_mass >= 0.6 * (1.0 - 1e-6)
        assert 0.0 < axis.speed_fraction <= 1.0
        assert axis.lever @ axis.move == pytest.approx(axis.speed_fraction)
        assert axis.speed_fraction * axis.apparent_mass <= 2.0 * (1.0 + 1e-9)
        lightest = min(lightest, loose.axis(q, *pressed).apparent_mass)
        assert axis.force_sd >= loose.axis(q, *pressed).force_sd * (1.0 - 1e-9), "passivity has its price"
    assert lightest < 0.3, "without the least mass"


@pytest.mark.parametrize("q", POSES)
def test_the_stated_standard_deviation_is_that_of_the_sensed_force(q: tuple[float, ...]) -> None:
    random, n, direction = np.random.default_rng(6), 4000, lateral(q)
    axis = axis_of(q, direction, at=0.2, sd=0.02)
    rotation, radius = BODY.cover_pose(q, OUTER).rotation, WAM.covers.radius_of(OUTER)
    point = np.array(WAM.covers.on_axis(OUTER, 0.2)) + radius * (rotation.T @ direction)
    jacobian = BODY.point_jacobian(q, OUTER, point)
    slide = BODY.point_jacobian(q, OUTER, point + np.array([1.0, 0.0, 0.0])) - jacobian
    sideways = 10.0 * SENSING.friction * random.normal(size=(n, 3)) @ (np.eye(3) - np.outer(direction, direction))
    forces, off = 10.0 * direction + sideways, 0.02 * random.normal(size=(n, 1))
    errors = SENSING.torque_sd**2 + (10.0 * SENSING.torque_fraction * axis.press) ** 2
    torques = forces @ jacobian + off * (forces @ slide) + np.sqrt(errors) * random.normal(size=(n, 4))
    found = torques @ axis.sense - 10.0
    assert np.std(found) == pytest.approx(axis.force_sd, rel=0.05)
    assert abs(np.mean(found)) < 0.1 * axis.force_sd
    assert axis.force_sd >= math.hypot(axis.friction_sd, axis.place_sd)


def test_near_straight_a_radial_force_is_known_worse_and_worse_and_not_suddenly() -> None:
    found = [axis_of(bent(bend), radial(bent(bend)), at=TIP).force_sd for bend in np.linspace(0.6, 0.02, 30)]
    assert all(1.0 < later / before < 2.0 for before, later in pairwise(found))
    assert axis_of(bent(0.0), radial(bent(0.0)), at=TIP).force_sd == math.inf
    assert axis_of(bent(0.0), lateral(bent(0.0)), at=TIP).force_sd < 0.5, "across the arm nothing is lost"


@pytest.mark.parametrize("q", POSES)
def test_a_force_is_known_worse_the_less_is_known(q: tuple[float, ...]) -> None:
    """Of the position, of the friction, and of another force that acts besides."""
    direction = lateral(q)
    by_position = [axis_of(q, direction, sd=sd).force_sd for sd in (0.0, 0.01, 0.03, 0.1)]
    assert all(b > a for a, b in pairwise(by_position))
    more = ForceAxes(BODY, replace(SENSING, friction=2.0 * SENSING.friction))
    pressed = ForcePlace(OUTER, 0.28, 0.01), direction, 10.0
    assert more.axis(q, *pressed).force_sd > axis_of(q, direction, sd=0.01).force_sd
    forces = ForceAxes(BODY, SENSING)
    other = forces.disturbance(q, ForcePlace("inner_link", 0.3, 0.01), direction, 10.0)
    assert forces.axis(q, *pressed, other).force_sd > forces.axis(q, *pressed).force_sd


def test_torques_of_the_force_alone_are_explained_and_others_are_not() -> None:
    q = POSES[0]
    axis = axis_of(q, lateral(q), sd=0.01)
    assert axis.unexplained(-7.0 * axis.press) == pytest.approx(0.0, abs=1e-6)
    other = ForceAxes(BODY, SENSING).lever(q, "inner_link", 0.4, BODY.cover_pose(q, "inner_link").rotation[:, 1])
    assert axis.unexplained(-7.0 * axis.press - 12.0 * other) > 16.0
    assert axis.error(np.full(4, 0.1)) == pytest.approx(0.1 * np.linalg.norm(axis.sense))
