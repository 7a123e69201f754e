"""A simulator of the bus: motor controllers, safety module with pendant, and a person, in bus time.

Bus time passes with the bits of each frame, with waiting, and to the next period with `let_pass`.
"""

import math
from collections import Counter, deque
from collections.abc import Callable, Mapping

from wam_description.arm import Arm, Shared
from wam_description.rigid_body import RigidBody
from wam_driver.bus import frames, properties
from wam_driver.bus.frames import Bit, BusGroup, BusNode, Frame
from wam_driver.bus.safety_module import Button, Pendant, SafetyMode
from wam_driver.driver import DriverParameters
from wam_driver.plant import Plant
from wam_driver.thresholds import BUS

SAFETY_VALUES = {"ROLE": 2, "STAT": 2, "ZERO": 0, "VL1": 2048, "VL2": 4096, "TL1": 4731, "TL2": 5204, "IFAULT": 0}
WHILE_ASLEEP = ("VERS", "ROLE", "SN", "ID", "ERROR", "STAT", "ADDR")


def nanoseconds(seconds: float) -> int:
    """Time as the simulated bus counts it."""
    return round(seconds * 1e9)


class SimulatedController:
    """A motor controller or the safety module.

    Parameters
    ----------
    node : on the bus.
    version : of the firmware.
    values : of the properties by name; torque in counts under "T", counts at the angle zero under "P".
    count : of the motor, from the angle zero.

    Attributes
    ----------
    values : to be changed by tests.
    deaf_until : bus time at which it is awake, ns.
    """

    def __init__(
        self, node: int, version: int, values: Mapping[str, int], count: Callable[[], int] = lambda: 0
    ) -> None:
        self.node, self._count = node, count
        self.values: dict[str, int] = {"VERS": version, "MODE": 0, **values}
        self.deaf_until = 0
        self._names = properties.names(version, node == BusNode.SAFETY_MODULE)

    def is_addressed(self, frame: Frame) -> bool:
        """Whether it takes a frame."""
        if not frame.is_to_group:
            return frame.receiver == self.node
        return frame.receiver in [self.values.get(name) for name in ("GRPA", "GRPB", "GRPC")]

    def take(self, frame: Frame, time: int) -> Frame | None:
        """Obey a frame at a time, ns; what it answers."""
        values, name = self.values, self._names.get(frame.data[0] & ~Bit.WRITE, "")
        if values["STAT"] == 0 and name not in WHILE_ASLEEP:
            return None
        if not frame.data[0] & Bit.WRITE:
            if name == "P":
                return frames.position(self.node, values["P"] + self._count())
            return frames.reply(self.node, frame.data[0], values[name]) if name in values else None
        if name == "T" and frame.is_to_group:
            values["T"] = frames.read_torques(frame)[values["PIDX"] - 1]
            return None
        if name == "STAT" and values["STAT"] == 0:
            self.deaf_until = time + nanoseconds(BUS.waking)
        values[name] = frames.written(frame) - (self._count() if name == "P" else 0)
        return None


