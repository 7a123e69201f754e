"""Torques of the world on the joints, from the arm's generalized momentum.

De Luca & Mattone (2005), eq. 14-19; Haddadin, De Luca & Albu-Schaeffer (2017), section III-E.
"""

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


@dataclass(frozen=True)
class ObserverParameters:
    """The nominal model of the observer, which is not the plant, and how far it is trusted."""

    time_constant: float = parameter("time in which the estimate reaches 63 % of a step", "s", low=1e-3, high=1.0)
    mass_scale: tuple[float, ...] = parameter(
        "nominal mass and inertia of each link per configured one", low=0.1, high=10.0
    )
    friction_scale: float = parameter("nominal friction per configured friction", low=0.0, high=10.0)
    mass_uncertainty: float = parameter(
        "sd of the torque that moves and carries the links, per torque", low=0.0, high=1.0
    )
    moving_uncertainty: float = parameter("sd of the friction of what moves, per dynamic friction", low=0.0, high=10.0)
    rest_uncertainty: float = parameter("sd of the friction of what rests, per static friction", low=0.0, high=10.0)
    motor_rest_velocity: float = parameter("motor speed above which Coulomb friction is full", "rad/s", low=1e-6)
    joint_rest_velocity: float = parameter("joint speed above which Coulomb friction is full", "rad/s", low=1e-6)
    motor_torque_sd: float = parameter("sd of the motor torques", "N m", low=1e-6)
    joint_torque_sd: float = parameter("sd of the joints' strain gauges", "N m", low=1e-6)


class MomentumObserver:
    """External joint torques from p = M(q) qd, without accelerations.

    dp/dt = tau + C(q, qd)^T qd - g(q) - friction + tau_ext; the residual r follows tau_ext as
    r' = (tau_ext - r) / T.  Solved exactly over a period in which the torques are constant:
    r_k = a r_(k-1) + (1 - a) ((p_k - p_(k-1)) / dt - known torques), a = exp(-dt / T).

    Motor side: cables taken as rigid, q = M theta (A.5); the momentum has the rotors, reflected
    through (A.5), and the pulleys in it; Coulomb friction has the sign of each motor's velocity,
    that of the joints the sign of the joint's.  Link side (joint sensors): links alone, tau is the
    strain torque behind the friction.  Motor torques are those that acted in the period that ends.

    Friction errs as a bias, not as noise: its standard deviation goes through the same filter.
    """

    def __init__(self, arm: Arm, parameters: ObserverParameters, use_joint_sensors: bool) -> None:
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
        self._gauge_sd = [parameters.joint_torque_sd] * n
        self._zero = [0.0] * n
        self.reset()

    def reset(self) -> None:
        """Forget everything seen."""
        n = self._n
        self.q: list[float] = [0.0] * n
        self.external_torques: list[float] = [0.0] * n
        self._model_torque, self._motor_sd, self._joint_sd = [0.0] * n, [0.0] * n, [0.0] * n
        self._momentum: list[float] | None = None
        self._known: list[float] = [0.0] * n
        self._bias: list[float] = [0.0] * n
        self._gap = 0.0
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
            False where the sample is refused: a wrong length, a value that is not finite, dt <= 0.
            The state stays as it was; the next good sample covers the gap.
        """
        n = self._n
        if not (0.0 < dt < math.inf):
            return False
        position, velocity, effort = state
        if not len(position) == len(velocity) == len(effort) == n or not math.isfinite(
            math.fsum(map(abs, position)) + math.fsum(map(abs, velocity)) + math.fsum(map(abs, effort))
        ):
            self._gap += dt
            return False
        if self._link_side:
            return self._update(_Torques(position, velocity, effort, self._zero, self._zero, self._gauge_sd), dt)
        if not any(effort) and max(map(abs, velocity)) < self._parameters.motor_rest_velocity:
            # at rest without current the brakes or stiction hold: the motors tell nothing
            self.reset()
            return True
        return self._update(self._from_motors(position, velocity, effort), dt)

    def _from_motors(self, theta: list[float], thetad: list[float], tau_motor: list[float]) -> "_Torques":
        q, qd = self._map.joint_positions(theta), self._map.joint_velocities(thetad)
        motor_friction, motor_sd = self._motor_friction.of(thetad)
        joint_friction, joint_sd = self._joint_friction.of(qd)
        through = self._map.joint_torques(motor_friction)
        friction = [through[i] + joint_friction[i] for i in range(self._n)]
        return _Torques(q, qd, self._map.joint_torques(tau_motor), friction, motor_sd, joint_sd)

    def _update(self, now: "_Torques", dt: float) -> bool:
        body, (q, qd, tau, friction, motor_sd, joint_sd) = self._body, now
        momentum = ((body.mass_matrix(q) + self._carried) @ np.array(qd)).tolist()
        bias = (body.coriolis_transpose_times_velocity(q, qd) - body.gravity_torque(q)).tolist()
        known = [bias[i] - friction[i] for i in range(self._n)]
        before, span = self._momentum, dt + self._gap
        keep = math.exp(-span / self._parameters.time_constant)
        residual, model = self.external_torques, self._model_torque
        if before is None:
            model, keep = [-torque for torque in bias], 0.0
        elif span <= self._parameters.time_constant:
            take = 1.0 - keep
            rate = [(momentum[i] - before[i]) / span for i in range(self._n)]
            residual = [
                keep * residual[i] + take * (rate[i] - 0.5 * (known[i] + self._known[i]) - tau[i])
                for i in range(self._n)
            ]
            model = [keep * model[i] + take * (rate[i] - 0.5 * (bias[i] + self._bias[i])) for i in range(self._n)]
        # else a gap too long to say what acted in it: go on from here
        if not math.isfinite(sum(momentum) + sum(known) + sum(residual) + sum(model)):
            self._gap += dt
            return False
        self._motor_sd = [keep * a + (1.0 - keep) * b for a, b in zip(self._motor_sd, motor_sd, strict=True)]
        self._joint_sd = [keep * a + (1.0 - keep) * b for a, b in zip(self._joint_sd, joint_sd, strict=True)]
        self.is_ready = self.is_ready or before is not None
        self.q, self.external_torques, self._model_torque = q, residual, model
        self._momentum, self._known, self._bias, self._gap = momentum, known, bias, 0.0
        return True

    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the external torques, (n, n), N^2 m^2.

        M^-T diag(sd_motor^2) M^-1 + diag(sd_joint^2) + diag((u tau_model)^2): friction at the
        motors mapped as torques are (A.5), friction at the joints or the gauges, and the mass
        uncertainty u of the torque that carries and moves the links.
        """
        uncertainty = self._parameters.mass_uncertainty
        joint = [
            sd * sd + (uncertainty * torque) ** 2 for sd, torque in zip(self._joint_sd, self._model_torque, strict=True)
        ]
        if self._link_side:
            return np.diag(joint)
        weighted = np.array(self._motor_sd)[:, None] * self._motor_from_joint
        result: NDArray[np.float64] = weighted.T @ weighted + np.diag(joint)
        return result


