"""Torques that are fed forward besides the velocity of the force loop: those of the forces, and dry friction."""

import math
from collections.abc import Sequence

import numpy as np

from wam_control.force.command_run import CommandRun
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.thresholds import FORCE
from wam_description.arm import Arm
from wam_description.rigid_body import Array
from wam_description.transmission_map import TransmissionMap


def force_torque(run: CommandRun, holds: bool, own: ForceLoopParameters) -> Array:
    """Torque of the forces (n,), N m: after the touch, where the place is known.

    The velocity loops need not wind up to it; what they have wound up to before is left out.

    Parameters
    ----------
    run : of the command.
    holds : whether the arm holds instead.
    own : parameters of the force loop.
    """
    fed = np.zeros(len(run.approached))
    for one in run.axes:
        axis = one.now
        if axis.is_force and not holds:
            fed += own.force_feedforward * axis.desired * axis.along
        if run.is_touching and axis.is_force and axis.place is not None:
            if holds or not axis.place.is_known:
                one.wound_up = math.inf
                continue
            if not math.isfinite(one.wound_up):
                one.wound_up = one.known.force * (own.is_estimated or one.wound_up == math.inf)
            fed += ((1.0 - own.force_feedforward) * one.rising - one.wound_up) * axis.along
    return fed


def dry_friction(arm: Arm, transmission: TransmissionMap, velocity: Sequence[float]) -> list[float]:
    """Dry friction of motors and joints, N m at the joints (n,), in a motion of the joints (n,), rad/s.

    Less than all of it moves nothing.  Where the force is off to the other side, the velocity loops need not wind
    up through twice the friction, which takes them seconds.
    """
    turning = zip(arm.motors.dynamic_friction, transmission.motor_velocities(velocity), strict=True)
    turned = transmission.joint_torques([friction * math.tanh(speed / FORCE.slow_motor) for friction, speed in turning])
    moved = zip(arm.joints.dynamic_friction, velocity, turned, strict=True)
    return [torque + friction * math.tanh(speed / FORCE.slow_joint) for friction, speed, torque in moved]
