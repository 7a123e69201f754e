"""What limits the motion: bounds of each joint, a speed along a force, and pushes that are given way to."""

import math
from collections.abc import Sequence

import numpy as np

from wam_control.force.axes import CommandedAxis
from wam_control.force.force_axis import Angles, ForceAxis
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.problem import VelocityRow, unlimited
from wam_control.force.thresholds import FORCE
from wam_description.parts import Joints
from wam_description.rigid_body import Array, RigidBody
from wam_description.small_matrices import largest_eigenvalue, length


def joint_bounds(
    q: Sequence[float], joints: Joints, own: ForceLoopParameters, before: Sequence[float], step: float
) -> tuple[list[float], list[float]]:
    """Least and largest velocity of each joint (n,), rad/s: its speed limit, and a velocity damper at its ends.

    Within these, no velocity is further than a step from the one before (n,), rad/s.
    """
    gain, margin, speed = own.limits.joint_gain, own.limits.joint_margin, own.joint_speed_limit

    def towards(distance: float) -> float:
        fastest = gain * (distance - margin) if gain else speed
        if fastest >= speed:  # as most joints are: far from their ends
            return speed
        return max(fastest, 0.0) if distance >= 0.0 else max(gain * distance, -min(FORCE.slow, speed))

    ends = zip(joints.lower, q, joints.upper, before, strict=True)
    each = [(-towards(at - lower), towards(upper - at), last) for lower, at, upper, last in ends]
    return [min(max(v - step, a), b) for a, b, v in each], [min(max(v + step, a), b) for a, b, v in each]


def reachable(row: VelocityRow, jacobian: Array, held: Sequence[VelocityRow], most: float) -> VelocityRow:
    """The velocity along an axis with which its point is no faster than allowed, and which is zero at a singular pose.

    Near that, the joints would move fast for it, and jump as they pass.

    Parameters
    ----------
    row : commanded.
    jacobian : of the point (3, n).
    held : rows of the forces, along which it does not move the arm.
    most : speed of the point, m/s.
    """
    per_speed = unlimited([row._replace(speed=1.0), *(one._replace(speed=0.0) for one in held)], 0.0 * row.along)
    lever = 1.0 / max(length(per_speed), FORCE.negligible)  # nothing moves along a direction without a lever
    near = (lever / (FORCE.singular * largest_lever(jacobian))) ** 3
    speed = length(jacobian.dot(per_speed)) * abs(row.speed) + FORCE.negligible
    return row._replace(speed=min(near, most / speed, 1.0) * row.speed)


def yielding(sensed: ForceAxis, own: ForceLoopParameters) -> float:
    """How far the stiffest surface and the cables yield to a force, m/N."""
    return 1.0 / own.guard.contact_stiffness + sensed.compliance


def approach_speed(
    axis: CommandedAxis, is_touching: bool, own: ForceLoopParameters, servo_yielding: float = 0.0
) -> float:
    """Largest speed along a force, m/s.

    Until something is touched, the impact (3.1), v sqrt(m k), stays below `limits.impact` of the force.  At a place
    that is not known the arm is slower, since the touch is detected late; after the touch, too, since the measured
    force is late: it rises in no less than some latencies of it on the stiffest surface.  The velocity loops that wind
    up to it yield as the surface does.

    Parameters
    ----------
    axis : of the force.
    is_touching : whether something is touched.
    own : parameters of the force loop.
    servo_yielding : how far the velocity loops yield to a force, m/N.
    """
    sensed, place, limits = axis.sensed, axis.place, own.limits
    if not limits.impact or sensed is None or place is None or not sensed.speed_fraction:
        return math.inf
    slowest = FORCE.creep / limits.settling_time
    whole = axis.desired * yielding(sensed, own)
    rise = own.rise_time if place.is_known else max(FORCE.identified_rise, own.rise_time)
    if is_touching:
        return max((whole + axis.desired * servo_yielding) / sensed.speed_fraction / rise, slowest)
    fastest = limits.impact * axis.desired / math.sqrt(sensed.impact_mass * own.guard.contact_stiffness)
    if not place.is_known:
        detected = own.rise_time if own.is_estimated else FORCE.shown * own.latency
        fastest = min(fastest, max(whole / detected, slowest))
    return fastest / sensed.speed_fraction


