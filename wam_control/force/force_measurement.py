"""The torques behind the measured force F_c, from the chosen feedback, and what of them counts as zero."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_control.force.belief import WorldTorques
from wam_control.force.force_axis import Angles
from wam_control.force.force_input import ForceInput
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.thresholds import FORCE
from wam_control.thresholds import MOTION
from wam_description.rigid_body import Array, RigidBody
from wam_description.signals import State


class LowPass:
    """First-order low pass of several values, from its first input on if it is given none.

    Attributes
    ----------
    value : filtered values (n,); empty before the first input.
    """

    def __init__(self, value: Sequence[float] = ()) -> None:
        self.value = list(value)

    def step(self, value: Sequence[float], time_constant: float, dt: float) -> list[float]:
        """Filtered values; `time_constant` and `dt` in s."""
        share = dt / (dt + time_constant)
        each = zip(self.value or value, value, strict=True)
        self.value = [before + (now - before) * share for before, now in each]
        return self.value


class Rest:
    """Whether the arm rests: it is slow, and its torques are steady.

    Attributes
    ----------
    time : for which it has, s.
    speed : mean speed of the fastest joint, rad/s; infinite where it is not known yet.
    torques : of the world on the joints (n,), N m, filtered for long.
    """

    def __init__(self) -> None:
        self.time, self.speed, self.torques = 0.0, math.inf, np.zeros(0)
        self._speeds, self._slow, self._slower = LowPass(), LowPass(), LowPass()

    @property
    def is_slow(self) -> bool:
        """Whether no joint moves."""
        return self.speed < MOTION.at_rest

    def step(self, torque: Array, joints: State, torque_sd: Array, dt: float) -> None:
        """Take the torques (n,), N m, of one period, and the standard deviation of each."""
        self.speed = max(map(abs, self._speeds.step(joints.velocity, FORCE.steady_time, dt)))
        self.torques = np.array(self._slow.step(torque.tolist(), FORCE.steady_time, dt))
        lasting = self._slower.step(self._slow.value, FORCE.friction_turn, dt)
        # brakes hold what is not measured
        rests = self.is_slow and any(joints.effort)
        is_steady = rests and bool(np.all(np.abs(self.torques - lasting) < FORCE.certain * torque_sd))
        self.time = self.time + dt if is_steady else 0.0


class Zero(NamedTuple):
    """What counts as zero: the weight of a mass at the tool, kg, which holds in every pose, and torques (n,), N m."""

    mass: float
    torques: Array

    def at(self, body: RigidBody, q: Angles) -> Array:
        """Torques of the world on the joints (n,), N m, in a pose (n,), rad."""
        return self.torques + self.mass * _weight(body, q) if self.mass else self.torques


def _weight(body: RigidBody, q: Angles) -> Array:
    """Torques of the world on the joints (n,), N m, by a mass of 1 kg at the tool."""
    weight: Array = np.array(body.arm.gravity) @ body.tool_jacobian(q)
    return weight


class ForceMeasurement:
    """External torques of the joints, less the tare and the zero of the present command.

    Attributes
    ----------
    torques : of the world on the joints, filtered.
    free : torques of the world on the joints (n,), N m, that counted as those of a free arm when they were taken.
    rest : whether the arm rests.
    """

    def __init__(self, body: RigidBody) -> None:
        self._body = body
        self.free = self._torque_sd = none = self._none
        self._tare = self._zero = Zero(0.0, none)
        self._q: Sequence[float] = ()
        self._velocity = list[float]()
        self.rest, self._acceleration = Rest(), LowPass()
        self.torques = WorldTorques(none, none, None, none)
        self.restart()

    def restart(self, torques: Sequence[float] = ()) -> None:
        """Forget the filtered torques and the load, or go on from other torques (n,), N m."""
        self._filter = LowPass(torques)
        self._before = self._taken(self.rest.torques) if len(torques) else Zero(0.0, self._none)
        self.torques = self.torques._replace(now=self._none, before=self._none, acceleration=None)

    def step(self, own: ForceLoopParameters, given: ForceInput, is_pressing: bool) -> None:
        """Take the signals of one outer period.

        Parameters
        ----------
        own : `feedback` chooses the signal.  joint_sensors: at rest, the torque that carries the links less the strain.
            joint_position: deflection of a known spring, section 5.6.
        given : signals, and the outer period.
        is_pressing : whether the arm presses; without that or another contact, estimated torques count as zero.
        """
        is_touched = is_pressing or bool(given.contact and given.contact.cover)
        dt, torque = given.dt, self._torque(own, given)
        self._q, self._torque_sd = given.joints.position, self._none + own.sensing_fed_back.torque_sd
        self.rest.step(torque, given.joints, self._torque_sd, dt)
        last = self._filter.value
        now = self._filter.step((torque - self._zeros).tolist(), own.force_filter, dt)
        if own.is_estimated and not is_touched:
            now = last = [0.0] * len(now)
        velocity = [0.0] * len(self._none) if given.sensors is None else given.sensors.velocity
        change = [(new - old) / dt for new, old in zip(velocity, self._velocity or velocity, strict=True)]
        filtered = self._acceleration.step(change, own.force_filter, dt)
        self._velocity = velocity
        acceleration = np.array(filtered) if own.feedback == "joint_sensors" else None
        stated = given.external_sd if own.is_estimated else None
        sd = np.maximum(stated, FORCE.least_sd) if stated else self._torque_sd
        self.torques = WorldTorques(np.array(now), np.array(last or now), acceleration, sd)
        if self.rest.time > FORCE.steady_time and not is_pressing:
            seen = self._taken(self.rest.torques)
            self._before = seen if seen.mass or not is_touched else self._before

    @property
    def _none(self) -> Array:
        return np.zeros(self._body.arm.n)

    def _torque(self, own: ForceLoopParameters, given: ForceInput) -> Array:
        sensors = given.sensors
        if own.is_estimated:
            return self._none if given.external is None else np.array(given.external)
        if sensors is None:
            return self._none
        if own.feedback == "joint_position":
            return np.array(own.spring_stiffness) * (np.array(own.spring_rest) - np.array(sensors.position))
        return self._body.gravity_torque(sensors.position) - np.array(sensors.effort)

    @property
    def _zeros(self) -> Array:
        """Tare and zero in the present pose (n,), N m."""
        return self._tare.at(self._body, self._q) + self._zero.at(self._body, self._q)

    def _taken(self, torques: Array) -> Zero:
        """Torques (n,), N m, as zero: of a payload where they are certainly some, and one explains them."""
        mass, scaled = self.payload(torques, float(self._torque_sd.max())), torques / self._torque_sd
        if mass and float(scaled @ scaled) > FORCE.unexplained:
            return Zero(mass, torques - mass * _weight(self._body, self._q))
        return Zero(0.0, torques)

    def tare(self) -> None:
        """Take the steady external torques as zero."""
        self._tare = self._taken(self.rest.torques - self._zero.at(self._body, self._q))
        self.free = self._zeros
        self.restart(self.resting.tolist())

    @property
    def resting(self) -> Array:
        """Steady torques of the world on the joints (n,), N m, less the tare and the zero."""
        return self.rest.torques - self._zeros

    @property
    def before(self) -> Array:
        """Torques of the world on the joints (n,), N m, of the arm at rest before it touched, less tare and zero.

        Without a load they are those of now, if it rests now.
        """
        if self.rest.is_slow and not self._before.mass:
            return self.resting
        return self._before.at(self._body, self._q) - self._zeros

    def zero(self, limit: float) -> None:
        """Take the steady torques of a free arm as zero, unless one of them is above a limit, N m."""
        found = self.rest.torques - self._tare.at(self._body, self._q)
        if float(np.abs(found).max()) <= limit:
            self._zero = self._taken(found)
            self.free = self._zeros
            self.restart(self.resting.tolist())

    def payload(self, torques: Array, torque_sd: float) -> float:
        """Mass at the tool, kg, that explains torques of the world on the joints; 0 where none does.

        Parameters
        ----------
        torques, torque_sd : torques (n,), N m, and the standard deviation of each, N m.
        """
        sd = math.hypot(torque_sd, FORCE.payload_rest * float(np.abs(torques).max()))
        weight, scaled = _weight(self._body, self._q) / sd, torques / sd
        mass = float(weight @ scaled) / max(float(weight @ weight), FORCE.negligible)
        left = scaled - mass * weight
        return mass if mass > 0.0 and float(left @ left) <= FORCE.unexplained else 0.0
