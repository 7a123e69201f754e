"""A simulator of the bus: motor controllers, safety module with pendant, and a person, in bus time.

Bus time passes with the bits of each frame, with waiting, and to the next period with `let_pass`.
"""

import math
from collections import Counter, deque
from collections.abc import Callable

from wam_description.arm import Shared
from wam_description.rigid_body import RigidBody
from wam_driver.bus import frames, properties
from wam_driver.bus.frames import SAFETY, BusGroup, Frame
from wam_driver.bus.safety_module import SafetyMode, faults, pendant_of
from wam_driver.driver import DriverParameters
from wam_driver.plant import Plant
from wam_driver.thresholds import BUS

WHILE_ASLEEP = ("VERS", "ROLE", "SN", "ID", "ERROR", "STAT", "ADDR")


class SimulatedController:
    """A motor controller or the safety module.

    Parameters
    ----------
    node : on the bus.
    version : of the firmware.
    plant : that has its motor.

    Attributes
    ----------
    values : of the properties by name, to be changed by tests; counts of torque under "T", at the angle zero under "P".
    deaf_until : bus time at which it is awake, s.
    """

    def __init__(self, node: int, version: int, plant: Plant | None = None) -> None:
        self.node, self._plant = node, plant
        self.values = {"VERS": version, **properties.ARM[node]}
        self.deaf_until = 0.0
        self._names = properties.names(version, node == SAFETY)

    def _count(self) -> int:
        """Of its motor, from the angle zero."""
        return math.floor(self._plant.theta[self.node - 1] / math.tau * BUS.encoders[0]) if self._plant else 0

    def is_addressed(self, frame: Frame) -> bool:
        """Whether it takes a frame."""
        groups = [self.values.get(name) for name in ("GRPA", "GRPB", "GRPC")]
        return frame.receiver == self.node or frame.receiver - BusGroup.ANY in groups

    def take(self, frame: Frame, time: float) -> Frame | None:
        """Obey a frame at a time, s; what it answers."""
        values, name = self.values, self._names.get(frame.data[0] & ~frames.WRITE, "")
        if values["STAT"] == 0 and name not in WHILE_ASLEEP:
            return None
        if not frame.data[0] & frames.WRITE:
            if name == "P":
                return frames.position(self.node, values["P"] + self._count())
            return frames.reply(self.node, frame.data[0], values[name]) if name in values else None
        if name == "T" and frame.receiver != self.node:
            values["T"] = frames.read_torques(frame)[values["PIDX"] - 1]
            return None
        if name == "STAT" and values["STAT"] == 0:
            self.deaf_until = time + BUS.waking
        value = frames.written(frame)
        is_settable = value < values.get(name, 0) and values["VERS"] >= BUS.settable_version
        if name != "MODE" or self.node != SAFETY or is_settable:  # only a person goes upwards
            values[name] = value - (self._count() if name == "P" else 0)
        return None


