"""The force loop as one linear map from outer period to outer period, without friction.

Rotors, cables, links and the contact move freely for one inner period under the torque that the
velocity loop has set; the velocity loop answers every inner period, the force loop every outer one.
All of it is linear between samples and is carried from sample to sample in closed form, so that
hold, delay and the lag of the velocity loop are exact.  Friction is bounded: if this map is stable,
no force loop with friction can diverge.
"""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from wam_description.arm import Arm, Servo, Timing
from wam_description.rigid_body import Array, RigidBody
from wam_theory.velocity_servo import is_stable
from wam_theory.zero_order_hold import zero_order_hold


class Feedback(NamedTuple):
    """Source of the controlled force.

    `kind` is the parameter feedback of the force loop; `spring` (n,) N m/rad is for joint_position; `lag` s is
    the time constant of the estimate for contact_estimate.
    """

    kind: str
    spring: tuple[float, ...]
    lag: float


class Axes(NamedTuple):
    """What is controlled: p axes of force on n joints.

    Attributes
    ----------
    sense : (p, n), force of each axis, N or N m, per torque of the world on the joints.
    move : (n, p), joint velocity per velocity of each axis.
    gain, proportional_gain : (p,), G_I and G_P.
    hold : (n, n), joint velocity per joint angle, by which the posture is held, 1/s.
    spring : (p, n), velocity of each axis per joint angle by its stiffness, which is scaled as the gains are.
    filter_time : time constant of the low pass on the force, s; the rate of G_P is taken behind it.
    delay : inner periods from the sample to the use of its command, whole outer periods included.
    """

    sense: Array
    move: Array
    gain: Array
    proportional_gain: Array
    hold: Array
    spring: Array
    filter_time: float
    delay: int


class SampledLoop:
    """Arm, velocity loop and force loop as a linear map; built for one arm and one set of servo gains.

    Parameters
    ----------
    arm : the arm as the controller knows it.
    timing : periods of the loops.
    servo : gains of the velocity loop.
    """

    def __init__(self, arm: Arm, timing: Timing, servo: Servo) -> None:
        n = arm.n
        self.body = RigidBody(arm)
        self.joint_from_motor = arm.transmission.joint_from_motor
        self.motor_from_joint = arm.transmission.motor_from_joint
        self._n, self.tick, self.divisor = n, timing.period, timing.outer_divisor
        stiffness = np.array([circuit.stiffness for circuit in arm.circuits])
        damping = np.array(arm.cables.damping)
        zero, one = np.zeros((n, n)), np.eye(n)
        # states: theta, thetad, q, qd
        cable = np.hstack(
            [
                np.diag(stiffness),
                np.diag(damping),
                -stiffness[:, None] * self.motor_from_joint,
                -damping[:, None] * self.motor_from_joint,
            ]
        )
        rotor = 1.0 / np.array(arm.motors.inertia)[:, None]
        self._motor = -rotor * (np.hstack([zero, np.diag(arm.motors.viscous_friction), zero, zero]) + cable)
        self._motor_rate = np.hstack([zero, one, zero, zero])
        self._joint_rate = np.hstack([zero, zero, zero, one])
        viscous = np.hstack([zero, zero, zero, np.diag(arm.joints.viscous_friction)])
        self._joint = self.motor_from_joint.T @ cable - viscous
        self.inlet = np.vstack([zero, np.diag(rotor[:, 0]), zero, zero])
        self.kp, self.ki = np.array(servo.proportional_gain)[:, None], np.array(servo.integral_gain)[:, None]

    def margin(
        self, q: Sequence[float], axes: Axes, contact: Array, feedback: Feedback, scales: Sequence[float]
    ) -> float:
        """Largest scale of all gains up to which the loop is linearly stable.

        Parameters
        ----------
        q : joint angles, (n,), rad.
        axes : what is controlled.
        contact : (n, n), torque of the contact on the joints per joint angle, N m/rad.
        feedback : source of the force.
        scales : scales to try, in rising order; the last one is returned where all are stable.

        Returns
        -------
        float
            0 where not even the smallest scale is stable.
        """
        period = self.period(q, axes, contact, feedback)
        still = period(0.0)
        moving = period(1.0) - still
        below = 0.0
        for scale in scales:
            if not is_stable(still + scale * moving):
                break
            below = scale
        else:
            return below
        above = scale
        while below and above > below * 1.002:
            middle = math.sqrt(below * above)
            if is_stable(still + middle * moving):
                below = middle
            else:
                above = middle
        return below

    def period(self, q: Sequence[float], axes: Axes, contact: Array, feedback: Feedback) -> Callable[[float], Array]:
        """The map of one outer period as a function of a factor of all gains; arguments as in `margin`.

        States: theta, thetad, q, qd, integrals of the velocity loop, filtered force, joint velocities
        commanded one period ago, and those of the law still to come.
        """
        n, p = self._n, len(axes.gain)
        free, shown = self.plant(q, contact, feedback)
        drift, drive = zero_order_hold(free, self.inlet, self.tick)
        whole, late = divmod(axes.delay, self.divisor)
        begins = np.cumsum([0, 4 * n, n, p, n, *[n] * whole]).tolist()
        state = np.eye(begins[-1])
        start, integrals, before, commanded, *earlier = (state[a:b] for a, b in pairwise(begins))
        outer = self.tick * self.divisor
        lag = axes.filter_time + (feedback.lag if feedback.kind == "contact_estimate" else 0.0)
        force = before + (axes.sense @ shown @ start - before) * outer / (outer + lag)
        at = self.joint_from_motor @ start[:n]
        speed = axes.gain[:, None] * force + axes.proportional_gain[:, None] * (force - before) / outer
        speed = speed + axes.spring @ at
        held = axes.hold @ at

        def scaled(scale: float) -> Array:
            x, integral = start, integrals
            law = [*earlier, -scale * axes.move @ speed]
            command = law[0] - held
            first, then = self.motor_from_joint @ commanded, self.motor_from_joint @ command
            for tick in range(self.divisor):
                error = (first if tick < late else then) - x[n : 2 * n]
                integral = integral + self.ki * self.tick * error
                x = drift @ x + drive @ (self.kp * error + integral)
            return np.vstack([x, integral, force, command, *law[1:]])

        return scaled

    def plant(self, q: Sequence[float], contact: Array, feedback: Feedback) -> tuple[Array, Array]:
        """Rate of the states theta, thetad, q, qd, (4n, 4n), and the torque that the feedback measures.

        The second, (n, 4n), is the torque of the arm on the world per state.
        """
        n = self._n
        links = self.body.mass_matrix(q)
        pressed = np.hstack([np.zeros((n, 2 * n)), contact, np.zeros((n, n))])
        qdd = np.linalg.solve(links + self.body.arm.pulleys, self._joint - pressed)
        shown = pressed
        if feedback.kind == "joint_sensors":
            shown = links @ qdd + pressed
        elif feedback.kind == "joint_position":
            shown = np.hstack([np.zeros((n, 2 * n)), np.diag(feedback.spring), np.zeros((n, n))])
        return np.vstack([self._motor_rate, self._motor, self._joint_rate, qdd]), shown
