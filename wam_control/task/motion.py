"""Motions limited in speed, acceleration and jerk: through postures, and along a straight line of the tool.

A motion is planned as a whole before it starts, from rest to rest, and refused with the number where it leaves the
limits of the joints.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyder, polyroots, polyval
from numpy.typing import NDArray

from wam_control.thresholds import MOTION
from wam_description.arm import Arm, MotionParameters
from wam_description.parameters import require
from wam_description.rigid_body import Array, RigidBody
from wam_description.signals import PathPoint, PosturePath, Triple

FASTEST = 15.0 / 8.0  # speed in the middle of a minimum-jerk path, of its mean
UNITS = ("rad/s", "rad/s^2", "rad/s^3")  # of the derivatives of a joint angle


class Moving(NamedTuple):
    """Joint angles (n,), rad, and their velocities (n,), rad/s; empty where only the angles are commanded."""

    position: list[float]
    velocity: list[float]


class SCurve:
    """From rest to rest over a distance in the shortest time within limits: seven parts of constant jerk.

    Parameters
    ----------
    distance : above 0, m or rad or 1.
    speed, acceleration, jerk : their limits, per s, s^2 and s^3.

    Attributes
    ----------
    duration : s.
    fastest : largest speed.
    """

    def __init__(self, distance: float, speed: float, acceleration: float, jerk: float) -> None:
        rise = min((distance / (2.0 * jerk)) ** (1.0 / 3.0), math.sqrt(speed / jerk), acceleration / jerk)
        ramp = 2.0 * rise
        if rise == acceleration / jerk:
            ramp = min(rise + speed / acceleration, rise / 2.0 + math.sqrt(rise * rise / 4.0 + distance / acceleration))
        cruise = max(distance / (jerk * rise * (ramp - rise)) - ramp, 0.0)
        steady = max(ramp - 2.0 * rise, 0.0)
        parts = ((rise, jerk), (steady, 0.0), (rise, -jerk), (cruise, 0.0), (rise, -jerk), (steady, 0.0), (rise, jerk))
        self._knots = [(0.0, 0.0, 0.0, 0.0, 0.0)]  # time, distance, speed, acceleration, jerk of each part
        for time, jerk_of_part in parts:
            begin, *state, _ = self._knots[-1]
            self._knots[-1] = (begin, state[0], state[1], state[2], jerk_of_part)
            self._knots.append((begin + time, *_on(state[0], state[1], state[2], jerk_of_part, time), 0.0))
        self.duration, self._distance = self._knots[-1][0], distance
        self.fastest = max(speed for _, _, speed, _, _ in self._knots)

    def at(self, time: float) -> tuple[float, float]:
        """Distance and speed at a time, s, from the start."""
        if time >= self.duration:
            return self._distance, 0.0
        begin, s, v, a, j = next(knot for knot in reversed(self._knots) if knot[0] <= max(time, 0.0))
        s, v, _ = _on(s, v, a, j, max(time, 0.0) - begin)
        return s, v


def _on(s: float, v: float, a: float, j: float, t: float) -> tuple[float, float, float]:
    """Distance, speed and acceleration after a time t of constant jerk."""
    return s + t * (v + t * (a / 2.0 + t * j / 6.0)), v + t * (a + t * j / 2.0), a + t * j


class GoalMotion:
    """Moves to a posture in a given time, along a minimum-jerk path; without velocities, as only its end is promised.

    Parameters
    ----------
    start, goal : joint angles (n,), rad.
    duration : s.

    Attributes
    ----------
    fastest : largest speed of each joint (n,), rad/s.
    """

    def __init__(self, start: Sequence[float], goal: Sequence[float], duration: float) -> None:
        self._from, self._to, self.duration = list(start), list(goal), duration
        self.fastest = [FASTEST * abs(b - a) / duration for a, b in zip(start, goal, strict=True)]

    def at(self, time: float) -> Moving:
        """The posture at a time, s, from the start."""
        if time >= self.duration:
            return Moving(list(self._to), [])
        s = time / self.duration
        blend = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
        return Moving([a + (b - a) * blend for a, b in zip(self._from, self._to, strict=True)], [])


class PostureMotion:
    """Through postures, in the given times or, without times, as fast as the limits allow with a stop at each.

    With times each part is a polynomial of degree five between the positions and velocities of its ends, without
    acceleration there; a posture without velocities is one at which the arm stops.  A first point at 0 s, as planners
    send it, has to be where the arm is.

    Parameters
    ----------
    start : joint angles (n,), rad, from which it starts at rest.
    trajectory : postures, velocities and times.
    arm : with the limits of the joints.
    limits : of the motion.

    Attributes
    ----------
    duration : s.
    fastest : largest speed of each joint (n,), rad/s.

    Raises
    ------
    ParameterError
        names the joint, the value and what is allowed.
    """

    def __init__(self, start: Sequence[float], trajectory: PosturePath, arm: Arm, limits: MotionParameters) -> None:
        self._joints = arm.joints
        self._allowed = limits.joint_speed, limits.joint_acceleration, limits.joint_jerk
        points = trajectory.points
        require(len(points) > 0, "the trajectory has no points; give at least one")
        if len(points) > 1 and points[0].time == 0.0 and any(point.time for point in points):
            self._require_there(start, points[0])
            points = points[1:]
        postures = [list(start), *(list(point.position) for point in points)]
        times = [point.time for point in points]
        for posture in postures[1:]:
            self._require_inside(posture)
        self._parts = (
            self._timed(postures, points)
            if any(times)
            else [_Straight(a, b, self._allowed) for a, b in pairwise(postures)]
        )
        self.duration = sum(part.duration for part in self._parts)
        self.fastest = [max(each) for each in zip(*(part.fastest for part in self._parts), strict=True)]

    def at(self, time: float) -> Moving:
        """The posture at a time, s, from the start."""
        for part in self._parts:
            if time < part.duration:
                break
            time -= part.duration
        else:
            time = part.duration
        return part.at(time)

    def _timed(self, postures: Sequence[list[float]], points: Sequence[PathPoint]) -> list["_Part"]:
        rest = [0.0] * len(postures[0])
        before = 0.0
        for point in points:
            require(
                point.time > before,
                f"a point of the trajectory is at {point.time:g} s, after one at {before:g} s; the times have to rise "
                "from above 0, or all be 0",
            )
            require(
                MOTION.shortest <= point.time - before <= MOTION.longest,
                f"a point of the trajectory is at {point.time:g} s, {point.time - before:g} s after the one before; "
                f"allowed: {MOTION.shortest:g} to {MOTION.longest:g} s between them",
            )
            self._require_within(1, list(map(abs, point.velocity)) or rest)  # what is far beyond has no polynomial
            before = point.time
        rates = [rest, *(list(point.velocity) or rest for point in points)]
        quintics = _Quintics(postures, rates, [0.0, *(point.time for point in points)])
        self._require_all(quintics)
        rate = rates[-1]
        require(
            not any(rate),
            f"the trajectory ends with {max(map(abs, rate)):.3g} rad/s; it has to end at rest: leave out the "
            "velocities of the last point",
        )
        return quintics.parts()

    def _require_all(self, quintics: "_Quintics") -> None:
        """Refuse a part whose derivatives or angles are beyond the limits, the first one by name."""
        largest = [quintics.largest(order) for order in range(1, len(self._allowed) + 1)]
        is_doubtful = quintics.may_leave(self._joints.lower, self._joints.upper)
        for found, limit in zip(largest, self._allowed, strict=True):
            is_doubtful |= (found > limit).any(axis=1)
        for part in np.flatnonzero(is_doubtful):
            for order, found in enumerate(largest, 1):
                self._require_within(order, found[part].tolist())
            for extreme in quintics.extremes(int(part)):
                self._require_inside(extreme)

    def _require_there(self, start: Sequence[float], first: PathPoint) -> None:
        for name, angle, begin in zip(self._joints.names, start, first.position, strict=True):
            require(
                abs(angle - begin) <= MOTION.arrived,
                f"{name} of the trajectory starts at {begin:.4g} rad, but the arm is at {angle:.4g} rad; allowed: a "
                f"difference of {MOTION.arrived:g} rad: plan from where the arm is, or leave out the point at 0 s",
            )
        require(not any(first.velocity), "the trajectory starts with a velocity; allowed: 0 rad/s, the arm is at rest")

    def _require_inside(self, posture: Sequence[float]) -> None:
        beyond = self._joints.beyond(posture)
        require(not beyond, f"the trajectory: {beyond}")

    def _require_within(self, order: int, sizes: Sequence[float]) -> None:
        """Refuse a derivative, of this order and size (n,), that is beyond the limits."""
        unit = UNITS[order - 1]
        for name, size, limit in zip(self._joints.names, sizes, self._allowed[order - 1], strict=True):
            require(
                size <= limit * (1.0 + MOTION.rounding),
                f"{name} of the trajectory reaches {size:.3g} {unit}; allowed: {limit:g} {unit} (motion); give it "
                f"{(size / limit) ** (1.0 / order):.3g} times the time, or no times",
            )


class LineMotion:
    """The tool along a straight line, in the joint angles nearest to those at its start.

    Parameters
    ----------
    start : joint angles (n,), rad, from which it starts at rest.
    goal : of the tool (3,), base frame, m.
    arm : with the limits of the joints.
    body : its kinematics.
    limits : of the motion, whose speed is reduced where a joint would be too fast.

    Attributes
    ----------
    duration : s.
    fastest : largest speed of each joint (n,), rad/s.

    Raises
    ------
    ParameterError
        names what the arm would reach, where on the line, and what is allowed.
    """

    def __init__(
        self, start: Sequence[float], goal: Triple, arm: Arm, body: RigidBody, limits: MotionParameters
    ) -> None:
        away = math.hypot(*goal)
        require(
            away <= body.reach,
            f"the goal of the tip is {away:.3g} m from the origin of the base frame; allowed: up to "
            f"{body.reach:.3g} m, the reach of the arm; give a goal nearer to the base",
        )
        begin = body.tool_pose(start).position
        self._length = float(np.linalg.norm(np.array(goal) - begin))
        self._angles = [np.array(start, float)]
        self._slopes: list[Array] = []
        self._profile: SCurve | None = None
        self.duration, self.fastest = 0.0, [0.0] * len(start)
        if self._length < MOTION.rounding:
            return
        along = (np.array(goal) - begin) / self._length
        for k in range(MOTION.nodes + 1):
            distance = self._length * k / MOTION.nodes
            if k:
                self._angles.append(self._node(body, begin + along * distance))
                self._require_reached(body, begin + along * distance, distance)
            self._slopes.append(self._slope(arm, body, along, distance))
        steepest = np.abs(self._slopes).max(axis=0)
        speed = min(limits.speed, *(np.array(limits.joint_speed) / np.maximum(steepest, MOTION.rounding)).tolist())
        self._profile = SCurve(self._length, speed, limits.acceleration, limits.jerk)
        self.duration = self._profile.duration
        times = (self.duration * k / MOTION.nodes for k in range(MOTION.nodes + 1))
        self.fastest = np.abs([self.at(time).velocity for time in times]).max(axis=0).tolist()

    def at(self, time: float) -> Moving:
        """The posture at a time, s, from the start."""
        if self._profile is None:
            return Moving(self._angles[0].tolist(), [0.0] * len(self._angles[0]))
        distance, speed = self._profile.at(time)
        step = self._length / MOTION.nodes
        k = min(int(distance / step), MOTION.nodes - 1)
        s = distance / step - k
        (a, b), (c, d) = self._angles[k : k + 2], self._slopes[k : k + 2]
        rest = b - a - step * c  # cubic through both nodes with their slopes
        bend = step * (d - c)
        position = a + s * (step * c + s * (3.0 * rest - bend + s * (bend - 2.0 * rest)))
        slope = c + s * (2.0 * (3.0 * rest - bend) + 3.0 * s * (bend - 2.0 * rest)) / step
        return Moving(position.tolist(), (speed * slope).tolist())

    def _node(self, body: RigidBody, target: Array) -> Array:
        """Joint angles for a position of the tool, nearest to those of the node before."""
        step = self._length / MOTION.nodes
        q = self._angles[-1] + step * self._slopes[-1]
        for _ in range(10):
            error = target - body.tool_pose(q).position
            if float(np.abs(error).max()) < MOTION.exact:
                break
            q = q + np.linalg.pinv(body.tool_jacobian(q)) @ error
        return q

    def _require_reached(self, body: RigidBody, target: Array, distance: float) -> None:
        """Refuse a line that leaves the positions which the tool can reach."""
        missed = float(np.linalg.norm(target - body.tool_pose(self._angles[-1]).position))
        require(
            missed < MOTION.reached,
            f"the arm cannot follow the line of {self._length:.3g} m beyond {distance:.3g} m, where its tip would be "
            f"{missed:.3g} m off; give another goal, m in the base frame",
        )

    def _slope(self, arm: Arm, body: RigidBody, along: Array, distance: float) -> Array:
        """Joint velocity per speed of the tool (n,), rad/m, at the last node."""
        q = self._angles[-1]
        where = f"at {distance:.3g} m of the line of {self._length:.3g} m"
        beyond = arm.joints.beyond(q.tolist())
        require(not beyond, f"{where} {beyond}: start in another posture, or go another way")
        result: Array = np.linalg.pinv(body.tool_jacobian(q)) @ along
        steepest = float(np.abs(result).max())
        require(
            steepest < MOTION.steepest,
            f"{where} a joint would turn by {steepest:.3g} rad per metre; allowed: less than "
            f"{MOTION.steepest:g} rad/m: the line goes to where the arm is straight or folded, or out of its reach; go "
            "another way",
        )
        return result


class _Straight:
    """Straight from one posture to another, from rest to rest, all joints with the same part of their way."""

    def __init__(self, a: Sequence[float], b: Sequence[float], allowed: Sequence[Sequence[float]]) -> None:
        self._from, self._way = a, [y - x for x, y in zip(a, b, strict=True)]
        ways = [abs(way) for way in self._way]
        self._profile = None
        if max(ways) > MOTION.rounding:
            most = [
                min(m / way for m, way in zip(limit, ways, strict=True) if way > MOTION.rounding) for limit in allowed
            ]
            self._profile = SCurve(1.0, *most)
        self.duration = self._profile.duration if self._profile else 0.0
        self.fastest = [(self._profile.fastest if self._profile else 0.0) * way for way in ways]

    def at(self, time: float) -> Moving:
        part, rate = self._profile.at(time) if self._profile else (1.0, 0.0)
        position = [x + part * way for x, way in zip(self._from, self._way, strict=True)]
        return Moving(position, [rate * way for way in self._way])


class _Polynomials(NamedTuple):
    """One part of a trajectory: polynomials of angle and speed of each joint, coefficients (k, n), the lowest first."""

    orders: list[Array]
    duration: float
    fastest: list[float]

    def at(self, time: float) -> Moving:
        return Moving(*(np.asarray(polyval(time, order)).tolist() for order in self.orders))


_Part = _Straight | _Polynomials


class _Quintics:
    """Polynomials of degree five of p parts, without acceleration at their ends, for n joints: looked at all at once.

    Parameters
    ----------
    postures, rates : at the ends of the parts (p + 1, n), rad and rad/s.
    times : of these ends (p + 1,), s.
    """

    def __init__(
        self, postures: Sequence[Sequence[float]], rates: Sequence[Sequence[float]], times: Sequence[float]
    ) -> None:
        angles, speeds = np.array(postures), np.array(rates)
        self._spans = np.diff(np.array(times))
        t = self._spans[:, np.newaxis]
        a, va, vb, way = angles[:-1], speeds[:-1], speeds[1:], np.diff(angles, axis=0)
        coefficients = [
            a,
            va,
            np.zeros_like(a),
            (10.0 * way - (6.0 * va + 4.0 * vb) * t) / t**3,
            (-15.0 * way + (8.0 * va + 7.0 * vb) * t) / t**4,
            (6.0 * way - 3.0 * (va + vb) * t) / t**5,
        ]
        self._orders = [np.array(coefficients)]
        for _ in UNITS:
            self._orders.append(polyder(self._orders[-1]))
        # the control points of a polynomial bound it between its ends
        self._bounds = np.array(
            [a, a + va * t / 5.0, a + va * t * 0.4, a + way, a + way - vb * t / 5.0, a + way - vb * t * 0.4]
        )

    def parts(self) -> list[_Part]:
        """The parts, one by one."""
        fastest = self.largest(1).tolist()
        return [
            _Polynomials([order[:, i] for order in self._orders[:2]], span, fastest[i])
            for i, span in enumerate(self._spans.tolist())
        ]

    def largest(self, order: int) -> Array:
        """Largest size of a derivative of the order 1 to 3 in each part (p, n)."""
        one = self._orders[order]
        slope = self._orders[order + 1] if order < len(UNITS) else polyder(one)
        # the slope of the speed is 0 at the start of a part, so that a quadratic remains
        turns = _roots(*(slope[1:] if order == 1 else slope))
        spans = self._spans[:, np.newaxis] + np.zeros_like(one[0])
        times = (np.zeros_like(spans), spans, *(np.clip(turn, 0.0, spans) for turn in turns))
        sizes = [np.abs(polyval(time, one, tensor=False)) for time in times]
        largest: Array = np.max(sizes, axis=0)
        return largest

    def may_leave(self, lower: Sequence[float], upper: Sequence[float]) -> NDArray[np.bool_]:
        """Which parts (p,) may leave the limits (n,), rad, between their ends."""
        return np.asarray(((self._bounds < lower) | (self._bounds > upper)).any(axis=(0, 2)))

    def extremes(self, part: int) -> list[list[float]]:
        """The least and the largest angle of each joint in a part, rad."""
        span = float(self._spans[part])
        found = []
        for one in self._orders[0][:, part].T:
            roots: list[complex] = polyroots(polyder(one)).astype(complex).tolist()
            real = [r.real for r in roots if abs(r.imag) < MOTION.rounding * (1.0 + abs(r))]
            found.append([float(polyval(t, one)) for t in (0.0, span, *(r for r in real if 0.0 < r < span))])
        return [[min(values) for values in found], [max(values) for values in found]]


def _roots(c: Array, b: Array, a: Array | float = 0.0) -> tuple[Array, ...]:
    """Real roots of a t^2 + b t + c; 0 in place of one that there is not."""
    with np.errstate(all="ignore"):
        # the form without cancellation, which also has the root where a is 0
        half = -0.5 * (b + np.copysign(np.sqrt(b * b - 4.0 * a * c), b))
        return np.nan_to_num(c / half, nan=0.0, posinf=0.0, neginf=0.0), np.nan_to_num(
            half / a, nan=0.0, posinf=0.0, neginf=0.0
        )
