"""Springs, tensions, losses and creep of a cable against numbers worked out by hand in pounds and inches."""

import numpy as np
import pytest

from wam_theory import cable

LB, INCH = 4.4482216152605, 0.0254
IN_LB = LB * INCH
EA, RADIUS = 9500 * LB, 0.375 * INCH  # the thesis's cable and pinion (6.4.5)
PRINTED = 7e-4  # three printed digits, cut off rather than rounded
EXACT = 1e-12  # the same arithmetic in another order


def test_stage_is_twice_as_stiff_for_twice_the_circuits_and_a_quarter_for_twice_the_ratio() -> None:
    """One strand of EA/L = 1000 N/m on 0.1 m: 10 N m/rad; both 20."""
    compliance = cable.stage_compliance([2000, 2000, 2000, 2000], 2.0, 0.1, [1, 2, 1, 1], [1, 1, 2, 1])
    np.testing.assert_allclose(1 / compliance, [20.0, 40.0, 5.0, 20.0], rtol=EXACT)
    assert cable.stage_compliance(2000, 0.0, 0.1, 1, 1) == 0.0


@pytest.mark.parametrize(
    ("distance", "expected"),
    [(2.0, 98_000.0), (0.0, 7_000.0), (1.0, 1 / (1 / 196_000 + 1 / 14_000))],
)
def test_reducer_at_the_joint_makes_the_line_n_times_stiffer(distance: float, expected: float) -> None:
    """(4.1) for EA = 1000 N, L = 2 m, N = 14: all fast, N^2 EA/L; all slow, N EA/L; 1 m of each."""
    assert cable.stiffness_with_reducer(1000, 2.0, 14, distance) == pytest.approx(expected, rel=EXACT)


def test_torque_is_that_of_two_strands_that_only_pull() -> None:
    """Strand by strand: 400 N/m each on a pulley of 50 mm, pretension 10 N, slack at 0.5 rad."""
    stretch = np.array([-2.0, -0.6, -0.5, -0.1, 0.0, 0.3, 0.5, 0.7, 3.0])
    strands = [[max(0.0, 10 + way * 400 * 0.05 * x) for x in stretch] for way in (1, -1)]
    torque = 0.05 * (np.array(strands[0]) - strands[1])
    np.testing.assert_allclose(cable.circuit_torque(stretch, 2.0, 10, 0.05), torque, rtol=EXACT, atol=1e-15)
    assert cable.slack_stretch(2.0, 10, 0.05) == pytest.approx(0.5, rel=EXACT)
    tight, loose = cable.tensions(torque, 10, 0.05)
    np.testing.assert_allclose(tight, np.max(strands, axis=0), rtol=EXACT)
    np.testing.assert_allclose(loose, np.min(strands, axis=0), rtol=EXACT, atol=1e-12)


def test_efficiency_of_one_and_of_two_stages_is_the_printed_one() -> None:
    """(6.15), section 6.4.5: 0.983 and 0.966 under 60 in lb, both stages with the same stress."""
    ratio = 3.7417
    first = cable.stage_loss(60 * IN_LB, RADIUS, EA, 1, 1)
    second = cable.stage_loss(60 * IN_LB, RADIUS, EA, ratio, ratio)  # as many circuits as the torque grows
    assert first == pytest.approx(160 / 9500, rel=EXACT)
    assert second == pytest.approx(160 / 9500, rel=EXACT)
    assert cable.efficiency(first) == pytest.approx(0.983, abs=PRINTED)
    assert cable.efficiency([first, second]) == pytest.approx(0.966, abs=PRINTED)
    assert cable.stage_loss(-60 * IN_LB, RADIUS, EA, 1, 1) == first
    assert cable.efficiency([]) == 1.0


def test_creep_yields_to_the_torque_whichever_way_the_pulley_goes() -> None:
    """(6.19): a radian out and back under 60 in lb gives 2 x 160/9500 rad, with the sign of the torque."""
    assert cable.creep(2.0, 60 * IN_LB, RADIUS, EA) == pytest.approx(2 * 160 / 9500, rel=EXACT)
    assert cable.creep(2.0, -60 * IN_LB, RADIUS, EA) == pytest.approx(-2 * 160 / 9500, rel=EXACT)


def test_eccentric_pulley_makes_an_amplitude_of_one_inch_pound() -> None:
    """(6.23): 0.010 in under 50 lb; the 2 in lb of the text are from peak to peak."""
    torque = cable.eccentric_ripple(0.010 * INCH, 50 * LB, np.linspace(0.0, 2 * np.pi, 5)) / IN_LB
    np.testing.assert_allclose(torque, [0.0, 1.0, 0.0, -1.0, 0.0], atol=1e-12)
