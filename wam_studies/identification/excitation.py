"""A scenario for the identification: from posture to posture, each chosen for what it adds to the known parameters.

Of several random moves the one is taken that reduces the volume of the parameters' covariance most (D-optimal design;
Swevers et al. 1997), within limits of joints and speed, away from obstacles.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any, NamedTuple

import numpy as np

from wam_analysis.identification.motion import MotionSamples
from wam_analysis.identification.regressor import Regressor
from wam_analysis.identification.unknowns import unknowns
from wam_control.task.motion import FASTEST
from wam_control.task.scenario import ScenarioStep
from wam_description.arm import Shared
from wam_description.configuration import Configuration
from wam_description.parameters import ParameterError, build_part, rows
from wam_description.rigid_body import Array, RigidBody
from wam_description.world import Obstacles


@dataclass(frozen=True)
class MoveLimits:
    """How moves are drawn, and what is allowed of them."""

    candidates: int = 6  # random moves of which one is taken
    trials: int = 400  # random postures without an allowed move, after which there is none
    margin: float = 0.2  # rad, from the ends of the joints
    speed: float = 0.8  # of the force loop's joint speed limit, and of the driver's limits of covers' starts and tip
    slowest: float = 0.25  # of that speed
    quickest: float = 0.6  # s of a move
    clearance: float = 0.15  # m, from obstacles
    rate: float = 0.05  # s, between the points of a move that are checked
    torque_sd: float = 0.002  # N m, of a motor: what the parameters are worth


MOVES = MoveLimits()


def scenario(configuration: Configuration, seed: int, seconds: float) -> dict[str, Any]:
    """The scenario as its YAML has it.

    Parameters
    ----------
    configuration : arm, limits, obstacles, present model.
    seed : of the random moves.
    seconds : of motion.

    Raises
    ------
    ParameterError
        if no move is allowed.
    """
    drawn = enumerate(moves(configuration, seed, seconds), 1)
    steps = [
        {"name": f"move {i}", "seconds": round(one.seconds, 2), "posture": [round(angle, 3) for angle in one.posture]}
        for i, one in drawn
    ]
    begin = {"name": "release the brakes", "seconds": 0.5, "request": "enable"}
    return {"steps": [begin, *steps, {"name": "brake", "seconds": 0.5, "request": "disable"}]}


def moves(configuration: Configuration, seed: int, seconds: float) -> Iterator[ScenarioStep]:
    """Moves of a seed, one after the other."""
    shared = configuration.shared
    random = np.random.Generator(np.random.PCG64(seed))
    space = _Space(configuration)
    sought = unknowns(shared)
    information = sought.prior
    posture, spent = np.array(shared.arm.joints.start), 0.0
    while spent < seconds:
        drawn = (space.draw(random, posture) for _ in range(MOVES.trials))
        found = list(islice(filter(None, drawn), MOVES.candidates))
        if not found:
            raise ParameterError(
                f"no move from {posture.round(2).tolist()} rad is allowed by joint limits, speed limits and obstacles"
            )
        gains = [information + _information(shared, path(posture, move)) for move in found]
        known = np.linalg.slogdet(information)[1]
        rates = [(np.linalg.slogdet(g)[1] - known) / move.seconds for g, move in zip(gains, found, strict=True)]
        best = int(np.argmax(rates))
        information, move = gains[best], found[best]
        posture, spent = np.array(move.posture), spent + move.seconds
        yield move


class MovePoints(NamedTuple):
    """Points of a move: (k,) s; (k, n) rad, rad/s, rad/s^2."""

    time: Array
    q: Array
    qd: Array
    qdd: Array


def path(begin: Array, move: ScenarioStep, period: float = MOVES.rate) -> MovePoints:
    """Points, each `period` seconds, of the minimum-jerk path that a scenario plays."""
    time = np.arange(0.5 * period, move.seconds, period)
    s = (time / move.seconds)[:, None]
    way = np.array(move.posture) - begin
    return MovePoints(
        time,
        begin + way * s**3 * (10.0 - 15.0 * s + 6.0 * s**2),
        way * 30.0 * s**2 * (1.0 - s) ** 2 / move.seconds,
        way * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / move.seconds**2,
    )


class _Space:
    """What the arm may do."""

    def __init__(self, configuration: Configuration) -> None:
        arm, driver = configuration.shared.arm, configuration.sections["driver"]
        self._joints, self._covers, self._body = arm.joints, rows(arm.covers), RigidBody(arm)
        self._obstacles = rows(build_part(Obstacles, driver, "world.obstacles."))
        self._speed = MOVES.speed * float(configuration.sections["force_loop"]["joint_speed_limit"])
        self._tip = MOVES.speed * float(driver["tip_speed_limit"])
        self._starts = MOVES.speed * float(driver["cover_speed_limit"])

    def draw(self, random: np.random.Generator, begin: Array) -> ScenarioStep | None:
        """A random move, None if it is not allowed."""
        joints = self._joints
        posture = random.uniform(np.array(joints.lower) + MOVES.margin, np.array(joints.upper) - MOVES.margin)
        speed = self._speed * random.uniform(MOVES.slowest, 1.0)
        seconds = max(MOVES.quickest, FASTEST * float(np.abs(posture - begin).max()) / speed)
        move = ScenarioStep("move", seconds, tuple(posture.tolist()))
        points = path(begin, move)
        allowed = all(self._allows(q, qd) for q, qd in zip(points.q, points.qd, strict=True))
        return move if allowed else None

    def _allows(self, q: Array, qd: Array) -> bool:
        *starts, tip = self._body.start_and_tool_speeds(q, qd)
        if tip > self._tip or any(speed > self._starts for speed in starts):
            return False
        points = (
            (cover, np.add(cover.start, share * np.subtract(cover.end, cover.start)))
            for cover in self._covers
            for share in (0.0, 0.25, 0.5, 0.75, 1.0)
        )
        return all(
            self._distance(self._body.point(q, cover.name, point)) >= MOVES.clearance + cover.radius
            for cover, point in points
        )

    def _distance(self, point: Array) -> float:
        """Distance from the spheres about the obstacles, m; from the plane through the origin of a plane."""
        found = [np.inf]
        for one in self._obstacles:
            apart = np.subtract(point, one.position)
            if one.shape == "plane":
                found.append(apart[2])
            else:
                found.append(float(np.linalg.norm(np.maximum(np.abs(apart) - max(one.size), 0.0))))
        return float(min(found))


def _information(shared: Shared, points: MovePoints) -> Array:
    """Information that a move gives about the parameters."""
    inverse = shared.arm.transmission.motor_from_joint
    theta, thetad, thetadd = (values @ inverse.T for values in points[1:])
    body = RigidBody(shared.arm)
    joints = np.array([body.inverse_dynamics(*each) for each in zip(*points[1:], strict=True)])
    torque = joints @ np.linalg.inv(inverse)
    motion = MotionSamples(points.time, theta, thetad, thetadd, torque, thetad[:, None], torque[:, None], np.ones(1))
    sought = unknowns(shared)
    equations = Regressor(shared, sought, motion).equations(sought.present)
    equations.columns[..., sought.places("motors.stribeck_velocity")] = 0.0  # no move is chosen for it
    rows = equations.columns[equations.is_used]
    return rows.T @ rows / MOVES.torque_sd**2