class _Torques(NamedTuple):
    """One sample on the joint side: state, torque, friction, and the sd of friction; each (n,)."""

    q: list[float]
    qd: list[float]
    tau: list[float]
    friction: list[float]
    motor_sd: list[float]
    joint_sd: list[float]


class _Friction:
    """Nominal friction of some shafts and its standard deviation, by their own velocities.

    f = k (F_d s + b v), s = v / v_rest within -1..1; sd^2 = (u_moving k F_d s)^2 +
    (1 - s^2) (u_rest k F_s)^2 + sd_torque^2, k the friction scale.
    """

    def __init__(
        self,
        shafts: Motors | Joints,
        parameters: ObserverParameters,
        rest_velocity: float,
        torque_sd: float,
    ) -> None:
        scale = parameters.friction_scale
        self._shafts = [
            (
                scale * f_dynamic,
                scale * b,
                (parameters.moving_uncertainty * scale * f_dynamic) ** 2,
                (parameters.rest_uncertainty * scale * f_static) ** 2,
            )
            for f_static, f_dynamic, b in zip(
                shafts.static_friction, shafts.dynamic_friction, shafts.viscous_friction, strict=True
            )
        ]
        self._rest_velocity, self._torque_variance = rest_velocity, torque_sd**2

    def of(self, velocity: Sequence[float]) -> tuple[list[float], list[float]]:
        """Friction torques and their sd, each (n,), N m, at velocities (n,), rad/s."""
        friction, sd = [], []
        for (coulomb, viscous, moving, resting), v in zip(self._shafts, velocity, strict=True):
            share = min(1.0, max(-1.0, v / self._rest_velocity))
            square = share * share
            friction.append(coulomb * share + viscous * v)
            sd.append(math.sqrt(square * moving + (1.0 - square) * resting + self._torque_variance))
        return friction, sd
