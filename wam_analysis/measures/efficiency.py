"""Efficiency of a transmission (3.2.4)."""

import math
from typing import NamedTuple

import numpy as np

from wam_bag.arrays import Mask, Numbers


class Efficiency(NamedTuple):
    """Work in and out while power flows one way, J, and their ratio; NaN if none flowed.

    `forward` is from the motor to the joint, `back` from the joint to the motor.
    """

    forward: float
    forward_put: float
    forward_got: float
    back: float
    back_put: float
    back_got: float


def efficiency(time: Numbers, motor_power: Numbers, joint_power: Numbers) -> Efficiency:
    """Efficiency as work at the joint over work at the motor, 3.2.4, and the same backwards.

    Parameters
    ----------
    time : (n,), s.
    motor_power : (n,), power of the motor on the transmission, W, less that which accelerates the rotor.
    joint_power : (n,), power of the transmission on the joint, W.

    Notes
    -----
    A sample is forward if both powers are positive, backward if both are negative.  Of a gap that is longer than the
    median period nothing is known: it holds no work.
    """
    dt = np.diff(time, append=time[-1:])
    if len(time) > 1:
        dt = np.minimum(dt, np.median(dt[:-1]))
        dt[-1] = dt[-2]

    def work(power: Numbers, rows: Mask) -> float:
        return float(np.sum(np.abs(power[rows]) * dt[rows]))

    onward = (motor_power > 0.0) & (joint_power > 0.0)
    backward = (motor_power < 0.0) & (joint_power < 0.0)
    put, got = work(motor_power, onward), work(joint_power, onward)
    back_put, back_got = work(joint_power, backward), work(motor_power, backward)
    return Efficiency(
        forward=got / put if put > 0.0 else math.nan,
        forward_put=put,
        forward_got=got,
        back=back_got / back_put if back_put > 0.0 else math.nan,
        back_put=back_put,
        back_got=back_got,
    )
