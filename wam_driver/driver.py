"""The simulated hardware driver: plant, amplifier, safety and watchdog, without ROS and without a clock."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wam_description.arm import Arm, Shared
from wam_description.effects import Effects
from wam_description.event import Value, fault
from wam_description.mismatch import ModelMismatch, true_arm
from wam_description.parameters import parameter, require, require_fit
from wam_description.signals import BASE, NO_LOAD, ZERO, Answer, Load, Point, State, Table, Wrench
from wam_description.small_matrices import rotation_xyz
from wam_description.world import World
from wam_driver.amplifier import Amplifier
from wam_driver.friction import FrictionParameters
from wam_driver.imperfections import AmplifierParameters, SensorParameters
from wam_driver.limit_watch import LimitWatch, excess
from wam_driver.loads import sprung_cover
from wam_driver.plant import Plant
from wam_driver.safety import Mode, Safety
from wam_driver.sensors import Sensors
from wam_driver.thresholds import DRIVER


@dataclass(frozen=True)
class DriverParameters:
    """The simulated hardware and its limits."""

    world: World
    mismatch: ModelMismatch
    effects: Effects
    friction: FrictionParameters
    amplifier: AmplifierParameters
    sensors: SensorParameters
    seed: int = parameter("seed of the random numbers of all noise", high=2**53)
    watchdog: float = parameter(
        "age of the last command at which the driver stops the arm with a fault", "s", low=0.002, high=0.05
    )
    late_periods: float = parameter(
        "in realtime: fraction of late periods in the newest 2000 above which `enable` is refused",
        high=1.0,
    )
    brake_torque: float = parameter(
        "torque at which the brake of a rotor slips; it prevents that braking breaks a cable",
        "N m",
        low=0.1,
        high=1e3,
    )
    cover_speed_limit: float = parameter(
        "speed of the base-side end of a cover, above which the driver faults",
        "m/s",
        high=100.0,
    )
    tip_speed_limit: float = parameter("speed of the tool above which the driver faults", "m/s", high=100.0)


def _require_springs(arm: Arm, world: World) -> None:
    """Refuse a spring on a link without a cover, or beyond the ends of it: no message could give its force."""
    for spring in world.springs.present:
        cover = sprung_cover(arm, spring.joint)
        covered = ", ".join(joint for joint in arm.joints.names if sprung_cover(arm, joint))
        require(
            cover is not None,
            f"world.springs acts on {spring.joint}, whose link has no cover, so that sim/contact could not contain its "
            f"force; allowed: {covered}, or give the link a cover in arm.covers",
        )
        place = float(rotation_xyz(*cover.rotation)[:, 0] @ (np.array([spring.lever, 0.0, 0.0]) - cover.origin))
        require(
            -DRIVER.rounding <= place <= cover.length + DRIVER.rounding,
            f"world.springs.lever is {spring.lever:g} m for {spring.joint}: the spring would push at {place:.4g} m of "
            f"{cover.name}; allowed: 0 to {cover.length:g} m of it",
        )


class Driver:
    """Steps the plant with the last valid command, as long as it is safe to do so.

    Time is counted in periods from 1.

    Attributes
    ----------
    timing, parameters : of this driver.
    stamp : time of the present state, ns, strictly increasing.
    is_outer : whether the joint side works on the present state.
    motor_state : angle, velocity and torque of each motor, as measured.
    joint_sensors : joint-side encoder and strain torque, if they are mounted.
    currents : actual currents, A, (n,).
    warnings : quantities that are near their limit.
    stale_advice : what to do about a command that is too old; replace it where more is known.
    """

    def __init__(self, shared: Shared, parameters: DriverParameters) -> None:
        arm, timing = shared.arm, shared.timing
        require_fit(parameters, arm)
        self.safety = Safety(self._begin, self._discard)
        random = np.random.Generator(np.random.PCG64(parameters.seed))
        true = true_arm(arm, parameters.mismatch)
        self.plant = Plant(
            true,
            parameters.world,
            parameters.effects,
            timing.substep,
            parameters.friction,
            parameters.brake_torque,
        )
        _require_springs(arm, parameters.world)
        self.amplifier = Amplifier(arm.motors, parameters.amplifier, random, true.motors.torque_constant)
        self._sensors = Sensors(arm, parameters.sensors, random)
        self.warnings: list[str]
        self.stale_advice: Callable[[], str] = lambda: "check that velocity_loop runs"
        self._arm, self.timing, self.parameters, self._push_excess = arm, timing, parameters, shared.push_excess
        self._watch = LimitWatch(arm, parameters.cover_speed_limit, parameters.tip_speed_limit)
        self._zero = [0.0] * arm.n
        self._push_ticks = max(shared.ages.limit_ns("command"), timing.outer_period_ns) // timing.period_ns
        self._disturbed, self._disturbed_until = "", 0  # cover that a message pushes, and the last tick
        self._last_push = "", 0  # the last pushes of an enabled arm, in words, and the tick in which they acted
        self._begin_period(1)
        self._discard()
        self._measure()

    def _begin(self) -> None:
        """Follow commands from now on, none from before."""
        self._discard()
        self._watch.begin(self.plant.theta)

    @property
    def obstacle(self) -> str:
        """Why the arm may not be enabled where it is, '' where it may."""
        return self._watch.obstacle(self.plant.theta)

    def _discard(self) -> None:
        """Discard every command; all currents are zero until a new one arrives."""
        self._command = self._zero
        self._command_tick = self._tick
        self.currents = self._zero
        self.amplifier.cut()
        self._pulls: list[list[float]] = []  # N m, of each cable since the last check, so that no short peak is missed
        self.warnings = []

    def _begin_period(self, tick: int) -> None:
        self._tick = tick
        self.stamp = tick * self.timing.period_ns
        self.is_outer = self.timing.is_outer(self.stamp)

    def command(self, stamp: int, currents: Sequence[float]) -> None:
        """Take the currents, A (n,), that answer the state of time `stamp`, ns.

        The command is ignored unless the driver is enabled.  It is also ignored if its state is older than the
        state that was last answered or than the release of the brakes, or lies in the future.
        """
        tick = stamp // self.timing.period_ns
        if self.safety.mode is Mode.ENABLED and self._command_tick <= tick <= self._tick:
            self._command = list(currents)
            self._command_tick = tick

    def advance(self, arrival_age: float) -> None:
        """Advance by one period.

        Parameters
        ----------
        arrival_age : time since the last command arrived, s, on the steady clock; 0 in lockstep.
        """
        enabled = self.safety.mode is Mode.ENABLED
        if self._disturbed and self._tick > self._disturbed_until:
            self._end_disturbance()
        if enabled:
            age = max((self._tick - self._command_tick) * self.timing.period, arrival_age)
            if age >= self.parameters.watchdog:
                allowed_ms = self.parameters.watchdog * 1e3
                self.safety.trip(
                    fault("command_stale", age_ms=age * 1e3, allowed_ms=allowed_ms, cure=self.stale_advice())
                )
                enabled = False
        self.plant.brake(not enabled)
        self.currents = self.amplifier.step(self._command if enabled else self._zero, self.timing.period)
        torque = self.amplifier.torque(self.currents, self.plant.theta) if enabled else self._zero
        if self.is_outer and self.parameters.friction.warm_drop:
            self.plant.heat(self.amplifier.heat)
        self.plant.step(torque, self.timing.substeps)
        if trouble := self.plant.trouble():
            self.plant.recover()
            self.safety.trip(fault("simulation", trouble=trouble, **self._pushed))
            enabled = False
        self._begin_period(self._tick + 1)
        self._measure()
        self._pulls.append(self.plant.cable_pull)
        if self.is_outer:
            self._watch_limits(enabled)

    def _watch_limits(self, enabled: bool) -> None:
        """Trip on the first quantity above its limit; warn of those near it.  Braked, only the cables can break."""
        tensions = self.plant.tensions(list(map(max, self._zero, *self._pulls)))
        self._pulls.clear()
        if not enabled:
            if broken := excess(self._watch.tensions(tensions), "broken"):
                self.safety.damage(broken)
            return
        if pushed := self.plant.pushes_in_words():
            self._last_push = pushed, self._tick
        watched = self._watch.watched(self.plant.theta, self.plant.thetad, self.currents, tensions)
        self.warnings = [limit.warning for limit in watched]
        self.warnings += [
            f"{name} is hot: {heat:.0%} of its thermal (I2t) limit"
            for name, heat in zip(self._arm.motors.names, self.amplifier.heat, strict=True)
            if heat > DRIVER.warning
        ]
        if watched and (event := excess(watched, "limit", **self._pushed)):
            self.safety.trip(event)
        elif sunk := self.plant.sunk():
            self.safety.trip(fault("sunk", reason=sunk))

    @property
    def _pushed(self) -> dict[str, Value]:
        """The push that acts, or acted a short time before, s; '' for none."""
        pushed, tick = self._last_push
        ago = (self._tick - tick) * self.timing.period
        return {"push": pushed * (ago <= DRIVER.push_memory), "ago": ago}

    def disturb(self, wrench: Wrench) -> None:
        """Take a message of `sim/disturbance`: the one push of messages, in the base frame none; see `Plant.push`.

        It acts until the next message, for `ages.command` of the arm's time at most.

        Raises
        ------
        ValueError
            for a cover that the arm does not have, more than the configured largest force or torque, or a force or
            torque in the base frame.
        """
        cover, *push = wrench
        if cover in ("", BASE):
            if any(map(any, push)):
                raise ValueError(f"frame_id is '{BASE}'; push on one of {', '.join(self._arm.covers.names)}")
            self._end_disturbance()
            return
        if too_much := self._push_excess(*push):
            raise ValueError(f"{too_much}; the last push remains")
        self.plant.push(cover, *push)
        if self._disturbed != cover:
            self._end_disturbance()
        self._disturbed, self._disturbed_until = cover, self._tick + self._push_ticks

    def _end_disturbance(self) -> None:
        if self._disturbed:
            self.plant.push(self._disturbed, ZERO, ZERO)
            self._disturbed = ""

    def tune(self, own: DriverParameters) -> None:
        """Take the effects that can change while the arm runs: added friction, active pretension."""
        effects = own.effects
        effects.require_fit(self._arm)
        self.plant.set_added_friction(effects.added_coulomb_friction)
        self.plant.set_pretension(effects.pretension_share)

    # what a node of a direct run may request by name

    def estop(self) -> Answer:
        """Stop at once and latch a fault."""
        return self.safety.estop()

    def reset_fault(self) -> Answer:
        """Clear a latched fault; the arm stays braked."""
        return self.safety.reset_fault()

    def reset(self) -> Answer:
        """Put the simulated arm back to power-up, braked; time continues."""
        self.safety.disable()
        self.plant.reset()
        self.amplifier.reset()
        self._sensors.reset()
        return Answer(True, f"{self.safety.mode.value}: arm back at its start pose")

    def _measure(self) -> None:
        plant, period = self.plant, self.timing.period
        torque = self.amplifier.nominal_torque(self.currents)
        self.motor_state = self._sensors.motors.read(State(plant.theta, plant.thetad, torque), period)
        if self._arm.joint_sensors:
            self.joint_sensors = self._sensors.joints.read(State(plant.q, plant.qd, plant.strain_torque), period)

    @property
    def true_joint_state(self) -> State:
        """The simulator's joint state, with the torque that the cables transmit."""
        return State(self.plant.q, self.plant.qd, self.plant.cable_torque)

    @property
    def true_contact(self) -> Load:
        """The simulator's largest load on a cover."""
        return max(self.plant.loads(), key=lambda load: sum(f * f for f in load.force), default=NO_LOAD)

    def outer_values(self) -> dict[str, State | Wrench | Point | Table]:
        """What is published in an outer period by topic: the currents, and what only a simulator knows."""
        load, objects = self.true_contact, self.plant.objects()
        frame = load.cover or BASE
        found: dict[str, State | Wrench | Point | Table] = {
            "motor_currents": State([], [], list(self.currents)),
            "sim/joint_states": self.true_joint_state,
            "sim/contact/wrench": Wrench(frame, load.force, load.moment),
            "sim/contact/point": Point(frame, (load.position, 0.0, 0.0)),
        }
        if objects:
            found["sim/objects"] = Table(BASE, tuple(objects))
        return found
