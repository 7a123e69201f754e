"""Simulation of a saturated loop with dry friction on an arm of one joint, including its velocity loop.

Many trials run in parallel, one per column.  Each inner period has `parts` steps.  Within a step all
but friction is exact; friction is the constant torque that would bring the joint to rest at the end
of the step, limited to F_static if the joint was sticking, else F_dynamic.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.force.sampled_loop import Axes, Feedback, SampledLoop
from wam_control.force.thresholds import GUARD
from wam_theory.stick_slip import FrictionNode
from wam_theory.zero_order_hold import zero_order_hold

Array = NDArray[np.float64]


class FrictionTrial(NamedTuple):
    """The loop that is simulated.

    Attributes
    ----------
    loop, q, axes, contact, feedback : as in `SampledLoop.margin`; one joint, one axis.
    node : the same arm as a friction node along the axis.
    deadband : of the law, N or N m.
    """

    loop: SampledLoop
    q: Sequence[float]
    axes: Axes
    contact: Array
    feedback: Feedback
    node: FrictionNode
    deadband: float

    def stable_error(self, cycle: float) -> float:
        """Largest saturation with which steps of every size end at rest or in the stiction cycle; 0 for none.

        Parameters
        ----------
        cycle : peak to peak of the stiction limit cycle, N or N m.
        """
        limits = np.array([part * self.node.static_friction for part in GUARD.trial_candidates])
        limits = limits[limits > self.deadband / GUARD.sure]
        if not limits.size:
            return 0.0
        tried, steps = np.repeat(limits, len(GUARD.steps)), np.outer(limits, GUARD.steps).ravel()
        last = self._rest(tried, steps)
        settles: list[bool] = np.all(
            (last <= GUARD.rest_fraction * tried + GUARD.cycle_excess * cycle).reshape(limits.size, -1), axis=1
        ).tolist()
        error = 0.0
        for limit, good in zip(limits[::-1].tolist(), settles[::-1], strict=True):
            if not good:
                break  # every smaller one has to be good as well
            error = GUARD.sure * limit
        return error

    def _rest(self, limits: Array, steps: Array) -> Array:
        """Peak to peak of the force in the last eighth of each trial, N or N m."""
        loop, q, axes, contact, feedback, node, deadband = self
        free, shown = loop.plant(q, contact, feedback)
        inertia = loop.body.mass_matrix(q) + loop.armature
        push = np.array([[0.0], [0.0], [0.0], [1.0 / float(inertia[0, 0])]])
        drift, drive = zero_order_hold(free, np.hstack([loop.inlet, push]), loop.tick / GUARD.parts)
        motor, joint = drive[:, :1], drive[:, 1:]
        row = (axes.sense @ shown)[0]
        share = (
            float((axes.sense @ loop.body.mass_matrix(q) / inertia)[0, 0]) if feedback.kind == "joint_sensors" else 0.0
        )
        reduction, move = float(loop.motor_from_joint[0, 0]), float(axes.move[0, 0])
        levers = node.static_friction, node.dynamic_friction
        static, dynamic = (value / move for value in levers)  # at the joint
        gain, proportional = float(axes.gain[0]), float(axes.proportional_gain[0])
        outer = loop.tick * loop.divisor
        lag = axes.filter_time + (feedback.lag if feedback.kind == "contact_estimate" else 0.0)
        whole, late = divmod(axes.delay, loop.divisor)
        count = limits.size
        x, integral, friction = np.zeros((4, count)), np.zeros(count), np.zeros(count)
        force, commanded, earlier = np.zeros(count), np.zeros(count), [np.zeros(count)] * whole
        sticks = np.ones(count, dtype=bool)
        periods = math.ceil(_duration(node, gain) / outer)
        least, most = np.full(count, math.inf), np.full(count, -math.inf)
        for period in range(periods):
            before = force
            force = before + (row @ x + share * friction - before) * outer / (outer + lag)
            error, old = (np.clip(steps - value, -limits, limits) for value in (force, before))
            effective = np.sign(error) * np.maximum(np.abs(error) - deadband, 0.0)
            earlier = [*earlier, move * (gain * effective + proportional * (error - old) / outer)]
            command, *earlier = earlier
            for tick in range(loop.divisor):
                e = reduction * (commanded if tick < late else command) - x[1]
                integral = integral + float(loop.ki[0, 0]) * loop.tick * e
                torque = float(loop.kp[0, 0]) * e + integral
                for _ in range(GUARD.parts):
                    ahead = drift @ x + motor * torque
                    needed = -ahead[3] / joint[3, 0]
                    sticks = np.abs(needed) <= np.where(sticks, static, dynamic)
                    friction = np.where(sticks, needed, np.copysign(dynamic, needed))
                    x = ahead + joint * friction
            commanded = command
            if period >= periods * 7 // 8:
                pressed = contact[0, 0] * x[2] * move
                least, most = np.minimum(least, pressed), np.maximum(most, pressed)
        found: Array = most - least
        return np.where(np.isfinite(found), found, math.inf)


def _duration(node: FrictionNode, gain: float) -> float:
    """Duration of a trial, s."""
    ktr, kc = node.transmission_stiffness, node.contact_stiffness
    frequency = math.sqrt((ktr + kc) / node.inertia)
    return (
        GUARD.rises * max(GUARD.steps) * (ktr + kc) / (ktr * kc * gain) + GUARD.oscillations * 2.0 * math.pi / frequency
    )
