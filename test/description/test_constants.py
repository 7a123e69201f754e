"""Printed and assumed constants against the configuration that carries them."""

import math

import pytest

from wam_description.configuration import Configuration, packaged
from wam_description.constants import Constant, constants
from wam_description.parameters import values
from wam_description.units import FACTORS, si

TABLES = {name: constants(name) for name in ("wam", "testbed")}
CONSTANTS = [row for table in TABLES.values() for row in table]
CARRIED = [(name, row) for name, table in TABLES.items() for row in table if row.parameter]


def arm_numbers(configuration: str = "wam") -> dict[str, tuple[float, ...]]:
    """Every number below `arm` in a configuration, arrays as tuples."""
    flat = values(Configuration.load(packaged(configuration)).shared.arm)
    arrays = {f"arm.{name}": value if isinstance(value, tuple) else (value,) for name, value in flat.items()}
    return {name: array for name, array in arrays.items() if not any(isinstance(x, str | bool) for x in array)}


def elements(row: Constant, length: int) -> list[tuple[int, float]]:
    """Which elements of its parameter a row covers, with the SI value of each."""
    places = row.index or range(length)
    numbers = row.si if isinstance(row.value, list) else row.si * len(places)
    assert len(numbers) == len(places), f"{row.parameter}: {len(numbers)} values for {len(places)} places"
    return list(zip(places, numbers, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "row"), CARRIED, ids=lambda x: x if isinstance(x, str) else f"{x.parameter}{list(x.index) or ''}"
)
def test_configuration_carries_the_constant_in_si_units(name: str, row: Constant) -> None:
    carried = arm_numbers(name)[row.parameter]
    tolerance = 1e-7 if row.source else 1e-3
    for place, number in elements(row, len(carried)):
        assert carried[place] == pytest.approx(number, rel=tolerance, abs=1e-12), f"{row.parameter}[{place}]"


@pytest.mark.parametrize("name", TABLES)
def test_every_number_of_the_arm_has_exactly_one_row(name: str) -> None:
    numbers = arm_numbers(name)
    covered = [
        (row.parameter, place)
        for carrier, row in CARRIED
        if carrier == name
        for place, _ in elements(row, len(numbers[row.parameter]))
    ]
    expected = [(name, place) for name, array in numbers.items() for place in range(len(array))]
    assert sorted(covered) == sorted(expected)


def test_each_row_has_a_source_or_a_reason() -> None:
    for row in CONSTANTS:
        assert (row.source != "") != (row.reason != ""), row
        assert row.unit in FACTORS, row


@pytest.mark.parametrize(
    ("unit", "factor"),
    [  # NIST SP 811, appendix B.8
        ("lb", 4.448222),
        ("in-lb", 0.1129848),
        ("lb-in-s^2", 0.1129848),
        ("lb/in", 175.1268),
        ("oz-in-s^2", 7.061552e-3),
        ("lbm", 0.4535924),
        ("in", 0.0254),
        ("deg", 1.745329e-2),
    ],
)
def test_factors_are_those_of_nist(unit: str, factor: float) -> None:
    assert si(1.0, unit) == pytest.approx(factor, rel=5e-7)


def test_unknown_unit_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"'furlong' is not known; known units: .*lb-in-s\^2"):
        si(1.0, "furlong")


def test_configuration_has_the_printed_numbers_recomputed_by_hand() -> None:
    numbers = arm_numbers()
    newton_metre = 4.4482216152605 * 0.0254
    assert numbers["arm.motors.inertia"] == pytest.approx([0.00036 * newton_metre] * 4, rel=1e-7)
    assert numbers["arm.motors.peak_torque"] == pytest.approx([43 * newton_metre] * 4, rel=1e-7)
    assert numbers["arm.motors.continuous_torque"] == pytest.approx([15 * newton_metre] * 4, rel=1e-7)
    assert numbers["arm.joints.offset"] == pytest.approx([0, 0, 22 * 0.0254, 0])
    assert numbers["arm.covers.length"] == pytest.approx([22 * 0.0254, 16 * 0.0254])


def test_joint_friction_is_the_printed_part_of_peak_torque() -> None:
    numbers = arm_numbers()
    ratios = (29.97, 2 * 30.40, 30.40, 19.15)
    peak = numbers["arm.motors.peak_torque"]
    at_motor, at_joint = numbers["arm.motors.static_friction"], numbers["arm.joints.static_friction"]
    for i, percent in enumerate((1.4, 1.0, 1.0, 1.0)):
        assert at_motor[i] * ratios[i] + at_joint[i] == pytest.approx(percent / 100 * ratios[i] * peak[i], rel=1e-3)


def test_corrections_are_noted_with_wrong_prints() -> None:
    assert math.sqrt(64 / 0.0057) == pytest.approx(105.96, abs=0.005)
    (matching,) = (row for row in CONSTANTS if row.symbol == "N_m")
    assert matching.value == 104.0
    assert "105.96" in matching.erratum
    (ratio,) = (row for row in CONSTANTS if row.symbol == "N1..N4")
    assert isinstance(ratio.value, list)
    assert ratio.value[2] == pytest.approx(15.20)
    assert "30.40/2" in ratio.erratum
