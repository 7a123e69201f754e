"""Chapter 6 against balances of mass and energy, small steps and the printed examples."""

import numpy as np
import pytest

from wam_theory import cable
from wam_theory import tension_element as te

LB, INCH = 4.4482216152605, 0.0254
GRAVITY = 9.80665
POUND_OF_MASS = LB / GRAVITY
EA = 9500.0 * LB
CABLE = 3e-4 * POUND_OF_MASS / INCH  # kg/m


class Stage:
    """A stage with finite strain, by mass and energy per unstretched metre; speeds of the strands and both losses."""

    def __init__(self, loose: float, tight: float, ea: float = EA, unstretched_speed: float = 2.0) -> None:
        e1, e2 = loose / ea, tight / ea
        self.v1, self.v2 = unstretched_speed * (1.0 + e1), unstretched_speed * (1.0 + e2)
        stored = unstretched_speed * ea * (e2**2 - e1**2) / 2.0
        pulled = tight * self.v2 - loose * self.v1
        self.shaft_in, self.shaft_out = (tight - loose) * self.v2, (tight - loose) * self.v1
        self.drive_loss = self.shaft_in - pulled + stored
        self.driven_loss = pulled - stored - self.shaft_out


def test_strain_and_speed_ratio_keep_the_mass() -> None:
    """100 unstretched metres enter in a time; they leave as 100 (1 + strain)."""
    assert te.strain([0.0, 95.0], 9500.0) == pytest.approx([0.0, 0.01])
    stage = Stage(10.0 * LB, 170.0 * LB)
    assert te.speed_ratio(10.0 * LB, 170.0 * LB, EA) == pytest.approx(stage.v2 / stage.v1, rel=1e-14)
    first_order = 1.0 + cable.stage_loss(160.0 * LB, 1.0, EA, 1.0, 1.0)
    assert te.speed_ratio(10.0 * LB, 170.0 * LB, EA) == pytest.approx(first_order, rel=2 * 170.0 / 9500 * 160 / 9500)


def test_heat_of_the_control_volume_is_that_of_the_exact_balance_to_first_order() -> None:
    errors = []
    for scale in (1.0, 0.1):
        loose, tight = 10.0 * LB * scale, 170.0 * LB * scale
        stage = Stage(loose, tight)
        heat = te.control_volume_loss(stage.shaft_out, loose, tight, stage.v1, stage.v2, EA, 0.0, 0.0, 0.0)
        errors.append(abs(float(heat) / stage.driven_loss - 1.0))
    assert errors[0] < 0.04
    assert errors[1] == pytest.approx(errors[0] / 10.0, rel=0.05)


def test_loss_is_the_same_at_both_pulleys_and_the_efficiency_the_ratio_of_speeds() -> None:
    loose, tight = 10.0 * LB, 170.0 * LB
    stage = Stage(loose, tight)
    exact = 2.0 * (tight - loose) ** 2 / (2.0 * EA)
    assert [stage.drive_loss, stage.driven_loss] == pytest.approx([exact] * 2, rel=1e-10)
    for shaft, loss in ((stage.shaft_in, stage.drive_loss), (stage.shaft_out, stage.driven_loss)):
        assert te.pulley_loss(shaft, tight - loose, EA) == pytest.approx(loss, rel=1.01 * tight / EA)
    assert te.output_power(stage.shaft_in, tight - loose, EA) == pytest.approx(stage.shaft_out, rel=1e-3)
    assert stage.shaft_out / stage.shaft_in == pytest.approx(1.0 / float(te.speed_ratio(loose, tight, EA)), rel=1e-12)


@pytest.mark.parametrize("at_entry", [True, False])
def test_places_of_no_slip_are_what_the_control_volume_gives(at_entry: bool) -> None:
    """(6.5) with (6.4) and (6.8) or (6.9): exactly for the entry, to third order for the exit."""
    loose, tight, v1 = 10.0 * LB, 170.0 * LB, 2.0
    v2 = v1 * (1.0 + (tight - loose) / EA)
    speed = v1 if at_entry else v2
    heat = te.control_volume_loss((tight - loose) * speed, loose, tight, v1, v2, EA, 0.0, 0.0, 0.0)
    found = te.loss_by_sticking_point(speed, loose, tight, EA, at_entry)
    assert found == pytest.approx(float(heat), rel=1e-9 if at_entry else 0.05)
    assert bool(found > 0.0) is at_entry


def test_cable_sticks_at_the_entry_because_the_exit_would_take_heat_in() -> None:
    rng = np.random.default_rng(4)
    loose = rng.uniform(0.0, 100.0, 200)
    tight = loose + rng.uniform(1.0, 100.0, 200)
    assert np.all(te.loss_by_sticking_point(1.0, loose, tight, 9500.0, True) > 0.0)
    assert np.all(te.loss_by_sticking_point(1.0, loose, tight, 9500.0, False) < 0.0)
    assert te.driven_pulley_speed(3.0, 0.5) == pytest.approx(6.0)
    stage = Stage(10.0 * LB, 170.0 * LB)
    work = (160.0 * LB * 0.1) * te.driven_pulley_speed([stage.v1, stage.v2], 0.1)
    left = stage.driven_loss + stage.shaft_out - work  # heat if it sticks at entry, at exit
    assert left[0] == pytest.approx(stage.driven_loss, rel=1e-9)
    assert left[1] < 0.0


