"""External joint torques from the arm's generalized momentum, and their covariance.

De Luca & Mattone (2005), eq. 14-19; Haddadin, De Luca & Albu-Schaeffer (2017), section III-E.
"""

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_description.arm import Arm, Joints, Motors
from wam_description.parameters import parameter, require
from wam_description.rigid_body import RigidBody
from wam_description.signals import State
from wam_description.transmission_map import TransmissionMap

SETTLED = 2.0  # time constants from the first sample until the estimate is ready
LOAD_DIVISOR = 4  # samples per update of the payload's torque, which changes slowly
NO_MASS = 1e-6  # kg, the smallest mass that a link may have


@dataclass(frozen=True)
class ObserverParameters:
    """The observer's nominal model, which differs from the plant, and its uncertainty."""

    time_constant: float = parameter("time in which the estimate reaches 63 % of a step", "s", low=1e-3, high=1.0)
    mass_scale: tuple[float, ...] = parameter(
        "nominal mass and inertia of each link per configured one", low=0.1, high=10.0
    )
    friction_scale: float = parameter("nominal friction per configured friction", low=0.0, high=10.0)
    mass_uncertainty: float = parameter("sd of the model torque of inertia and gravity, per torque", low=0.0, high=1.0)
    moving_uncertainty: float = parameter(
        "sd of the friction of a moving shaft, per dynamic friction", low=0.0, high=10.0
    )
    rest_uncertainty: float = parameter(
        "sd of the friction of a shaft at rest, per static friction", low=0.0, high=10.0
    )
    motor_rest_velocity: float = parameter(
        "motor speed above which Coulomb friction is full", "rad/s", low=1e-6, high=100.0
    )
    joint_rest_velocity: float = parameter(
        "joint speed above which Coulomb friction is full", "rad/s", low=1e-6, high=100.0
    )
    friction_memory: float = parameter(
        "time constant with which the friction of a shaft that came to rest becomes unknown", "s", low=1e-4, high=1.0
    )
    motor_torque_sd: float = parameter("sd of the motor torques", "N m", low=1e-6, high=100.0)
    joint_torque_sd: float = parameter("sd of the joints' strain gauges", "N m", low=1e-6, high=100.0)
    payload: tuple[float, ...] = parameter(
        "smallest and largest mass that the tool may carry", "kg", low=0.0, high=50.0
    )

    def __post_init__(self) -> None:
        low, high = self.payload if len(self.payload) == 2 else (1.0, 0.0)
        require(
            low <= high,
            f"parameter 'observer.payload' is {list(self.payload)}; it needs the smallest and the largest mass",
        )


