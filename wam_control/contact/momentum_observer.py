"""External joint torques from the arm's generalized momentum, and their covariance.

De Luca & Mattone (2005), eq. 14-19; Haddadin, De Luca & Albu-Schaeffer (2017), section III-E.
"""

import math
from collections.abc import Sequence
from operator import add, sub
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.contact.contact_fusion import Torques
from wam_control.contact.model_errors import ModelErrors, Observation, TrackedError
from wam_control.contact.model_prior import model_prior
from wam_control.contact.observer_parameters import ObserverParameters
from wam_control.contact.shaft_friction import ShaftFriction
from wam_control.contact.thresholds import CONTACT
from wam_control.contact.tool_load import ToolLoad
from wam_control.contact.velocity_fit import VelocityFit
from wam_description.arm import Arm
from wam_description.model import ArmModel
from wam_description.parameters import require
from wam_description.rigid_body import RigidBody
from wam_description.signals import State
from wam_description.transmission_map import TransmissionMap

Array = NDArray[np.float64]


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
    a shaft is at rest, go through the same filter as the torques.  On the motor side these errors, those of
    masses and an unknown payload are tracked (`ModelErrors`).

    A dither of the motor torques (velocity loop) keeps the shafts moving: torques and fractions are
    averaged over the last `dither_cycle` samples, one whole cycle, in which the sign of friction and
    the dither itself cancel.

    Parameters
    ----------
    arm : the arm as configured.
    parameters : the nominal model and its uncertainty.
    use_joint_sensors : whether samples are the joint sensors', else the motors'.
    dither_cycle : samples in a cycle of the dither, 0 where there is none.
    model : the identified model with its covariance, of which `arm` has the means; None for none.

    Attributes
    ----------
    q : (n,), joint angles of the last sample, rad.
    age : s, since the first sample.
    is_ready : whether enough samples came.
    seen : the moment of which torques were last given; from joint sensors the effects are those of one sd.
    """

    def __init__(
        self,
        arm: Arm,
        parameters: ObserverParameters,
        use_joint_sensors: bool,
        dither_cycle: int = 0,
        model: ArmModel | None = None,
    ) -> None:
        n = len(arm.joints.names)
        require(
            len(parameters.mass_scale) == n,
            f"parameter 'observer.mass_scale' has {len(parameters.mass_scale)} values; {n} links need {n}",
        )
        self._n, self._parameters, self._link_side = n, parameters, use_joint_sensors
        self._body = RigidBody(arm, parameters.mass_scale)
        self._map = TransmissionMap.of(arm)
        self._squared = np.square(self._map.joint_from_motor)
        inverse = self._map.motor_from_joint
        self._carried: Array = np.zeros((n, n))
        if not use_joint_sensors:
            self._carried = inverse.T @ np.diag(arm.motors.inertia) @ inverse + np.diag(arm.joints.armature)
        self._motors = ShaftFriction(arm.motors, parameters, parameters.motor_rest_velocity)
        self._joints = ShaftFriction(arm.joints, parameters, parameters.joint_rest_velocity)
        self._velocity = VelocityFit(n, parameters.motor_rest_velocity)
        self._cycle = 0 if use_joint_sensors else dither_cycle
        fast = parameters.detection_time
        self._times = [parameters.time_constant]
        if 0.0 < fast < parameters.time_constant and not use_joint_sensors and not self._cycle:
            self._times.append(fast)
        self._is_payload_declared = parameters.payload[1] > 0.0
        self._load: ToolLoad | None = None
        if self._is_payload_declared or (parameters.payload_uncertainty > 0.0 and not use_joint_sensors):
            self._load = ToolLoad(arm, parameters.payload)
        half_levels = 0.5 * np.array([*self._motors.dynamic, *self._joints.dynamic])
        statics = np.array([*self._motors.static, *self._joints.static])
        self._rest_sd, self._shape_sd = parameters.rest_uncertainty * statics, parameters.shape_uncertainty * statics
        self._through = np.hstack((inverse.T, np.eye(n)))  # joint torques of torques at motors and joints
        # the same of the errors of the model, and their sizes
        self._through_errors = np.hstack((-self._through, self._through, np.eye(n), -self._through, inverse.T))
        self._sizes = np.concatenate((half_levels, half_levels, np.ones(4 * n)))
        self._to_joints = inverse.T
        payload_sd = 0.0
        if self._load is not None:
            payload_sd = self._load.sd if self._is_payload_declared else parameters.payload_uncertainty
        prior = model_prior(arm, parameters, payload_sd, model)
        self._sensors, self._at_rest = np.diag(np.full(n, parameters.joint_torque_sd**2)), np.zeros(n)
        self._sensors_sd = np.sqrt(self._sensors)
        self._independent = np.eye(2 * n + (self._load is not None))  # covariance of effects of one sd
        noise = (parameters.motor_noise * np.array(self._motors.dynamic)) ** 2
        self._errors = ModelErrors(prior, parameters.drift, inverse.T, noise)
        self.reset()

    def reset(self) -> None:
        """Forget all samples."""
        n = self._n
        self.q: list[float] = [0.0] * n
        # of each filter the residual and the torque of the model, (2 n,), N m, the pose, (n,), rad, then the signals of
        # the shafts, (10 n,), and the rate of the motors' torques, (n,), N m/s
        self._filtered = np.zeros((len(self._times), 14 * n))
        # strain gauges lie behind the friction: no signals, and so few numbers that a list takes half the time
        self._of_links = [0.0] * (3 * n)
        self._decay = _Decay.over(math.inf, self._times, 14 * n)
        self._ring = np.zeros((max(1, self._cycle), 13 * n))
        self._filled = 0
        if self._load is not None:
            self._load.reset()
        self._momentum: list[float] | None = None
        self._torque: Sequence[float] = ()
        self._inertia = self._carried
        self._motors.reset()
        self._joints.reset()
        self._velocity.reset()
        self._errors.reset()
        self._known: list[float] = [0.0] * n
        self._bias: list[float] = [0.0] * n
        self._gap = self.age = self._followed = 0.0
        self.seen: Observation | None = None
        self.is_ready = False

    def learn(self, other: "MomentumObserver") -> None:
        """Take over what another one of the same parameters has learned and keeps at a reset."""
        self._errors.learn(other._errors)
        self._velocity.learn(other._velocity)
        if self._load is not None and other._load is not None:
            self._load.mass, self._load.sd = other._load.mass, other._load.sd
        self._motors.learn(other._motors)
        self._joints.learn(other._joints)

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
        finite = math.isfinite(sum(position, 0.0) + sum(velocity, 0.0) + sum(effort, 0.0))
        if not len(position) == len(velocity) == len(effort) == n or not finite:
            self._gap += dt
            return False
        if self._link_side:
            return self._update(position, velocity, effort, [], [], dt)
        if not any(effort) and max(map(abs, velocity)) < self._parameters.motor_rest_velocity:
            # at rest without current, brakes or stiction hold: motor torques carry no information
            self.reset()
            return True
        fitted = self._velocity.take(state, dt + self._gap)
        self._gap = 0.0
        return fitted is None or self._update_from_motors(fitted.state, fitted.dt)

    def _update_from_motors(self, state: State, dt: float) -> bool:
        theta, thetad, tau_motor = state
        q, qd = self._map.joint_positions(theta), self._map.joint_velocities(thetad)
        # with dither a shaft stops at both ends of each swing, held there by the external torque
        keep = 0.0 if self._cycle else math.exp(-dt / self._parameters.friction_memory)
        motor, joint = self._motors.of(thetad, keep, dt), self._joints.of(qd, keep, dt)
        through = self._map.joint_torques(motor.friction)
        friction = [through[i] + joint.friction[i] for i in range(self._n)]
        sliding = motor.sliding + joint.sliding
        tau = self._map.joint_torques(tau_motor)
        transmitted = [each - f for each, f in zip([*tau_motor, *tau], [*motor.friction, *through], strict=True)]
        loaded = [abs(torque) * share for torque, share in zip(transmitted, sliding, strict=True)]
        signals = [
            *sliding,
            *map(abs, sliding),
            *motor.resting,
            *joint.resting,
            *motor.shape,
            *joint.shape,
            *loaded,
            *((torque - before) / dt for torque, before in zip(tau_motor, self._torque or tau_motor, strict=True)),
        ]
        self._torque = tau_motor
        return self._update(q, qd, tau, friction, signals, dt)

    def _update(
        self, q: list[float], qd: list[float], tau: list[float], friction: list[float], signals: list[float], dt: float
    ) -> bool:
        """Take a sample of the joints: state and torque, (n,); friction, (n,), and signals of the shafts, if any."""
        body, at, speed = self._body, np.array(q), np.array(qd)
        inertia = body.mass_matrix(at) if self._link_side else body.mass_matrix(at) + self._carried
        momentum, bias = inertia.dot(speed).tolist(), body.momentum_bias(at, speed).tolist()
        known = [b - f for b, f in zip(bias, friction, strict=True)] if friction else bias
        before, span, n = self._momentum, dt + self._gap, self._n
        if before is None:
            external, model = [0.0] * n, [-torque for torque in bias]
        else:
            # map and a plain zip: strict=True takes as long as the work on four numbers
            rates = [change / span for change in map(sub, momentum, before)]
            left = model = [rate - 0.5 * both for rate, both in zip(rates, map(add, bias, self._bias))]  # noqa: B905
            if friction:
                left = [rate - 0.5 * both for rate, both in zip(rates, map(add, known, self._known))]  # noqa: B905
            external = list(map(sub, left, tau))
        if not math.isfinite(sum(momentum, 0.0) + sum(known, 0.0) + sum(external, 0.0) + sum(model, 0.0)):
            self._gap += dt
            return False
        if span != self._decay.span:
            self._decay = _Decay.over(span, self._times, 14 * n)
        self._filter(external + model + q, signals, before is None)
        if self._load is not None:
            keep = 0.0 if before is None else self._decay.keep
            self._load.observe(q, qd, span, keep)
        self.q, self._inertia = q, inertia
        self._momentum, self._known, self._bias, self._gap = momentum, known, bias, 0.0
        if self._cycle:
            kept = self._ring[self._filled % self._cycle]
            kept[:n], kept[n:] = self._filtered[0, :n], self._filtered[0, 2 * n :]
            self._filled += 1
        # releasing the brakes gives a jolt that a model with rigid cables does not predict;
        # half a cycle of a dither would look like a push
        self.age += span
        settled = self.age > CONTACT.settled * self._parameters.time_constant and self._filled >= 2 * self._cycle
        self.is_ready = self.is_ready or (before is not None and settled)
        return True

    def _filter(self, torques: list[float], signals: list[float], is_first: bool) -> None:
        """Take torques and pose, (3 n,), and signals of the shafts into the filters."""
        (span, keep, keeps, takes), filtered, n = self._decay, self._filtered, self._n
        is_gap = span > self._parameters.time_constant and not is_first  # torques in so long a gap are unknown
        if self._link_side:
            if is_first:
                self._of_links = torques
            elif not is_gap:
                take = 1.0 - keep
                self._of_links = [keep * old + take * new for old, new in zip(self._of_links, torques)]  # noqa: B905
            return
        present = np.array(torques + signals)
        if is_first:
            filtered[:] = present
            return
        before_gap = filtered[:, : 3 * n].copy() if is_gap else None
        filtered *= keeps
        filtered += takes * present
        if before_gap is not None:  # continue from here
            filtered[:, : 3 * n] = before_gap

    def torques(self) -> tuple[list[float], Array]:
        """External torques, (n,), N m, and their covariance, (n, n), N^2 m^2.

        With joint sensors S = diag(sd^2) + diag((u tau_model)^2) + (u_load tau_load)(...)^T: strain gauges, the mass
        uncertainty u of the model torque, the payload.  From the motors see `ModelErrors`.
        """
        if not self._link_side:
            self._expect()
            self.seen = self._observation()
            torques, covariance = self._errors.corrected(self.seen)
            return torques.tolist(), self._errors.size * covariance
        uncertainty, load = self._parameters.mass_uncertainty, self._load
        filtered = self._of_links
        residual, sizes = filtered[: self._n], [uncertainty * torque for torque in filtered[self._n : 2 * self._n]]
        covariance, effects = np.zeros((self._n, self._n)), np.zeros((self._n, self._n))
        diagonal = slice(None, None, self._n + 1)
        covariance.ravel()[diagonal] = [self._parameters.joint_torque_sd**2 + size**2 for size in sizes]
        effects.ravel()[diagonal] = sizes
        if load is not None:
            residual = [torque - load.mass * unit for torque, unit in zip(residual, load.torque, strict=True)]
            sized = (np.array(load.torque) * load.sd)[:, None]
            covariance = covariance + sized * sized.T
            effects = np.concatenate((effects, sized), axis=1)
        self.seen = Observation(
            np.array(residual),
            effects,
            self._sensors,
            self._at_rest,
            np.array(filtered[2 * self._n :]),
            self._sensors_sd,
        )
        return residual, covariance

    def moment(self) -> Torques:
        """The external torques last given, with what is known of their errors."""
        seen = self.seen
        if seen is None:
            raise RuntimeError("nothing has been observed")
        if not self._link_side:
            return Torques(self.age, self.corrected(seen), *self._errors.parts(seen), seen.pose)
        effects = np.concatenate((seen.effects, seen.lasting), axis=1)
        return Torques(self.age, seen.residual, effects, self._independent, seen.rest, seen.pose)

    def change(self, then: Observation) -> tuple[Array, Array]:
        """Change of the external torques, (n,), N m, since a mean of what was `seen`, and its covariance, (n, n)."""
        if self.seen is None:
            raise RuntimeError("nothing has been observed")
        if not self._link_side:
            torques, covariance = self._errors.change(self.seen, then)
            return torques, self._errors.size * covariance
        effects = self.seen.effects - then.effects
        return self.seen.residual - then.residual, effects.dot(effects.T) + CONTACT.alike * (self.seen.rest + then.rest)

    def corrected(self, then: Observation) -> Array:
        """External torques, (n,), N m, of a mean of what was `seen`, with the present errors of the model."""
        return then.residual if self._link_side else then.residual - then.effects.dot(self._errors.errors)

    def fast_torques(self) -> tuple[list[float], Array] | None:
        """The same with `detection_time`, for a faster detection; None where there is none."""
        if len(self._times) == 1:
            return None
        torques, covariance = self._errors.corrected(self._observation(1))
        return torques.tolist(), self._errors.size * covariance

    def follow(self, statistic: float, in_contact: bool) -> None:
        """Track the errors of the model by the torques last given; `statistic` is theirs, for the detection."""
        if self.seen is not None and self.is_ready and not self._link_side:
            self._errors.follow(self.seen, statistic, in_contact, self.age - self._followed)
            self._followed = self.age

    @property
    def pose(self) -> list[float]:
        """Joint angles, (n,), rad, as late as the torques last given: through their filter."""
        return self.q if self.seen is None else self.seen.pose.tolist()

    @property
    def load_torques(self) -> Array | None:
        """External torques of a mass of 1 kg at the tool, (n,), N m, through the filter; None where not followed."""
        return None if self._load is None else np.array(self._load.torque)

    @property
    def model_errors(self) -> dict[str, TrackedError]:
        """The errors of the model that are tracked, by name: per torque of the model, the payload in kg."""
        return {} if self._link_side else self._errors.by_name

    @property
    def warning(self) -> str:
        """Which part of the model is off, '' for none."""
        beyond = [] if self._link_side else self._errors.beyond
        return f"the model is off: {beyond[0]}; see /diagnostics, run 'wam identify'" if beyond else ""

    def _expect(self) -> None:
        """Let the friction know how certain the velocities are."""
        sd = self._velocity.sd
        self._motors.expect(sd)
        self._joints.expect(np.sqrt(self._squared.dot(np.square(sd))).tolist())

    def _observation(self, which: int = 0) -> Observation:
        """The present residual, the effects of the errors of the model on it, and the covariance of the rest."""
        n, given, filtered = self._n, self._parameters, self._filtered[which].copy()
        residual, model = filtered[:n], filtered[n : 2 * n].tolist()
        pose, signals = filtered[2 * n : 3 * n], filtered[3 * n :]
        if self._cycle and self._filled:
            mean = self._ring[: self._filled].mean(axis=0)
            residual, pose, signals = mean[:n], mean[n : 2 * n], mean[2 * n :]
        sliding, moving, resting, shape = signals[: 8 * n].reshape(4, 2 * n)
        if self._cycle:
            # a shaft that slips in both directions within a cycle stops at both limits of its stiction
            resting, shape = resting * resting, np.minimum(shape, np.abs(sliding))
        load = self._load
        effects = np.zeros((n, 8 * n + 2))
        modelled = self._map.motor_torques(model)
        pairs = zip(modelled, self._map.motor_torques(residual.tolist()), strict=True)
        driving = [torque - external for torque, external in pairs]
        sizes = self._sizes * np.concatenate(
            (moving + sliding, moving - sliding, model, signals[8 * n : 10 * n], driving)
        )
        np.multiply(self._through_errors, sizes, out=effects[:, :-2])
        effects[:, -2] = self._to_joints.dot(signals[10 * n :])
        if load is not None:
            effects[:, -1] = load.torque
            residual -= load.mass * effects[:, -1]
        variance = np.square(self._rest_sd * resting) + np.square(self._shape_sd * shape)
        lasting = self._through * np.sqrt(variance)
        # a faster filter averages less of what is noise
        less, least = self._times[0] / self._times[which], given.motor_torque_sd**2
        sds = [given.motor_torque_fraction * torque for torque in modelled]
        variance[:n] += [less * (least + sd * sd) for sd in sds]
        rest = (self._through * variance).dot(self._through.T)
        speed = self._map.joint_from_motor * (np.array(self._velocity.sd) / self._times[which])
        momentum = self._inertia.dot(speed)
        return Observation(residual, effects, rest + momentum.dot(momentum.T), less * moving[:n], pose, lasting)

    def identify_payload(self) -> str:
        """Identify the payload from the torques of joint sensors; '' or why that is not possible."""
        if self._load is None or (self._link_side and not self._is_payload_declared):
            return "no payload is declared; set observer.payload to the smallest and the largest mass"
        if not self._link_side:
            mass, sd = self._load.mass + self._errors.errors[-1], math.sqrt(self._errors.covariance[-1, -1])
            return f"from the motors the payload is tracked while the arm moves: {mass:.2f} +- {sd:.2f} kg now"
        if not self.is_ready:
            return "too few samples yet"
        torques, covariance = self.torques()
        return self._load.identify_payload(torques, covariance)


class _Decay(NamedTuple):
    """What the filters keep and take of a sample over a period of `span` seconds; what the first one keeps.

    There is one for each number: numpy multiplies by a single one two to three times as slowly.
    """

    span: float
    keep: float
    keeps: Array
    takes: Array

    @classmethod
    def over(cls, span: float, times: Sequence[float], size: int) -> "_Decay":
        """The decay of filters of `size` numbers with these time constants, s."""
        keep = [math.exp(-span / time) for time in times]
        keeps = np.repeat(np.array(keep)[:, None], size, axis=1)
        return cls(span, keep[0], keeps, 1.0 - keeps)
