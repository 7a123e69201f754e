"""The one-link testbed as chapter 5 sees it, from the parameters of a recording."""

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.experiments.recording import Recording, Step
from wam_control.force_loop_parameters import ForceLoopParameters, force_law
from wam_description.arm import Arm, seconds
from wam_description.world import World
from wam_driver.driver import DriverParameters
from wam_theory.linear_loop import SampledMargin, damping_ratio, gain_ratio, sampled_margin
from wam_theory.stick_slip import ForceLoop, FrictionNode, Outcome, Verdict, assess

Numbers = NDArray[np.float64]
ACROSS = 1  # y of the link's frame, along which the testbed presses
SETTLED = 0.02  # of the step: what is left of a response that counts as settled
STUCK = 1e-5  # rad/s of the joint, below which it sticks: far below any motion, far above what a stuck one shows
STEADY = 0.1  # change of the span between two windows below which a cycle counts as steady


class OneLink(NamedTuple):
    """Node, loop and lever of a testbed with one joint and one motor."""

    node: FrictionNode
    loop: ForceLoop
    lever: float  # m, of the force
    ratio: float  # motor turns per joint turn

    @property
    def margin(self) -> SampledMargin:
        """Marginal gain of the sampled loop at the joint, without friction."""
        n, loop = self.node, self.loop
        return sampled_margin(
            n.inertia, n.damping, n.transmission_stiffness, n.contact_stiffness, loop.sample_period, loop.delay_samples
        )

    @property
    def gamma(self) -> float:
        """(5.15) of the continuous loop."""
        n = self.node
        stiffness = n.transmission_stiffness, n.contact_stiffness
        return float(gain_ratio(self.loop.gain, n.inertia, n.damping, *stiffness))

    @property
    def zeta(self) -> float:
        """(5.12)."""
        n = self.node
        return float(damping_ratio(n.inertia, n.damping, n.transmission_stiffness, n.contact_stiffness))

    def state(self, shown: "Response") -> tuple[float, float, float]:
        """x, v and x_m at the begin of a response."""
        x = float(shown.force[0]) * self.lever / self.node.contact_stiffness
        return x, float(shown.speed[0]), float(shown.motor[0])

    def tip_gain(self, gain: float) -> float:
        """G_I in (m/s)/N at the tip of one at the joint, (rad/s)/(N m)."""
        return gain * self.lever**2


def link_inertia(arm: Arm) -> float:
    """J_l about the joint, kg m^2."""
    x = arm.links.centre[0]
    return float(arm.links.inertia[1] + arm.links.mass[0] * x * x + arm.joints.armature[0])


def joint_stiffness(world: World) -> float:
    """k_c of the spring at the joint, N m/rad."""
    return float(world.springs.stiffness[0] * world.springs.lever[0] ** 2)


def one_link(recording: Recording, settings: Mapping[str, Any] | None = None) -> OneLink:
    """Node and loop from what was recorded.

    Parameters
    ----------
    settings : live parameters set since the start, ``{'driver:effects.rubbing_friction': [0.9]}``.

    Raises
    ------
    ValueError
        where the arm has more than one joint, or the loop has a G_P.
    """
    changed = dict(settings or {})
    flat = {
        name: {**values, **{k.partition(":")[2]: v for k, v in changed.items() if k.startswith(f"{name}:")}}
        for name, values in recording.parameters.items()
    }
    recording = recording._replace(parameters=flat)
    arm, timing = recording.shared.arm, recording.shared.timing
    if len(arm.joints.names) != 1:
        raise ValueError(f"{arm.name} has {len(arm.joints.names)} joints; this evaluation is for one")
    driver = recording.node("driver", DriverParameters)
    control = recording.node("force_loop", ForceLoopParameters)
    law = force_law(control)
    if law.proportional_gain[ACROSS]:
        raise ValueError(
            f"force_proportional_gain is {law.proportional_gain[ACROSS]:g}; this evaluation is without G_P"
        )
    ratio, lever = 1.0 / arm.joint_from_motor[0], control.contact_place
    rubbing = driver.effects.rubbing_friction[0]
    node = FrictionNode(
        inertia=link_inertia(arm),
        damping=arm.joints.viscous_friction[0],
        transmission_stiffness=ratio**2 * arm.circuits[0].stiffness,
        contact_stiffness=joint_stiffness(driver.world),
        dynamic_friction=arm.joints.dynamic_friction[0] + rubbing,
        static_friction=arm.joints.static_friction[0] + rubbing,
    )
    loop = ForceLoop(
        gain=law.gain[ACROSS] / lever**2,
        error_limit=law.error_limit[ACROSS] * lever,
        deadband=law.deadband[ACROSS] * lever,
        sample_period=seconds(timing.outer_period_ns),
        delay_samples=control.delay_samples,
    )
    return OneLink(node, loop, lever, ratio)