class MomentumObserver:
    """External joint torques from p = M(q) qd, without accelerations.

    dp/dt = tau + C(q, qd)^T qd - g(q) - friction + tau_ext; the residual r follows tau_ext as
    r' = (tau_ext - r) / T.  Solved exactly over a period in which the torques are constant:
    r_k = a r_(k-1) + (1 - a) ((p_k - p_(k-1)) / dt - known torques), a = exp(-dt / T).

    Motor side: cables assumed rigid, q = M theta (A.5); the momentum includes rotors, reflected
    through (A.5), and pulleys; Coulomb friction has the sign of each motor's velocity, that of the
    joints the sign of the joint's.  Link side (joint sensors): links alone, tau is the strain torque,
    measured after the friction.  Motor torques are those that acted in the period that ends.

    The error of friction is a bias, not noise: a wrong level stays wrong in every sample, with the
    sign of the motion.  So the signed fraction of Coulomb friction, and the fraction of the time that
    a shaft is at rest, go through the same filter as the torques.

    A dither of the motor torques (velocity loop) keeps the shafts moving: torques and fractions are
    averaged over the last `dither_cycle` samples, one whole cycle, in which the sign of friction and
    the dither itself cancel.

    Parameters
    ----------
    arm : the arm as configured.
    parameters : the nominal model and its uncertainty.
    use_joint_sensors : whether samples are the joint sensors', else the motors'.
    dither_cycle : samples in a cycle of the dither, 0 where there is none.
    """

    def __init__(
        self, arm: Arm, parameters: ObserverParameters, use_joint_sensors: bool, dither_cycle: int = 0
    ) -> None:
        n = len(arm.joints.names)
        require(
            len(parameters.mass_scale) == n,
            f"parameter 'observer.mass_scale' has {len(parameters.mass_scale)} values; {n} links need {n}",
        )
        self._n, self._parameters, self._link_side = n, parameters, use_joint_sensors
        self._body = RigidBody(arm, parameters.mass_scale)
        self._map = TransmissionMap.of(arm)
        inverse = self._map.motor_from_joint
        self._motor_from_joint = inverse
        self._carried: NDArray[np.float64] = np.zeros((n, n))
        if not use_joint_sensors:
            self._carried = inverse.T @ np.diag(arm.motors.inertia) @ inverse + np.diag(arm.joints.armature)
        rest, rest_joint = parameters.motor_rest_velocity, parameters.joint_rest_velocity
        self._motor_friction = _Friction(arm.motors, parameters, rest, parameters.motor_torque_sd)
        self._joint_friction = _Friction(arm.joints, parameters, rest_joint, 0.0)
        self._zero = [0.0] * n
        self._unknown: tuple[list[float], list[float]] = ([0.0] * (2 * n), [0.0] * (2 * n))
        self._cycle = 0 if use_joint_sensors else dither_cycle
        self._load: _Load | None = None
        if parameters.payload[1] > 0.0:
            self._load = _Load(arm, parameters.payload)
        self.reset()

    def reset(self) -> None:
        """Forget all samples."""
        n = self._n
        self.q: list[float] = [0.0] * n
        self._residual: list[float] = [0.0] * n
        self._model_torque: list[float] = [0.0] * n
        self._sliding, self._resting = self._unknown  # of motors, then of joints
        self._ring = np.zeros((max(1, self._cycle), 5 * n))
        self._filled = 0
        if self._load is not None:
            self._load.reset()
        self._momentum: list[float] | None = None
        self._motor_friction.reset()
        self._joint_friction.reset()
        self._known: list[float] = [0.0] * n
        self._bias: list[float] = [0.0] * n
        self._gap = self._age = 0.0
        self.is_ready = False

    def observe(self, state: State, dt: float) -> bool:
        """Take one sample.

        Parameters
        ----------
        state : motors' angle, rad, velocity, rad/s, torque, N m; or joints' angle, velocity and
            strain torque with joint sensors; each (n,).
        dt : time since the sample before, s.

        Returns
        -------
        bool
            False if the sample is refused: a wrong length, a value that is not finite, dt <= 0.
            The observer stays as it was; the next good sample covers the gap.
        """
        n = self._n
        if not (0.0 < dt < math.inf):
            return False
        position, velocity, effort = state
        finite = math.isfinite(sum(position) + sum(velocity) + sum(effort))
        if not len(position) == len(velocity) == len(effort) == n or not finite:
            self._gap += dt
            return False
        if self._link_side:
            return self._update(_Torques(position, velocity, effort, self._zero, *self._unknown), dt)
        if not any(effort) and max(map(abs, velocity)) < self._parameters.motor_rest_velocity:
            # at rest without current, brakes or stiction hold: motor torques carry no information
            self.reset()
            return True
        return self._update(self._from_motors(position, velocity, effort, dt), dt)

    def _from_motors(self, theta: list[float], thetad: list[float], tau_motor: list[float], dt: float) -> "_Torques":
        q, qd = self._map.joint_positions(theta), self._map.joint_velocities(thetad)
        # with dither a shaft stops at both ends of each swing, held there by the external torque
        keep = 0.0 if self._cycle else math.exp(-dt / self._parameters.friction_memory)
        motor_friction, motor_sliding, motor_resting = self._motor_friction.of(thetad, keep)
        joint_friction, joint_sliding, joint_resting = self._joint_friction.of(qd, keep)
        through = self._map.joint_torques(motor_friction)
        friction = [through[i] + joint_friction[i] for i in range(self._n)]
        torques = self._map.joint_torques(tau_motor)
        return _Torques(q, qd, torques, friction, motor_sliding + joint_sliding, motor_resting + joint_resting)

    def _update(self, sample: "_Torques", dt: float) -> bool:
        body, (q, qd, tau, friction, sliding, resting) = self._body, sample
        at, speed = np.array(q), np.array(qd)
        momentum = (body.mass_matrix(at) + self._carried).dot(speed).tolist()
        bias = (body.coriolis_transpose_times_velocity(at, speed) - body.gravity_torque(at)).tolist()
        known = [b - f for b, f in zip(bias, friction, strict=True)]
        before, span = self._momentum, dt + self._gap
        keep = math.exp(-span / self._parameters.time_constant)
        residual, model = self._residual, self._model_torque
        if before is None:
            model, keep = [-torque for torque in bias], 0.0
        elif span <= self._parameters.time_constant:
            take = 1.0 - keep
            rate = [(now - then) / span for now, then in zip(momentum, before, strict=True)]
            residual = [
                keep * r + take * (p - 0.5 * (new + old) - torque)
                for r, p, new, old, torque in zip(residual, rate, known, self._known, tau, strict=True)
            ]
            model = [
                keep * m + take * (p - 0.5 * (new + old))
                for m, p, new, old in zip(model, rate, bias, self._bias, strict=True)
            ]
        # else the torques in so long a gap are unknown: continue from here
        if not math.isfinite(sum(momentum) + sum(known) + sum(residual) + sum(model)):
            self._gap += dt
            return False
        if not self._link_side:  # strain gauges lie behind the friction
            take = 1.0 - keep
            self._sliding = [keep * a + take * b for a, b in zip(self._sliding, sliding, strict=True)]
            self._resting = [keep * a + take * b for a, b in zip(self._resting, resting, strict=True)]
        if self._load is not None:
            self._load.observe(q, qd, span, keep)
        self.q, self._residual, self._model_torque = q, residual, model
        self._momentum, self._known, self._bias, self._gap = momentum, known, bias, 0.0
        if self._cycle:
            self._ring[self._filled % self._cycle] = residual + self._sliding + self._resting
            self._filled += 1
        # releasing the brakes gives a jolt that a model with rigid cables does not predict;
        # half a cycle of a dither would look like a push
        self._age += span
        settled = self._age > SETTLED * self._parameters.time_constant and self._filled >= 2 * self._cycle
        self.is_ready = self.is_ready or (before is not None and settled)
        return True

    def torques(self) -> tuple[list[float], NDArray[np.float64]]:
        """External torques, (n,), N m, and their covariance, (n, n), N^2 m^2.

        S = M^-T diag(sd_motor^2) M^-1 + diag(sd_joint^2) + diag((u tau_model)^2) + (u_load tau_load)(...)^T:
        friction at the motors, mapped like torques (A.5); friction at the joints, or strain gauges; the
        mass uncertainty u of the model torque; the payload.
        """
        n, residual, sliding, resting = self._n, self._residual, self._sliding, self._resting
        if self._cycle and self._filled:
            mean = self._ring[: self._filled].mean(axis=0).tolist()
            residual, sliding, resting = mean[:n], mean[n : 3 * n], mean[3 * n :]
            # a shaft that slips in both directions within a cycle stops at both limits of its stiction
            resting = [share * share for share in resting]
        uncertainty = self._parameters.mass_uncertainty
        if self._link_side:
            joint = [self._parameters.joint_torque_sd**2] * n
        else:
            joint = self._joint_friction.variance(sliding[n:], resting[n:])
        total = [
            variance + (uncertainty * torque) ** 2 for variance, torque in zip(joint, self._model_torque, strict=True)
        ]
        covariance: NDArray[np.float64] = np.diag(total)
        if not self._link_side:
            motor = self._motor_friction.variance(sliding[:n], resting[:n])
            covariance += (self._motor_from_joint.T * motor) @ self._motor_from_joint
        load = self._load
        if load is None:
            return list(residual), covariance
        residual = [torque - load.mass * unit for torque, unit in zip(residual, load.torque, strict=True)]
        sized = np.array(load.torque) * load.sd
        return residual, covariance + np.outer(sized, sized)

    def identify_payload(self) -> str:
        """Identify the payload from the present external torques; '' or why that is not possible."""
        if self._load is None:
            return "no payload is declared; set observer.payload to the smallest and the largest mass"
        if not self.is_ready:
            return "too few samples yet"
        torques, covariance = self.torques()
        return self._load.identify_payload(torques, covariance)


