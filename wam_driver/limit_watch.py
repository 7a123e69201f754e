"""What the driver watches: each quantity, its limit, and the warning near it."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from wam_description.arm import Arm
from wam_description.event import Event, Value, fault
from wam_description.rigid_body import RigidBody
from wam_driver.thresholds import DRIVER


class WatchedLimit(NamedTuple):
    """A quantity near its limit, which is a warning, or above it, which is a fault; `where` is '' or text behind it."""

    quantity: str
    value: float
    limit: float
    unit: str
    where: str = ""

    @property
    def warning(self) -> str:
        """The warning, in words."""
        near = f"near its limit of {self.limit:g} {self.unit}{self.where}"
        return f"{self.quantity} is {self.value:.2f} {self.unit}, {near}"


def excess(watched: Iterable[WatchedLimit], cause: str, **values: Value) -> Event | None:
    """The fault of the first quantity above its limit, or not a number, with further values; None where none is."""
    for one in watched:
        if not one.value <= one.limit:
            return fault(
                cause,
                value=one.value,
                allowed=one.limit,
                quantity=one.quantity,
                unit=one.unit,
                where=one.where,
                **values,
            )
    return None


class LimitWatch:
    """Speeds and travel of the arm from its motors, currents, and tensions of the cables, against their limits.

    Parameters
    ----------
    arm : the arm as it is configured.
    cover_speed_limit, tip_speed_limit : m/s.
    """

    def __init__(self, arm: Arm, cover_speed_limit: float, tip_speed_limit: float) -> None:
        self._arm = arm
        self._map = arm.transmission
        self._body = RigidBody(arm)
        motors, joints = arm.motors, arm.joints
        self._middle = [0.5 * (low + high) for low, high in zip(joints.lower, joints.upper, strict=True)]
        self._half = [0.5 * (high - low) for low, high in zip(joints.lower, joints.upper, strict=True)]
        starts = self._body.moving
        self._speeds = [*[cover_speed_limit] * len(starts), tip_speed_limit, *joints.speed_limit]
        self._strengths = arm.cables.breaking_strength
        self._travels = {f"travel of {name} from the middle of its range": i for i, name in enumerate(joints.names)}
        self._of_cables = [(f"cable tension of {name}", "N") for name in motors.names]
        self._quantities = [
            *((f"speed of {cover} at the end nearer the base", "m/s") for cover in starts),
            ("speed of the tip", "m/s"),
            *((f"speed of {name}", "rad/s") for name in joints.names),
            *((travel, "rad") for travel in self._travels),
            *((f"current of {name}", "A") for name in motors.names),
            *self._of_cables,
        ]
        self._limits = self._with_travel(self._half)
        self._beyond = [0.0] * arm.n  # rad from the middle, up to which each joint may be beyond a stop

    def _with_travel(self, travel: Sequence[float]) -> list[float]:
        """The limits of all quantities, with those of the travel, (n,), rad."""
        return [*self._speeds, *travel, *self._arm.motors.peak_current, *self._strengths]

    def begin(self, theta: Sequence[float]) -> None:
        """The brakes are released at the motor angles theta, (n,), rad: an arm beyond a stop may come back."""
        self._beyond = [
            off + math.copysign(DRIVER.leeway, off) if abs(off) > half else 0.0
            for off, half in zip(self._off(self._map.joint_motion(theta)), self._half, strict=True)
        ]

    def _off(self, q: Sequence[float]) -> list[float]:
        return [angle - middle for angle, middle in zip(q, self._middle, strict=True)]

    def obstacle(self, theta: Sequence[float]) -> str:
        """Why an arm at the motor angles theta, (n,), rad, may not be enabled: no joint is so far beyond a stop."""
        for name, angle, middle, half in zip(
            self._arm.joints.names, self._map.joint_motion(theta), self._middle, self._half, strict=True
        ):
            if not abs(angle - middle) <= 3.0 * half:
                return (
                    f"{name} is at {angle:.4g} rad, further beyond its stops, {middle - half:.4g} and "
                    f"{middle + half:.4g} rad, than they are apart; correct the zero of the arm"
                )
        return ""

    def watched(
        self, theta: Sequence[float], thetad: Sequence[float], currents: Sequence[float], tensions: Sequence[float]
    ) -> list[WatchedLimit]:
        """The quantities that are near their limits or above them.

        Parameters
        ----------
        theta, thetad : angles, rad, and velocities, rad/s, of the motors, (n,).
        currents : of the motors, A, (n,).
        tensions : largest of each cable since the last check, N, (n,).
        """
        q, qd = self._map.joint_motion(theta), self._map.joint_motion(thetad)
        off, limits = self._off(q), self._limits
        if any(self._beyond):  # what was allowed is taken back as the joint returns
            self._beyond = [
                math.copysign(min(abs(most), max(at * math.copysign(1.0, most) + DRIVER.leeway, 0.0)), most)
                for most, at in zip(self._beyond, off, strict=True)
            ]
            each = zip(self._beyond, off, self._half, strict=True)
            limits = self._with_travel([max(half, abs(most)) if most * at > 0.0 else half for most, at, half in each])
        values = [
            *self._body.start_and_tool_speeds(q, qd),
            *map(abs, qd),
            *map(abs, off),
            *map(abs, currents),
            *tensions,
        ]
        return [self._located(near, q) for near in _near(self._quantities, values, limits)]

    def _located(self, near: WatchedLimit, q: Sequence[float]) -> WatchedLimit:
        """A quantity; if it is a travel, with the angle of the joint and of its stop there."""
        if (i := self._travels.get(near.quantity)) is None:
            return near
        joints = self._arm.joints
        stop = joints.lower[i] if q[i] < self._middle[i] else joints.upper[i]
        return near._replace(where=f": {joints.names[i]} is at {q[i]:.4g} rad, its stop at {stop:.4g} rad")

    def tensions(self, tensions: Sequence[float]) -> list[WatchedLimit]:
        """The cables whose tension, (n,), N, is near their breaking strength, also while the brakes stop the arm."""
        return _near(self._of_cables, tensions, self._strengths)


def _near(
    quantities: Sequence[tuple[str, str]], values: Sequence[float], limits: Sequence[float]
) -> list[WatchedLimit]:
    """Of quantities, each with its unit, those that are near their limits."""
    return [
        WatchedLimit(quantity, value, limit, unit)
        for (quantity, unit), value, limit in zip(quantities, values, limits, strict=True)
        if not value <= DRIVER.warning * limit  # what is not a number is above every limit
    ]
