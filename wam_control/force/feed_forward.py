"""What is fed forward besides the velocity of the force loop: torques of the commanded forces, and dry friction.

The torque of a force on a free arm is a throw: the arm hits what it was to touch.  From the motors it is fed forward
after the touch alone; `force_feedforward` feeds it forward from the command on.
"""

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.force_measurement import LowPass
from wam_control.force.thresholds import FORCE
from wam_description.arm import Arm
from wam_description.transmission_map import TransmissionMap

Array = NDArray[np.float64]


class FeedForward:
    """Joint torques of one arm that are added to those of its velocity loops.

    Parameters
    ----------
    arm : the arm as the controller knows it.
    """

    def __init__(self, arm: Arm) -> None:
        self._arm = arm
        self._countered = LowPass()

    @cached_property
    def _map(self) -> TransmissionMap:
        return TransmissionMap.of(self._arm)

    def step(self, force: Array, velocity: Sequence[float], parameters: ForceLoopParameters, dt: float) -> list[float]:
        """Torque of the joints in one outer period (n,), N m: of the forces and, with joint sensors, of friction.

        Parameters
        ----------
        force : torque of the forces that are fed forward (n,), N m.
        velocity : commanded, of the joints (n,), rad/s.
        parameters : of the force loop.
        dt : outer period, s.
        """
        if parameters.friction_feedforward and not parameters.is_estimated:
            friction = self._countered.step(self._friction(velocity), FORCE.friction_time, dt)
            force = force + parameters.friction_feedforward * np.array(friction)
        result: list[float] = force.tolist()
        return result

    def _friction(self, velocity: Sequence[float]) -> list[float]:
        """Dry friction of motors and joints, N m at the joints (n,), in a motion of the joints (n,), rad/s.

        Less than all of it moves nothing.  Where the force is off to the other side, the velocity loops need not wind
        up through twice the friction, which takes them seconds.
        """
        motors, joints = self._arm.motors.dynamic_friction, self._arm.joints.dynamic_friction
        turning = zip(motors, self._map.motor_velocities(velocity), strict=True)
        turned = self._map.joint_torques(
            [friction * math.tanh(speed / FORCE.slow_motor) for friction, speed in turning]
        )
        moved = zip(joints, velocity, turned, strict=True)
        return [torque + friction * math.tanh(speed / FORCE.slow_joint) for friction, speed, torque in moved]