class _Torques(NamedTuple):
    """One sample on the joint side: state, torque, friction; each (n,).

    `sliding` is the signed fraction of Coulomb friction that acts, `resting` how far each shaft is at rest, 0..1;
    motors, then joints, (2 n,).
    """

    q: list[float]
    qd: list[float]
    tau: list[float]
    friction: list[float]
    sliding: list[float]
    resting: list[float]


class _Friction:
    """Nominal friction of shafts as a function of their velocities, and its variance.

    f = k (F_d (s + (1 - |s|) h) + b v), s = v / v_rest within -1..1, h the sign of the last full motion, which decays:
    the friction on a shaft that has just stopped still acts as it did, that on a shaft long at rest is unknown.
    Variance (u_moving k F_d s)^2 + (u_rest k F_s d)^2 + sd_torque^2, d = 1 - s^2 the fraction at rest, k the
    friction scale.
    """

    def __init__(
        self,
        shafts: Motors | Joints,
        parameters: ObserverParameters,
        rest_velocity: float,
        torque_sd: float,
    ) -> None:
        scale = parameters.friction_scale
        levels = zip(shafts.static_friction, shafts.dynamic_friction, shafts.viscous_friction, strict=True)
        self._levels = [(scale * f_dynamic, scale * b) for _, f_dynamic, b in levels]
        self._moving = [(parameters.moving_uncertainty * scale * f) ** 2 for f in shafts.dynamic_friction]
        self._rest = [(parameters.rest_uncertainty * scale * f) ** 2 for f in shafts.static_friction]
        self._rest_velocity, self._torque_variance = rest_velocity, torque_sd**2
        self.reset()

    def reset(self) -> None:
        """Forget the motion."""
        self._held = [0.0] * len(self._levels)

    def of(self, velocity: Sequence[float], keep: float) -> tuple[list[float], list[float], list[float]]:
        """Friction torques, N m, signed fraction of Coulomb friction and fraction at rest, each (n,).

        `velocity` (n,), rad/s; `keep` is the decay of the memory in one period.
        """
        friction, sliding, resting, held = [], [], [], self._held
        for i, ((coulomb, viscous), v) in enumerate(zip(self._levels, velocity, strict=True)):
            share = min(1.0, max(-1.0, v / self._rest_velocity))
            held[i] = share if share * share == 1.0 else keep * held[i]
            friction.append(coulomb * (share + (1.0 - abs(share)) * held[i]) + viscous * v)
            sliding.append(share)
            resting.append(1.0 - share * share)
        return friction, sliding, resting

    def variance(self, sliding: Sequence[float], resting: Sequence[float]) -> list[float]:
        """Variance, (n,), N^2 m^2, of friction at these mean fractions."""
        return [
            moving * share * share + rest * stuck * stuck + self._torque_variance
            for moving, rest, share, stuck in zip(self._moving, self._rest, sliding, resting, strict=True)
        ]


