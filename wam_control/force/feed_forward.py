"""Dry friction that is fed forward besides the velocity of the force loop."""

import math
from collections.abc import Sequence

from wam_control.force.thresholds import FORCE
from wam_description.arm import Arm
from wam_description.transmission_map import TransmissionMap


def dry_friction(arm: Arm, transmission: TransmissionMap, velocity: Sequence[float]) -> list[float]:
    """Dry friction of motors and joints, N m at the joints (n,), in a motion of the joints (n,), rad/s.

    Less than all of it moves nothing.  Where the force is off to the other side, the velocity loops need not wind
    up through twice the friction, which takes them seconds.
    """
    turning = zip(arm.motors.dynamic_friction, transmission.motor_velocities(velocity), strict=True)
    turned = transmission.joint_torques([friction * math.tanh(speed / FORCE.slow_motor) for friction, speed in turning])
    moved = zip(arm.joints.dynamic_friction, velocity, turned, strict=True)
    return [torque + friction * math.tanh(speed / FORCE.slow_joint) for friction, speed, torque in moved]