def test_last_term_of_6_10_takes_the_loss_away_from_the_exact_one() -> None:
    loose, tight = 0.0, 170.0 * LB
    stage = Stage(loose, tight)
    with_term = float(te.loss_by_sticking_point(stage.v1, loose, tight, EA, True))
    without = float(te.pulley_loss(stage.shaft_out, tight - loose, EA))
    assert without == pytest.approx(stage.driven_loss, rel=1e-10)
    assert with_term == pytest.approx(stage.driven_loss * (1.0 - tight / EA), rel=1e-10)
    assert te.loss_by_sticking_point(1.0, 79.4, 80.0, 9500.0, True) < 0.0  # 80^2/9500 is 0.67


def test_numbers_of_6_6_and_6_7_are_terms_of_the_balance_over_the_loss() -> None:
    loose, tight, speed, radius = 40.0 * LB, 200.0 * LB, 30.0, 0.4
    v2 = speed * (1.0 + (tight - loose) / EA)

    def heat(density: float, rise: float, gravity: float) -> float:
        shaft = (tight - loose) * speed
        return float(te.control_volume_loss(shaft, loose, tight, speed, v2, EA, density, rise, gravity))

    loss = float(te.pulley_loss((tight - loose) * speed, tight - loose, EA))
    weight = heat(CABLE, -2.0 * radius, GRAVITY) - heat(CABLE, 0.0, GRAVITY)
    assert weight / loss == pytest.approx(te.gravity_number(CABLE, GRAVITY, EA, radius, tight - loose), rel=0.02)
    kinetic = heat(0.0, 0.0, 0.0) - heat(CABLE, 0.0, 0.0)
    assert kinetic / loss == pytest.approx(2.0 * te.kinetic_number(CABLE, speed, tight - loose), rel=0.04)


def test_printed_example_of_6_7_is_a_tenth_and_one_is_at_2535_inches() -> None:
    number = te.gravity_number(CABLE, GRAVITY, EA, np.array([275.0, 2535.0]) * INCH, 170.0 * LB)
    assert number == pytest.approx([0.108, 1.0], abs=6e-4)
    assert te.kinetic_number(CABLE, 1e4 * INCH, 170.0 * LB) == pytest.approx(0.457, abs=1e-3)


def test_efficiency_of_equal_stages_is_their_product_and_the_printed_one() -> None:
    difference = 60.0 / 0.375
    found = te.equal_stages_efficiency(difference, 9500.0, [0, 1, 2, 3])
    assert found == pytest.approx([cable.efficiency([difference / 9500.0] * n) for n in range(4)])
    assert found[1:3] == pytest.approx([0.983, 0.966], abs=7e-4)
    assert te.output_power(-20.0, difference, 9500.0) == pytest.approx(-20.0 * found[1])


def test_slip_arc_is_where_friction_has_built_up_the_difference() -> None:
    """Tension grows by mu T per radian, by midpoint steps from 50 N on until 130 N."""
    tension, arc, h = 50.0, 0.0, 1e-5
    while tension < 130.0:
        middle = tension * (1.0 + 0.2 * h / 2.0)
        tension, arc = tension + 0.2 * middle * h, arc + h
    assert te.slip_arc(50.0, 130.0, 0.2) == pytest.approx(arc, rel=1e-5)
    assert te.slip_arc(50.0, 50.0, 0.2) == 0.0


@pytest.mark.parametrize("torque", [3.0, -3.0])
def test_creep_is_what_unstretched_lengths_leave_behind_out_and_back(torque: float) -> None:
    """Element by element: on the way out the drive pulls and the strand it takes in is tight, back it is loose."""
    ra, rb, ea, h = 0.02, 0.05, 2e5, 0.02
    driven, strand = 0.0, (100.0, 100.0 + abs(torque) / rb)
    for way in [1.0] * 50 + [-1.0] * 50:  # the torque of the environment stretches what leaves the driven pulley
        entering, leaving = strand if way * torque > 0.0 else strand[::-1]
        driven += way * h * ra * (1.0 + leaving / ea) / (1.0 + entering / ea) / rb
    found = float(cable.creep(2.0, torque * ra / rb, ra, ea)) * ra / rb  # seen at the motor
    assert driven == pytest.approx(found, rel=2e-3)
    assert te.driven_angle(1.0, ra, rb, found) == pytest.approx(0.4 + found)
    assert te.driven_angle([1.0, -2.0], ra, rb) == pytest.approx([0.4, -0.8])


def test_coulomb_like_torque_of_both_pulleys_is_the_power_that_creep_takes() -> None:
    torque, radius, speed = 6.8, 0.009525, 40.0
    friction = float(te.coulomb_like_torque(torque, radius, EA))
    per_pulley = te.pulley_loss(torque * speed, torque / radius, EA)
    assert friction * speed == pytest.approx(float(per_pulley), rel=1e-12)
    crept = cable.creep(speed * 1.0, torque, radius, EA) * torque  # in a second
    assert 2.0 * friction * speed == pytest.approx(float(crept), rel=1e-12)
    assert te.coulomb_like_torque(-torque, radius, EA) == friction


@pytest.mark.parametrize("viscosity", [30.0, 300.0])
def test_viscous_cable_loses_on_each_pulley_what_a_slipping_one_loses(viscosity: float) -> None:
    """6.2.5: an element that enters with T1 stretches under T2 after it has left; stepped in time, any viscosity."""
    loose, tight, ea, speed = 100.0, 500.0, 42_258.0, 0.3
    strain, heat, dt = loose / ea, 0.0, 2e-3 * viscosity / ea
    for _ in range(6000):
        rate = (tight - ea * strain) / viscosity
        heat += viscosity * rate**2 * dt
        strain += rate * dt
    shaft_power = (tight - loose) * speed  # heat is per length of cable, of which `speed` passes in a second
    assert heat * speed == pytest.approx(float(te.pulley_loss(shaft_power, tight - loose, ea)), rel=5e-3)
