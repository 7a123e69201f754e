"""The hardware driver as a machine: plant, amplifier, safety and watchdog, without ROS and without a clock."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wam_description.arm import Shared
from wam_description.departure import Departure, built
from wam_description.effects import Effects
from wam_description.parameters import lengths, parameter
from wam_description.rigid_body import RigidBody
from wam_description.signals import NO_LOAD, Load, State
from wam_description.transmission_map import TransmissionMap
from wam_description.world import World
from wam_driver.amplifier import Amplifier, AmplifierParameters
from wam_driver.plant import Plant
from wam_driver.safety import Answer, Mode, Safety
from wam_driver.sensors import SensorParameters, Sensors

WARNING = 0.9  # of a limit


@dataclass(frozen=True)
class DriverParameters:
    """The simulated hardware and its limits."""

    world: World
    departure: Departure
    effects: Effects
    amplifier: AmplifierParameters
    sensors: SensorParameters
    seed: int = parameter("of all noise", low=0)
    watchdog: float = parameter("age of the last command at which the driver stops", "s", low=0.002, high=0.05)
    elbow_speed_limit: float = parameter("speed of the last joint's origin that faults the driver", "m/s", low=0.0)
    tip_speed_limit: float = parameter("speed of the tool that faults the driver", "m/s", low=0.0)
    post_mortem_samples: int = parameter("samples kept for the time before a fault", low=1, high=100_000)
    post_mortem_directory: str = parameter("where they are written on a fault, empty for nowhere")


class Sample(NamedTuple):
    """One period of the driver, kept for the post-mortem."""

    stamp: int
    theta: list[float]
    thetad: list[float]
    asked: list[float]
    flowing: list[float]


class Driver:
    """Steps the plant with the last good command, as long as it is safe to do so.

    Time is counted in periods from 1; `stamp` is the time of the present state in nanoseconds.

    Attributes
    ----------
    motor_state : angle, velocity and torque of each motor, as measured.
    joint_sensors : joint-side encoder and strain torque, where they are mounted.
    currents : what flows, A, (n,).
    """

    def __init__(self, shared: Shared, parameters: DriverParameters) -> None:
        arm, timing = shared.arm, shared.timing
        self.safety = Safety()
        random = np.random.Generator(np.random.PCG64(parameters.seed))
        self.plant = Plant(built(arm, parameters.departure), parameters.world, parameters.effects, timing.substep)
        self.amplifier = Amplifier(arm.motors, parameters.amplifier, random)
        self._sensors = Sensors(arm, parameters.sensors, random)
        self.recent: deque[Sample] = deque(maxlen=parameters.post_mortem_samples)
        self.warnings: list[str]
        self._arm, self._timing, self._parameters = arm, timing, parameters
        self._map = TransmissionMap.of(arm)
        self._body = RigidBody(arm)
        self._zero = [0.0] * len(arm.motors.names)
        self._tick = 1
        self._release()
        self._measure()

    def _release(self) -> None:
        """Discard every command; nothing flows until a new one comes."""
        self._command = self._zero
        self._command_tick = self._tick
        self.currents = self._zero
        self._tightest = self._zero  # N, of each cable since the limits were last looked at: a blow is soon over
        self.warnings = []

    @property
    def stamp(self) -> int:
        """Time of the present state, ns, strictly increasing."""
        return self._tick * self._timing.period_ns

    @property
    def is_outer(self) -> bool:
        """True where the joint side works on the present state."""
        return self._timing.is_outer(self.stamp)

    def command(self, stamp: int, currents: list[float]) -> None:
        """Take the currents, A (n,), that answer the state of time `stamp`, ns.

        Ignored unless enabled, and where the state is older than the one last answered or than the
        release of the brakes, or has not been yet.
        """
        tick = stamp // self._timing.period_ns
        if self.safety.mode is Mode.ENABLED and self._command_tick <= tick <= self._tick:
            self._command = list(currents)
            self._command_tick = tick

    def advance(self, arrival_age: float) -> None:
        """Advance by one period.

        Parameters
        ----------
        arrival_age : time since the last command came in, s, on the steady clock; 0 in lockstep.
        """
        enabled = self.safety.mode is Mode.ENABLED
        if enabled:
            age = max((self._tick - self._command_tick) * self._timing.period, arrival_age)
            if age >= self._parameters.watchdog:
                self._trip(
                    f"command stale: {age * 1e3:.0f} ms old, allowed {self._parameters.watchdog * 1e3:.0f} ms; "
                    "check that velocity_loop runs"
                )
                enabled = False
        self.plant.brake(not enabled)
        self.currents = self.amplifier.step(self._command if enabled else self._zero, self._timing.period)
        torque = self.amplifier.torque(self.currents, self.plant.theta)
        for _ in range(self._timing.substeps):
            self.plant.step(torque)
        self._tick += 1
        self._measure()
        if self.safety.mode is not Mode.FAULT:  # what led to a fault is kept until its reset
            self.recent.append(Sample(self.stamp, self.plant.theta, self.plant.thetad, self._command, self.currents))
        if enabled:
            tight = [tension for tension, _ in self.plant.tensions]
            self._tightest = [max(pair) for pair in zip(self._tightest, tight, strict=True)]
            if self.is_outer:
                self._watch_limits()

    def _watch_limits(self) -> None:
        theta, thetad = self.plant.theta, self.plant.thetad
        q, qd = self._map.joint_positions(theta), self._map.joint_velocities(thetad)
        elbow = self._body.point_jacobian(q, self._arm.covers.names[-1], (0.0, 0.0, 0.0)) @ qd
        tip = self._body.tool_jacobian(q) @ qd
        checks = [
            ("speed of the elbow", math.hypot(*elbow), self._parameters.elbow_speed_limit, "m/s"),
            ("speed of the tip", math.hypot(*tip), self._parameters.tip_speed_limit, "m/s"),
        ]
        checks += [
            (f"cable tension of {name}", tight, circuit.breaking_strength, "N")
            for name, tight, circuit in zip(self._arm.motors.names, self._tightest, self._arm.circuits, strict=True)
        ]
        self._tightest = self._zero
        checks += [
            (f"speed of {name}", abs(speed), limit, "rad/s")
            for name, speed, limit in zip(self._arm.joints.names, qd, self._arm.joints.speed_limit, strict=True)
        ]
        self.warnings = [
            f"{what} {value:.2f} {unit} is near its limit {limit:g}"
            for what, value, limit, unit in checks
            if value > WARNING * limit
        ]
        self.warnings += [
            f"{name} is hot: {heat:.0%} of what its winding stands"
            for name, heat in zip(self._arm.motors.names, self.amplifier.heat, strict=True)
            if heat > WARNING
        ]
        for what, value, limit, unit in checks:
            if value > limit:
                self._trip(f"{what} {value:.2f} {unit} is above its limit {limit:g}; command less")
                return

    def _trip(self, reason: str) -> None:
        self.safety.trip(reason)
        self._release()

    def fault(self, reason: str) -> None:
        """Stop for a reason seen outside the machine; brakes on, latched."""
        self._trip(reason)

    def rub(self, friction: Sequence[float]) -> None:
        """Let something rub on the joints, extra dry friction (n,), N m, like the Teflon rod of section 5.6."""
        lengths("effects", self._arm.joints.names, {"rubbing_friction": tuple(friction)})
        self.plant.rub(friction)

    def enable(self, obstacle: str) -> Answer:
        """Release the brakes; every command received before is discarded."""
        answer = self.safety.enable(obstacle)
        if answer.success:
            self._release()
        return answer

    def disable(self) -> Answer:
        """Put on the brakes."""
        self._release()
        return self.safety.disable()

    def estop(self) -> Answer:
        """Stop at once and latch a fault."""
        self._trip("emergency stop")
        return Answer(True, "fault: emergency stop, brakes on; call reset_fault, then enable")

    def reset_fault(self) -> Answer:
        """Clear a latched fault; the arm stays braked."""
        return self.safety.reset_fault()

    def reset(self) -> Answer:
        """Put the simulated arm back to power-up; braked, the time goes on."""
        self.disable()
        self.plant.reset()
        self.amplifier.reset()
        self._sensors.reset()
        return Answer(True, f"{self.safety.mode.value}: arm back at its start pose")

    def _measure(self) -> None:
        plant, period = self.plant, self._timing.period
        torque = self.amplifier.nominal_torque(self.currents)
        self.motor_state = self._sensors.motors(plant.theta, plant.thetad, torque, period)
        if self._arm.joint_sensors:
            self.joint_sensors = self._sensors.joints(plant.q, plant.qd, plant.strain_torque, period)

    @property
    def true_joint_state(self) -> State:
        """The simulator's joint state with the torque that comes through the cables."""
        return State(self.plant.q, self.plant.qd, self.plant.cable_torque)

    @property
    def true_contact(self) -> Load:
        """The simulator's greatest load on a cover."""
        return max(self.plant.loads(), key=lambda load: sum(f * f for f in load.force), default=NO_LOAD)