class SimulatedBus:
    """A line with a simulated arm.

    Parameters
    ----------
    shared, own : parameters of the arm and of its plant.
    version : of all firmware.
    plant : behind the controllers; by default one of these parameters.

    Attributes
    ----------
    controllers : by node, to be changed by tests.
    is_attended : whether a person presses Idle and Activate where that is wanted.
    on_line : what becomes of each frame, for tests: lost, doubled, another one; None: the adapter refuses it.
    slack : s, by which answers may be late.
    counts : of errors.
    time : bus time, s.
    """

    def __init__(self, shared: Shared, own: DriverParameters, version: int = 200, plant: Plant | None = None) -> None:
        arm, substep = shared.arm, shared.timing.substep
        self._plant = plant or Plant(arm, own.world, own.effects, substep, own.friction)
        self._plant.brake(False)
        self._body, self._step, self._constant = RigidBody(arm), substep, arm.motors.torque_constant
        self.is_attended, self.slack = True, 0.0
        self._motors = [SimulatedController(at + 1, version, self._plant) for at in range(len(self._constant))]
        safety = SimulatedController(SAFETY, version)
        self.controllers, self._safety = {one.node: one for one in (*self._motors, safety)}, safety.values
        self._mode, self._safety["PEN"] = self._safety["MODE"], pendant_of()
        self.on_line: Callable[[Frame], list[Frame] | None] = lambda frame: [frame]
        self.counts: Counter[str] = Counter()
        self._queue: deque[Frame] = deque()
        self.time = self._reached = self._requested = self._pressed = self._passed = 0.0

    # the line

    def now(self) -> float:
        """Bus time, s."""
        return self.time

    def sleep(self, seconds: float) -> None:
        """Let bus time pass, s, and the plant with it."""
        until = self.time + seconds
        while self._reached + self._step <= until + 1e-9:
            self._plant.step(self.torque, 1)
            self._reached += self._step
            self.time = max(self.time, self._reached)
            self._watch()
        self.time = until

    def let_pass(self, seconds: float, silent: float = BUS.silent) -> None:
        """Time of the host has passed, s; at most `silent` of it counts as time without frames."""
        if self._mode == SafetyMode.ACTIVE:
            self._requested += max(0.0, seconds - silent)
        self._passed = max(self._passed, self.time - BUS.silent) + seconds
        self.sleep(max(0.0, self._passed - self.time))

    def close(self) -> None:
        """Nothing: a simulated bus needs no end."""

    def receive(self, timeout: float) -> Frame | None:
        """The next frame; time passes where there is none."""
        if self._queue:
            return self._queue.popleft()
        self.sleep(timeout)
        return None

    def send(self, frame: Frame) -> bool:
        """Give a frame to the nodes, and keep their answers; whether it was taken."""
        passed = self.on_line(frame)
        for one in passed or ():
            self._deliver(one)
        return passed is not None

    def _deliver(self, frame: Frame) -> None:
        self._spend(frame)
        for one in self.controllers.values():
            has_power = one.node == SAFETY or self._safety["MODE"] != SafetyMode.ESTOP
            is_on = has_power and self.time >= one.deaf_until
            if is_on and one.is_addressed(frame) and (answer := one.take(frame, self.time)):
                self._spend(answer)
                self._queue += self.on_line(answer) or ()
                if frame.receiver == BusGroup.MOTORS and answer.receiver == BusGroup.POSITIONS:
                    self._requested = self.time

    def _spend(self, frame: Frame) -> None:
        """Let the bits of a frame pass, at 1 Mbit/s, one in ten of them stuffed."""
        self.sleep((52 + 9 * len(frame.data)) * 1e-6)

    @property
    def commanded(self) -> list[int | None]:
        """Counts that the motors follow, None where they brake."""
        is_active = self._safety["MODE"] == SafetyMode.ACTIVE
        states = (one.values for one in self._motors)
        return [one["T"] if is_active and one["MODE"] == BUS.torque_mode else None for one in states]

    @property
    def torque(self) -> list[float]:
        """Torque of each motor, N m: of its counts, or the resistance of its winding."""
        return [
            -(constant**2) / BUS.winding * speed
            if count is None
            else max(-one.values["MT"], min(one.values["MT"], count)) / one.values["IPNM"]
            for one, count, speed, constant in zip(
                self._motors, self.commanded, self._plant.thetad, self._constant, strict=True
            )
        ]

    # safety module and person

    def switch(self, mode: SafetyMode, *faulty: str) -> None:
        """Go to a mode, by the button of a person or for watched quantities."""
        if mode != SafetyMode.ACTIVE or self._safety["MODE"] == SafetyMode.IDLE:
            self._safety |= {"MODE": mode, "PEN": pendant_of(*faulty)}

    def _watch(self) -> None:
        values, mode = self._safety, self._safety["MODE"]
        if mode != self._mode:
            self._mode, self._requested, self._pressed = mode, self.time, self.time
            for one in self._motors:
                one.values |= {"MODE": BUS.torque_mode if mode == SafetyMode.ACTIVE else BUS.idle_mode, "T": 0}
                if mode == SafetyMode.ESTOP:
                    one.values |= {"STAT": 0, "P": 1000 * one.node}  # the zero is lost
                    values["ZERO"] = 0
        is_requested = self.time - self._requested <= BUS.heartbeat
        if mode == SafetyMode.ACTIVE:
            speeds = self._body.start_and_tool_speeds(self._plant.q, self._plant.qd)
            if max(abs(one.values["T"]) for one in self._motors) > values["TL2"]:
                self.switch(SafetyMode.IDLE, "torque")
            elif 0 < values["VL2"] < max(speeds) * 4096:
                self.switch(SafetyMode.IDLE, "velocity")
            elif not is_requested:
                self.switch(SafetyMode.ESTOP, "heartbeat")
        elif self.is_attended and self.time - self._pressed > BUS.attention:
            if mode == SafetyMode.ESTOP or faults(values["PEN"]):
                self.switch(SafetyMode.IDLE)
            elif values["ZERO"] and is_requested:
                self.switch(SafetyMode.ACTIVE)
