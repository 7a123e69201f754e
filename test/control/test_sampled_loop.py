"""The linear map of the whole sampled loop beside theory that knows one friction node, and beside the plant."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from arms import LEVER, changed, one_joint

from wam_control.force.force_loop import ForceCommand
from wam_control.force.sampled_loop import Axes, Feedback, SampledLoop
from wam_control.task.scenario import ScenarioStep
from wam_description.arm import Arm, Servo, Timing
from wam_description.configuration import Configuration, packaged
from wam_sim.simulation import Simulation
from wam_theory.linear_loop import sampled_margin

TESTBED = Configuration.load(packaged("testbed"))
STIFFNESS = 1500.0  # N/m at the tip
FIRM = Servo((10.0,), (1000.0,))
SCALES = np.geomspace(0.01, 100.0, 60).tolist()


def stiff_arm(damping: float) -> Arm:
    """One joint whose rotor is held by a velocity loop that lets the cable hardly move it."""
    return changed(one_joint(), motors={"inertia": (2e-3,)}, joints={"viscous_friction": (damping,)})


def timing(divisor: int) -> Timing:
    return Timing("lockstep", 1e-4, 1, divisor, 0, 10, 0, 5.0, 0.0, 0, 0)


def margin(
    arm: Arm, clock: Timing, servo: Servo, gain: float, feedback: str = "contact_estimate", **more: Any
) -> float:
    """Largest stable G_I at the tip, m/s/N."""
    loop = SampledLoop(arm, clock, servo)
    lever, one, none = np.array([LEVER]), np.array([[1.0 / LEVER]]), np.zeros((1, 1))
    gains = np.array([gain]), np.array([more.get("proportional", 0.0)])
    axes = Axes(one, one, *gains, none, none, filter_time=0.0, delay=more.get("delay", 0))
    contact = more.get("stiffness", STIFFNESS) * np.outer(lever, lever)
    return gain * loop.margin([0.0], axes, contact, Feedback("contact_estimate", (0.0,), 0.0), SCALES)


@pytest.mark.parametrize("samples", [0, 1, 2])
@pytest.mark.parametrize("divisor", [50, 200])
def test_behind_a_servo_that_follows_at_once_the_margin_is_that_of_the_sampled_node(samples: int, divisor: int) -> None:
    arm, clock = stiff_arm(4.0), timing(divisor)
    expected = sampled_margin(
        0.45, 4.0, 14.0**2 * 8.33, STIFFNESS * LEVER**2, clock.period * divisor, samples
    ).gain * LEVER**2  # fmt: skip
    found = margin(arm, clock, FIRM, 0.01, delay=samples * divisor)
    assert found == pytest.approx(expected, rel=0.02)


def test_whole_and_part_periods_of_delay_join() -> None:
    """A part of a period that is a whole one is a sample of delay."""
    arm, clock, servo = stiff_arm(4.0), timing(50), FIRM
    found = [margin(arm, clock, servo, 0.01, delay=delay) for delay in (0, 25, 49, 50)]
    assert found[2] == pytest.approx(found[3], rel=0.03)
    assert abs(found[1] - found[0]) > 0.02 * found[0]


def pressed(gain: float, proportional: float = 0.0, divisor: int = 20, seconds: float = 5.0) -> float:
    """Peak to peak of the testbed's force some seconds after a step, without friction, N."""
    nothing = {f"arm.{p}.{kind}_friction": [0.0] for p in ("joints", "motors") for kind in ("static", "dynamic")}
    gains = {"force_loop:force_gain": [gain], "force_loop:force_proportional_gain": [proportional]}
    own = {"force_loop:guard.mode": "off", "timing.outer_divisor": divisor}
    conf = TESTBED.with_values({**nothing, **gains, **own})
    asked = [ForceCommand("base", (0.0, 0.0, -newtons)) for newtons in (20.0, 24.0)]
    steps = [
        ScenarioStep("release", 0.2, request="enable"),
        ScenarioStep("press", 1.5, force=asked[0]),
        ScenarioStep("step", seconds, force=asked[1]),
    ]
    run = Simulation(conf, steps)
    assert run.play() == ""
    return float(np.ptp([row.values[2] for row in run.rows["force_measured"][-41:-1]]))


@pytest.mark.slow
def test_the_plant_swings_above_the_margin_and_rests_below_it() -> None:
    """MuJoCo shares nothing with the map: rotors, cables, velocity loop and hold of its own."""
    arm, shared = TESTBED.shared.arm, TESTBED.shared
    found = margin(arm, shared.timing, shared.servo, 0.01, stiffness=1751.26835)
    assert pressed(0.9 * found) < 2.0
    assert pressed(1.1 * found) > 20.0
    ideal = 1.73e-3 / 0.1129848 * LEVER**2  # section 5.6 at 50 Hz for a motor without lag, (rad/s)/(lb-in)
    assert found > 2.5 * ideal, "the lag of the velocity loop counts"


def test_proportional_gain_raises_the_margin_of_a_fast_loop_as_equation_5_23_says() -> None:
    arm, clock, servo = stiff_arm(4.0), timing(2), FIRM
    damping, inertia, ktr, kc = 4.0, 0.45, 14.0**2 * 8.33, STIFFNESS * LEVER**2
    gp = 3e-4  # rad/(N m); scaled with G_I up to the margin
    found = margin(arm, clock, servo, 1e-3, proportional=0.0) / LEVER**2
    assert found == pytest.approx(damping / inertia * (1.0 / ktr + 1.0 / kc), rel=0.05)
    gain = damping / inertia * (1.0 / ktr + 1.0 / kc + gp)
    with_gp = margin(arm, clock, servo, gain * LEVER**2, proportional=gp * LEVER**2) / LEVER**2
    assert with_gp == pytest.approx(gain, rel=0.1)
    assert with_gp > 1.15 * found


@pytest.mark.slow
def test_on_the_plant_a_proportional_gain_raises_the_margin_at_200_hz_and_lowers_it_at_50_hz() -> None:
    """(5.23) holds for a fast loop; a sample late, G_P destabilises: the map says both, and the plant does so."""
    arm, servo, gp = TESTBED.shared.arm, TESTBED.shared.servo, 5e-4
    fast, slow = (replace(TESTBED.shared.timing, outer_divisor=divisor) for divisor in (5, 20))

    def found(clock: Timing, gain: float, proportional: float) -> float:
        return margin(arm, clock, servo, gain, stiffness=1751.26835, proportional=proportional)

    without, late = found(fast, 0.01, 0.0), found(slow, 0.01, 0.0)
    assert found(fast, gain := 1.15 * without, gp) > gain
    assert found(slow, lower := 0.75 * late, gp) < lower
    assert pressed(gain, 0.0, 5, 2.0) > 20.0
    assert pressed(gain, gp, 5, 2.0) < 2.0
    assert pressed(lower, 0.0, 20, 2.0) < 2.0
    assert pressed(lower, gp, 20, 2.0) > 20.0
