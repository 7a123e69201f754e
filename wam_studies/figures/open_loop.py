"""Numbers of figure 2.1.1: error of the force without feedback over the workspace, and with feed-forward (7.2.2)."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from wam_analysis.table import markdown
from wam_description.arm import Arm
from wam_description.configuration import Configuration, packaged
from wam_description.effects import Ripples
from wam_description.rigid_body import RigidBody
from wam_driver.amplifier import Amplifier
from wam_driver.driver import DriverParameters
from wam_studies.figures.conditions import CASE
from wam_studies.figures.panels import Numbers, Panel, Panels, Series, line_only
from wam_studies.plant.ideal_testbed import released_plant

WORST = "worst by statics, "  # label of a bound
Pushes = list[tuple[tuple[float, ...], Numbers]]


class OpenLoopArm:
    """The arm without gravity, torques fed forward through its amplifiers, against springs at the tip.

    Parameters
    ----------
    quiet : whether the motors are those of 2.1.1 and the transmission has no friction; otherwise those of 7.2.2, of
        whose friction a part is cogging.
    fed_forward : part of the motors' friction and cogging that is fed forward.
    """

    def __init__(self, quiet: bool, fed_forward: float = 0.0) -> None:
        configuration = Configuration.load(packaged("wam"))
        arm, driver = configuration.shared.arm, configuration.node("driver", DriverParameters)
        continuous, none = np.array(arm.motors.continuous_torque), (0.0,) * arm.n
        measured = np.array(arm.motors.static_friction)
        friction = CASE.friction_share * continuous if quiet else (1.0 - CASE.cogging) * measured
        level = tuple(friction.tolist())
        motors, joints = replace(arm.motors, static_friction=level, dynamic_friction=level), arm.joints
        if quiet:
            joints = replace(joints, static_friction=none, dynamic_friction=none)
        self.arm: Arm = replace(arm, motors=motors, joints=joints, gravity=(0.0, 0.0, 0.0))
        self._cogging = np.zeros(len(none)) if quiet else CASE.cogging * measured
        self._fed_forward = fed_forward
        amplitude, cycles = tuple(self._cogging.tolist()), (CASE.cogging_cycles,) * len(none)
        self._ripples = Ripples(arm.motors.names, (1.0,) * len(none), amplitude, cycles, none)
        constant = np.array(arm.motors.torque_constant)
        currents = tuple((CASE.deadband * continuous / constant).tolist())
        ripples = (CASE.ripple,) * len(currents)
        self._amplifier_parameters = replace(driver.amplifier, deadband=currents, torque_ripple=ripples)
        self._constant = constant
        self._to_motors = self.arm.transmission.joint_from_motor.T
        self._body = RigidBody(self.arm)

    def error(self, q: tuple[float, ...], force: Numbers) -> float:
        """Force at rest minus the commanded one, along it, N.

        Parameters
        ----------
        q : pose, rad.
        force : (3,) N, of the tip on the springs, applied slowly.
        """
        arm, n = self.arm, len(q)
        start = replace(arm, joints=replace(arm.joints, start=q))
        plant = released_plant(start, step=CASE.open_loop_step, ripples=self._ripples)
        amplifier = Amplifier(start.motors, self._amplifier_parameters, np.random.default_rng(0))
        jacobian = self._body.tool_jacobian(q)
        stiffness = CASE.contact_at_tip * jacobian.T @ jacobian
        damping = 2.0 * 0.3 * np.sqrt(CASE.contact_at_tip * 2.0) * jacobian.T @ jacobian
        torque = self._to_motors @ jacobian.T @ force
        friction = self._fed_forward * np.sign(torque) * start.motors.static_friction
        rising, at_rest = (
            round(CASE.rise / CASE.open_loop_step),
            round(CASE.rest / CASE.open_loop_step),
        )
        for i in range(rising + at_rest):
            share = 0.5 - 0.5 * np.cos(np.pi * min(1.0, i / rising))
            cogging = self._fed_forward * self._cogging * np.sin(CASE.cogging_cycles * np.array(plant.theta))
            currents = amplifier.step(
                ((share * torque + friction - cogging) / self._constant).tolist(), CASE.open_loop_step
            )
            away, speed = np.array(plant.q) - q, np.array(plant.qd)
            plant.data.qfrc_applied[n : 2 * n] = -stiffness @ away - damping @ speed
            plant.step(amplifier.torque(currents, plant.theta))
        reached = CASE.contact_at_tip * jacobian @ (np.array(plant.q) - q)
        unit = force / np.linalg.norm(force)
        return float(unit @ reached - np.linalg.norm(force))

    def bound(self, q: tuple[float, ...], force: Numbers) -> float:
        """Largest error at rest by statics, N: every friction, ripple and deadband at its worst.

        n (J J^T)^-1 J maps torques that the joints lack to the force along n.
        """
        jacobian = self._body.tool_jacobian(q)
        unit = force / np.linalg.norm(force)
        weights = np.linalg.solve(jacobian @ jacobian.T, jacobian).T @ unit
        motors, joints = self.arm.motors, self.arm.joints
        torque = np.abs(self._to_motors @ jacobian.T @ force)
        at_motor = CASE.ripple * torque + motors.static_friction + self._cogging
        at_motor += CASE.deadband * np.array(motors.continuous_torque)
        through = np.linalg.inv(self._to_motors) * at_motor  # columns: joint torques that each motor lacks
        return float(np.abs(weights) @ joints.static_friction + np.abs(weights @ through).sum())

    def pushes(self) -> Pushes:
        """Random poses, and the force in a random direction that takes the continuous torque of one motor."""
        random, joints = np.random.default_rng(CASE.open_loop_seed), self.arm.joints
        found: Pushes = []
        while len(found) < CASE.open_loop_poses:
            q = tuple(random.uniform(joints.lower, joints.upper).tolist())
            unit = random.normal(size=3)
            unit /= np.linalg.norm(unit)
            jacobian = self._body.tool_jacobian(q)
            if np.linalg.svd(jacobian)[1][-1] > CASE.singular:
                needed = np.abs(self._to_motors @ jacobian.T @ unit) / self.arm.motors.continuous_torque
                found.append((q, unit / needed.max()))
        return found


def open_loop() -> Panels:
    """Distribution of the error over poses and directions, with the worst by statics; and with feed-forward."""
    pushes = OpenLoopArm(True).pushes()
    panels = []
    for title, arm in (("a) motors of 2.1.1 alone", OpenLoopArm(True)), ("b) the arm of 7.2.2", OpenLoopArm(False))):
        lines = []
        for share in CASE.force_shares:
            bounds, errors = (_sorted(of, pushes, share) for of in (arm.bound, arm.error))
            lines.append((f"{100 * share:g} % of the steady force", line_only(errors, _parts())))
            lines.append((f"{WORST}{100 * share:g} %", line_only(bounds, _parts())))
        panels.append(_panel(title, lines))
    known = _sorted(OpenLoopArm(False, CASE.fed_forward).error, pushes, CASE.force_shares[-1])
    plain = panels[-1].line(f"{100 * CASE.force_shares[-1]:g} % of the steady force")
    both = [("0 % fed forward", plain), ("90 % fed forward", line_only(known, _parts()))]
    return (*panels, _panel("c) feed-forward, 10 % of the steady force", both))


def _parts() -> Numbers:
    return (np.arange(CASE.open_loop_poses) + 0.5) / CASE.open_loop_poses


def _sorted(of: Callable[[tuple[float, ...], Numbers], float], pushes: Pushes, share: float) -> Numbers:
    """Errors or bounds of a share of each force, percent of the largest steady force, the least first."""
    return np.sort([100.0 * abs(of(q, share * force)) / np.linalg.norm(force) for q, force in pushes])


def _panel(title: str, lines: list[tuple[str, Series]]) -> Panel:
    return Panel(title, "error divided by the steady force [%]", "fraction of the poses [-]", lines)


def table(panels: Panels) -> str:
    """Median and largest error of each case as Markdown."""
    rows = [
        (panel.title[3:], label, *(f"{at(series.x):.2g} %" for at in (np.median, np.max)))
        for panel in panels
        for label, series in panel.lines
        if not label.startswith(WORST)
    ]
    return markdown(("arm", "case", "median error", "largest error"), rows)