class _Load:
    """Joint torques per kilogram at the tool, through the filter of the observer; and the mass estimated there."""

    def __init__(self, arm: Arm, payload: tuple[float, ...]) -> None:
        n = len(arm.links.names)
        centre = (*arm.links.centre[:-3], *arm.tool)
        masses, none = (NO_MASS,) * (n - 1) + (1.0,), (0.0,) * (3 * n)
        links = dataclasses.replace(arm.links, mass=masses, centre=centre, inertia=none, product=none)
        self._body = RigidBody(dataclasses.replace(arm, links=links, payload=0.0))
        low, high = payload
        # the arm without payload is the rule; sd of a uniform distribution, about the smallest mass
        self.mass, self.sd = low, (high - low) / math.sqrt(3.0)
        self._payload = payload
        self.torque: list[float] = [0.0] * n
        self.reset()

    def reset(self) -> None:
        """Forget the motion, not the mass."""
        self._before: list[float] | None = None
        self._bias: list[float] = []
        self._span, self._keep, self._count = 0.0, 1.0, 0
        self.torque = [0.0] * len(self.torque)

    def observe(self, q: list[float], qd: list[float], span: float, keep: float) -> None:
        """Follow one sample of the joints, (n,) rad and rad/s."""
        self._span, self._keep, self._count = self._span + span, self._keep * keep, self._count + 1
        if self._before is not None and self._count < LOAD_DIVISOR:
            return
        span, keep, body = self._span, self._keep, self._body
        self._span, self._keep, self._count = 0.0, 1.0, 0
        momentum = (body.mass_matrix(q) @ np.array(qd)).tolist()
        bias = (body.coriolis_transpose_times_velocity(q, qd) - body.gravity_torque(q)).tolist()
        if self._before is None:
            self._bias, keep = bias, 0.0
        # as an external torque: that of the motors on the load, with the opposite sign
        terms = zip(self.torque, momentum, self._before or momentum, bias, self._bias, strict=True)
        self.torque = [keep * t + (1.0 - keep) * (0.5 * (b + a) - (p - o) / span) for t, p, o, b, a in terms]
        self._before, self._bias = momentum, bias

    def identify_payload(self, torques: list[float], covariance: NDArray[np.float64]) -> str:
        """Correct the mass to explain torques, (n,), N m, with covariance (n, n); '' or why that is not possible."""
        unit = np.array(self.torque)
        # the covariance includes the prior, one sd of the declared range
        gain = self.sd**2 * np.linalg.solve(covariance, unit)
        mass = self.mass + float(gain @ np.array(torques))
        low, high = self._payload
        margin = 0.1 * (high - low)
        if not low - margin <= mass <= high + margin:
            return f"the external torques mean a payload of {mass:.3g} kg; declared: {low:g} to {high:g} kg"
        self.mass = min(max(mass, low), high)
        self.sd *= math.sqrt(max(0.0, 1.0 - float(gain @ unit)))
        return ""
