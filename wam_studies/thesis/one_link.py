"""The one-link testbed in the model of chapter 5, from the parameters of a recording."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wam_control.force.force_loop_parameters import ForceLoopParameters, force_law
from wam_description.arm import seconds
from wam_description.world import Springs
from wam_driver.driver import DriverParameters
from wam_studies.figures.panels import Line, Numbers, Series, line_only, measured
from wam_studies.plant.ideal_testbed import loop_node
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.recording import Recording, Step
from wam_theory.linear_loop import SampledMargin, damping_ratio, gain_ratio, sampled_margin
from wam_theory.stick_slip import FrictionNode, IntegralLoop, Motion, Verdict, simulate

ACROSS = 1  # y of the link's frame, along which the testbed presses


class OneLink(NamedTuple):
    """Node, loop and lever of a testbed with one joint and one motor."""

    node: FrictionNode
    loop: IntegralLoop
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
        """Gain ratio gamma (5.15) of the continuous loop."""
        n = self.node
        stiffness = n.transmission_stiffness, n.contact_stiffness
        return float(gain_ratio(self.loop.gain, n.inertia, n.damping, *stiffness))

    @property
    def zeta(self) -> float:
        """Damping ratio zeta (5.12)."""
        n = self.node
        return float(damping_ratio(n.inertia, n.damping, n.transmission_stiffness, n.contact_stiffness))

    def tip_gain(self, gain: float) -> float:
        """G_I at the tip, (m/s)/N, from that at the joint, (rad/s)/(N m)."""
        return gain * self.lever**2


def joint_stiffness(recording: Recording) -> float:
    """k_c of the spring at the joint, N m/rad."""
    springs = recording.parameters.part("driver", Springs, "world.springs.")
    return float(springs.stiffness[0] * springs.lever[0] ** 2)


def one_link(recording: Recording) -> OneLink:
    """Node and loop from the parameters of a recording.

    Raises
    ------
    ValueError
        if the arm has more than one joint, or the loop has a G_P.
    """
    arm, control = recording.shared.arm, recording.parameters.part("force_loop", ForceLoopParameters)
    if arm.n != 1:
        raise ValueError(f"{arm.name} has {arm.n} joints; this evaluation is for one")
    law = force_law(control)
    if law.proportional_gain[ACROSS]:
        raise ValueError(
            f"force_proportional_gain is {law.proportional_gain[ACROSS]:g}; this evaluation is without G_P"
        )
    ratio, lever = 1.0 / arm.joint_from_motor[0], control.contact_position
    (added,) = recording.parameters.part("driver", DriverParameters).effects.added_coulomb_friction
    node = loop_node(arm, joint_stiffness(recording))
    friction = {f"{kind}_friction": getattr(node, f"{kind}_friction") + added for kind in ("dynamic", "static")}
    loop = IntegralLoop(
        gain=law.gain[ACROSS] / lever**2,
        error_limit=law.error_limit[ACROSS] * lever,
        deadband=law.deadband[ACROSS] * lever,
        sample_period=seconds(recording.shared.timing.outer_period_ns),
        delay_samples=control.delay_samples,
    )
    return OneLink(replace(node, **friction), loop, lever, ratio)


class TestbedStep(NamedTuple):
    """A step of a testbed's run, or all of the run: the loop in it, and what it did."""

    run: Recording
    step: Step | None
    link: OneLink
    time: Numbers  # s
    force: Numbers  # N, of the arm on the spring
    motor: Numbers  # rad at the joint, positive as it presses
    speed: Numbers  # rad/s of the joint, positive as it presses

    @property
    def line(self) -> Series:
        """The force over time."""
        return measured(self.time, self.force)

    @property
    def desired(self) -> float:
        """Commanded force at the start of the step, N."""
        command = self.run.forces("force_command")
        return float(np.linalg.norm(command.force[np.searchsorted(command.time, self.time[0] - 1e-9)]))

    @property
    def start(self) -> tuple[float, float, float]:
        """x, v and x_m at the start of the step."""
        x = float(self.force[0]) * self.link.lever / self.link.node.contact_stiffness
        return x, float(self.speed[0]), float(self.motor[0])

    def exact(self, start: tuple[float, float, float] = (0.0, 0.0, 0.0), is_sampled: bool = True) -> Motion:
        """The exact motion at the times of the step.

        Parameters
        ----------
        start : x, v and x_m.
        is_sampled : whether the loop is; otherwise it is continuous.
        """
        link, loop = self.link, self.link.loop if is_sampled else replace(self.link.loop, sample_period=0.0)
        motion = simulate(link.node, loop, self.desired * link.lever, float(np.ptp(self.time)), start)
        return motion.at(self.time - self.time[0])

    def exact_line(self, start: tuple[float, float, float] = (0.0, 0.0, 0.0), is_sampled: bool = True) -> Line:
        """The exact force over time as a named line; the arguments are those of `exact`."""
        return "exact", line_only(self.time, self.exact(start, is_sampled).contact_force / self.link.lever)

    @property
    def verdict(self) -> str:
        """Settled, limit cycle or diverged, from the spans of the last two quarters.

        It is diverged if the driver stopped the arm, or if the span still grows.
        """
        if self.step and self.step.begin <= self.run.fault_time <= self.step.end:
            return str(Verdict.DIVERGED)
        quarter = len(self.force) // 4
        before, late = (float(np.ptp(part)) for part in (self.force[-2 * quarter : -quarter], self.force[-quarter:]))
        size = max(float(np.ptp(self.force)), 1e-9)
        if late < BOUNDS.settled_span * size or late < (1.0 - BOUNDS.steady_span) * before:
            return str(Verdict.SETTLED)
        return str(Verdict.DIVERGED if late > (1.0 + BOUNDS.steady_span) * before else Verdict.LIMIT_CYCLE)


def played(run: Recording, step: Step | None = None, topic: str = "joint_sensors") -> TestbedStep:
    """What a run did in a step, or in all of it, by the joint angles of a topic."""
    before = run.steps[: run.steps.index(step) + 1] if step in run.steps else ()
    settings = {key: value for one in before for key, value in one.settings.items()}
    link = one_link(run._replace(parameters=run.parameters.with_values(settings)))
    sensors, motors = run.joints(topic), run.joints("motor_states")
    begin, end = (step.begin, step.end) if step else (0.0, math.inf)
    if not math.isnan(run.fault_time):
        end = min(end, run.fault_time)
    chosen = (sensors.time >= begin - 1e-9) & (sensors.time <= end + 1e-9)
    time, force = sensors.time[chosen], -link.node.contact_stiffness * sensors.position[chosen, 0] / link.lever
    motor = -np.interp(time, motors.time, motors.position[:, 0]) / link.ratio
    return TestbedStep(run, step, link, time, force, motor, -sensors.velocity[chosen, 0])