def servo_yielding(axis: CommandedAxis, servo_stiffness: Array, own: ForceLoopParameters) -> float:
    """How far the velocity loops yield to a force that is not fed forward, m/N: |l|^4 / l.K l.

    From the motors, this is a force at a place that is not known.

    Parameters
    ----------
    axis : of the force.
    servo_stiffness : integral gains K at the joints (n, n), N m/rad.
    own : parameters of the force loop.
    """
    if axis.place is None or axis.place.is_known or not own.is_estimated:
        return 0.0
    square = float(axis.along.dot(axis.along))
    return square * square / max(float(axis.along.dot(servo_stiffness).dot(axis.along)), FORCE.negligible)


def resolution(sensed: ForceAxis, desired: float, own: ForceLoopParameters) -> float:
    """Error of a force, N, that is left alone: a smaller one than friction lets the arm correct."""
    return min(FORCE.kept * own.limits.tolerance * abs(desired), FORCE.finest_motion / yielding(sensed, own))


def certain_size(torques: Array, torque_sd: Array) -> float:
    """Size of torques (n,), N m, less what is uncertain of it by their standard deviations (n,), N m."""
    return max(length(torques) - FORCE.certain * length(torque_sd), 0.0)


def largest_lever(jacobian: Array) -> float:
    """Largest torque on the joints per force, m, at a point with this Jacobian (3, n)."""
    return max(math.sqrt(largest_eigenvalue(jacobian.dot(jacobian.T))), FORCE.least_lever)


def lever_of(jacobian: Array, torques: Array) -> float:
    """Torques (n,), N m, per least force at a point with this Jacobian (3, n) that explains them best, m."""
    explained = float(torques @ jacobian.T @ np.linalg.lstsq(jacobian.T, torques, rcond=None)[0])
    return length(jacobian.dot(torques)) * length(torques) / max(explained, FORCE.negligible)


def likeliest_link(body: RigidBody, q: Angles, torques: Array) -> Array:
    """Jacobian (3, n) of the far end of the link of which one force explains torques (n,), N m, best.

    Elsewhere on this link, a force needs to be larger for the same torques.
    """
    covers = body.arm.covers
    ends = [
        body.point_jacobian(q, name, (length, 0.0, 0.0))
        for name, length in zip(covers.names, covers.length, strict=True)
    ]
    return min(
        ends, key=lambda one: float(np.linalg.norm(torques - one.T @ np.linalg.lstsq(one.T, torques, rcond=None)[0]))
    )


def calm(velocity: Array, inertia: Array, energy: float) -> Array:
    """Velocities (n,), rad/s, with no more than this kinetic energy, J: something may be in the way."""
    moving = 0.5 * float(velocity @ inertia @ velocity)
    return velocity * math.sqrt(energy / moving) if moving > energy else velocity


def followed(posture: Array, axis: CommandedAxis, body: RigidBody, q: Angles, own: ForceLoopParameters) -> Array:
    """Velocities of a posture (n,), rad/s, at which the link slides no faster than the force law follows a slope.

    The law follows with its gain once the change is measured; until then the surface yields.
    """
    assert axis.place is not None
    assert axis.sensed is not None
    point = body.arm.covers.on_axis(axis.place.cover, axis.place.position)
    slide = FORCE.slide_slope * length(body.point_jacobian(q, axis.place.cover, point).dot(posture))
    pace = min(max(own.force_gain), yielding(axis.sensed, own) / own.latency)
    most = pace * min(own.limits.tolerance, 1.0) * abs(axis.desired)
    return posture * (most / slide) if slide > most else posture