class SimulatedBus:
    """A line with an arm on it.

    Parameters
    ----------
    arm : in the plant.
    plant : behind the controllers.
    substep : of the plant, s.
    version : of all firmware.
    is_homed : whether the zero is known at the start.

    Attributes
    ----------
    controllers : by node, to be changed by tests.
    is_attended : whether a person presses Idle and Activate where that is wanted.
    on_line : what becomes of each frame, for tests: lost, doubled, another one; None: the adapter refuses it.
    counts : of errors.
    time : bus time, ns.
    """

    def __init__(self, arm: Arm, plant: Plant, substep: float, version: int = 200, is_homed: bool = True) -> None:
        self._plant, self._body, self._step = plant, RigidBody(arm), nanoseconds(substep)
        plant.brake(False)
        self._constant = arm.motors.torque_constant
        self.is_attended = True
        self._motors = [self._motor(at, version, is_homed) for at in range(len(self._constant))]
        given = SAFETY_VALUES | {"MODE": SafetyMode.IDLE, "ZERO": int(is_homed)}
        self._safety = SimulatedController(BusNode.SAFETY_MODULE, version, given)
        self.controllers = {one.node: one for one in (*self._motors, self._safety)}
        self._position_request = frames.get(BusGroup.MOTORS, properties.number("P", version), Bit.GROUP)
        self._show(Pendant(Button.NONE))
        self.on_line: Callable[[Frame], list[Frame] | None] = lambda frame: [frame]
        self.counts: Counter[str] = Counter()
        self._queue: deque[Frame] = deque()
        self.time = self._reached = self._requested = self._pressed = self._passed = 0

    @classmethod
    def of(cls, shared: Shared, own: DriverParameters, version: int, is_homed: bool = True) -> "SimulatedBus":
        """With the plant of a configuration."""
        arm, substep = shared.arm, shared.timing.substep
        return cls(arm, Plant(arm, own.world, own.effects, substep, own.friction), substep, version, is_homed)

    def _motor(self, at: int, version: int, is_homed: bool) -> SimulatedController:
        node = at + 1
        values = {
            "ROLE": 0,
            "STAT": 0,
            "T": 0,
            "P": 0 if is_homed else 1000 * node,
            "MT": BUS.cable_limit[at],
            "IPNM": BUS.gain[at],
            "CTS": BUS.encoders[0],
            "PIDX": at % 4 + 1,
            "POLES": BUS.wrist_poles if node == 7 else 12,
            "GRPA": 0,
            "GRPB": BusGroup.ARM if node <= 4 else BusGroup.WRIST,
            "GRPC": BusGroup.MOTORS,
        }
        return SimulatedController(
            node, version, values, lambda: math.floor(self._plant.theta[at] / math.tau * BUS.encoders[0])
        )

    # the line

    def now(self) -> float:
        """Bus time, s."""
        return self.time / 1e9

    def sleep(self, seconds: float) -> None:
        """Let bus time pass."""
        self._advance(self.time + nanoseconds(seconds))

    def let_pass(self, seconds: float) -> None:
        """A period of the host has passed, in which there may have been frames; the late part is no silence."""
        late = max(0.0, seconds - BUS.silent)
        self._requested += nanoseconds(late)
        self._passed += nanoseconds(seconds)
        if self._passed < self.time - nanoseconds(BUS.silent):  # as after the start
            self._passed = self.time
        self._advance(max(self.time, self._passed))

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
        if frame == self._position_request:
            self._requested = self.time
        mode = self._safety.values["MODE"]
        for one in self.controllers.values():
            is_on = (one is self._safety or mode != SafetyMode.ESTOP) and self.time >= one.deaf_until
            if is_on and one.is_addressed(frame) and (answer := one.take(frame, self.time)):
                self._spend(answer)
                self._queue += self.on_line(answer) or ()
        wanted, self._safety.values["MODE"] = self._safety.values["MODE"], mode
        if wanted < mode and self._safety.values["VERS"] >= BUS.settable_version:  # only a person goes upwards
            self._set_mode(SafetyMode(wanted))

    def _spend(self, frame: Frame) -> None:
        """Let the bits of a frame pass, at 1 Mbit/s, one in ten of them stuffed."""
        self._advance(self.time + (52 + 9 * len(frame.data)) * 1000)

    def _advance(self, until: int) -> None:
        """Step the plant up to a time, ns."""
        while self._reached + self._step <= until:
            self._plant.step(self.torque, 1)
            self._reached += self._step
            self.time = max(self.time, self._reached)
            self._watch()
        self.time = until

    @property
    def commanded(self) -> list[int | None]:
        """Counts that the motors follow, None where they brake."""
        is_active = self._safety.values["MODE"] == SafetyMode.ACTIVE
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

    def press(self, button: Button) -> None:
        """Press a button of the pendant."""
        modes = {Button.ESTOP: SafetyMode.ESTOP, Button.IDLE: SafetyMode.IDLE, Button.ACTIVATE: SafetyMode.ACTIVE}
        if button is not Button.ACTIVATE or self._safety.values["MODE"] == SafetyMode.IDLE:
            self._set_mode(modes[button])
        self._show(Pendant(button))

    def _set_mode(self, mode: SafetyMode) -> None:
        if mode == self._safety.values["MODE"]:
            return
        self._safety.values["MODE"] = mode
        self._requested = self._pressed = self.time
        for one in self._motors:
            one.values["MODE"] = BUS.torque_mode if mode is SafetyMode.ACTIVE else BUS.idle_mode
            one.values["T"] = 0
            if mode is SafetyMode.ESTOP:
                one.values["STAT"], self._safety.values["ZERO"] = 0, 0

    def _show(self, pendant: Pendant) -> None:
        self._safety.values["PEN"] = pendant.value

    def _fault(self, quantity: str, mode: SafetyMode) -> None:
        self._set_mode(mode)
        self._show(Pendant(Button.NONE, (quantity,)))

    def _watch(self) -> None:
        values = self._safety.values
        is_requested = self.time - self._requested <= nanoseconds(BUS.heartbeat)
        if values["MODE"] == SafetyMode.ACTIVE:
            speeds = self._body.start_and_tool_speeds(self._plant.q, self._plant.qd)
            if max(abs(one.values["T"]) for one in self._motors) > values["TL2"]:
                self._fault("torque", SafetyMode.IDLE)
            elif 0 < values["VL2"] < max(speeds) * 4096:
                self._fault("velocity", SafetyMode.IDLE)
            elif not is_requested:
                self._fault("heartbeat", SafetyMode.ESTOP)
        elif self.is_attended and self.time - self._pressed > nanoseconds(BUS.attention):
            if values["MODE"] == SafetyMode.ESTOP or Pendant.of(values["PEN"]).faults:
                self.press(Button.IDLE)
            elif values["ZERO"] and is_requested:
                self.press(Button.ACTIVATE)