def set_until(recording: Recording, step: Step) -> dict[str, Any]:
    """The live parameters that were set up to a step, and by it."""
    found: dict[str, Any] = {}
    for played in recording.steps:
        found.update(played.settings)
        if played == step:
            break
    return found


class Response(NamedTuple):
    """Contact force at the tip and motor at the joint, over time, while a step lasts."""

    time: Numbers  # s
    force: Numbers  # N, of the arm on the spring
    motor: Numbers  # rad at the joint, positive as it presses
    speed: Numbers  # rad/s of the joint, positive as it presses


def response(recording: Recording, link: OneLink, step: Step | None = None) -> Response:
    """What the force did in a step, or in the whole run."""
    sensors, motors = recording.joints("joint_sensors"), recording.joints("motor_states")
    begin, end = (step.begin, step.end) if step else (0.0, math.inf)
    if not math.isnan(recording.fault_time):
        end = min(end, recording.fault_time)
    chosen = (sensors.time >= begin - 1e-9) & (sensors.time <= end + 1e-9)
    force = -link.node.contact_stiffness * sensors.position[chosen, 0] / link.lever
    motor = -np.interp(sensors.time[chosen], motors.time, motors.position[:, 0]) / link.ratio
    return Response(sensors.time[chosen], force, motor, -sensors.velocity[chosen, 0])


def asked(recording: Recording, time: float) -> float:
    """Force that was asked for at a time, N."""
    command = recording.forces("force_command")
    return float(np.linalg.norm(command.force[np.searchsorted(command.time, time - 1e-9)]))


def fate(recording: Recording, step: Step, shown: Response) -> str:
    """What became of a step: settled, limit cycle, or diverged; by the spans of its last windows, a quarter each.

    A driver that had to stop counts as diverged; so does a span that still grows.
    """
    if step.begin <= recording.fault_time <= step.end:
        return str(Verdict.DIVERGED)
    quarter = len(shown.force) // 4
    before, late = (float(np.ptp(part)) for part in (shown.force[-2 * quarter : -quarter], shown.force[-quarter:]))
    size = max(float(np.ptp(shown.force)), 1e-9)
    if late < SETTLED * size or late < (1.0 - STEADY) * before:
        return str(Verdict.SETTLED)
    return str(Verdict.DIVERGED if late > (1.0 + STEADY) * before else Verdict.LIMIT_CYCLE)


def predicted_outcome(link: OneLink, shown: Response, force: float) -> Outcome:
    """What the exact integrator says will become of the state at the begin of a response, for a force asked for, N."""
    return assess(link.node, link.loop, force * link.lever, start=link.state(shown))


class Cycle(NamedTuple):
    """Peak to peak and period, s, of the last whole cycle of a signal."""

    peak_to_peak: float
    period: float


def last_cycle(time: Numbers, values: Numbers) -> Cycle:
    """The last whole cycle, between its rising crossings of the middle; NaN where there is none."""
    late = values[len(values) // 2 :]
    above = values > 0.5 * (late.max() + late.min())
    rises = np.flatnonzero(above[1:] & ~above[:-1])
    if len(rises) < 2:
        return Cycle(math.nan, math.nan)
    begin, end = rises[-2], rises[-1]
    return Cycle(float(np.ptp(values[begin : end + 1])), float(time[end] - time[begin]))


class Growth(NamedTuple):
    """Rate at which an oscillation grows, 1/s, below zero where it decays, and its frequency, rad/s."""

    rate: float
    frequency: float


def growth(time: Numbers, values: Numbers) -> Growth:
    """Growth of an oscillation about its mean, from the extremes between its zero crossings.

    Raises
    ------
    ValueError
        where there are fewer than five half cycles.
    """
    level = values - values.mean()
    crossings = np.flatnonzero(level[:-1] * level[1:] < 0.0)
    if len(crossings) < 6:
        raise ValueError(f"{len(crossings)} zero crossings are too few to see growth; record longer")
    shares = level[crossings] / (level[crossings] - level[crossings + 1])
    times = time[crossings] + shares * np.diff(time)[crossings]
    parts = [level[a : b + 1] for a, b in pairwise(crossings)]
    peaks = np.array([np.abs(part).max() for part in parts])
    at = 0.5 * (times[:-1] + times[1:])
    # of two neighbours, so that an error of the mean cancels
    pairs, between = peaks[:-1] + peaks[1:], 0.5 * (at[:-1] + at[1:])
    rate = float(np.polyfit(between, np.log(pairs), 1)[0])
    return Growth(rate, math.pi * (len(times) - 1) / float(times[-1] - times[0]))
