"""A simulator of the bus: motor controllers, safety module with pendant, and a person, in bus time.

Bus time passes with the bits of each frame, with waiting, and to the next period with `let_pass`.
"""

import math
from collections import deque
from collections.abc import Callable, Mapping

from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody
from wam_driver.bus import frames, properties
from wam_driver.bus.frames import Bit, BusGroup, BusNode, Frame
from wam_driver.bus.safety_module import Button, Pendant, SafetyMode
from wam_driver.plant import Plant
from wam_driver.thresholds import BUS

SAFETY_VALUES = {"ROLE": 2, "STAT": 2, "ZERO": 0, "VL1": 2048, "VL2": 4096, "TL1": 4731, "TL2": 5204, "IFAULT": 0}


class SimulatedController:
    """Properties of a node by name; torque in counts under "T", position under "P".

    Attributes
    ----------
    values : what it is, to be changed by tests.
    woken : bus time at which it was reported to wake, ns; None where it was not.
    """

    def __init__(self, node: int, version: int, values: Mapping[str, int]) -> None:
        self.node, self.is_safety = node, node == BusNode.SAFETY_MODULE
        self.values: dict[str, int] = {"VERS": version, "MODE": 0, **values}
        self.woken: int | None = None
        self._names = properties.names(version, self.is_safety)

    def is_addressed(self, frame: Frame) -> bool:
        """Whether it takes a frame."""
        if not frame.is_to_group:
            return frame.receiver == self.node
        groups = [] if self.is_safety else [0, *(self.values[name] for name in ("GRPA", "GRPB", "GRPC"))]
        return frame.receiver in groups

    def take(self, frame: Frame) -> list[Frame]:
        """Obey a frame; what it answers."""
        name = self._names.get(frame.data[0] & ~Bit.WRITE, "")
        is_asleep = self.values["STAT"] == 0
        if is_asleep and name not in ("VERS", "ROLE", "SN", "ID", "ERROR", "STAT", "ADDR"):
            return []
        if not frame.data[0] & Bit.WRITE:
            if name == "P":
                return [frames.position(self.node, self.values["P"])]
            return [frames.reply(self.node, frame.data[0], self.values[name])] if name in self.values else []
        if name == "T" and frame.is_to_group:
            self.values["T"] = frames.read_torques(frame)[self.values["PIDX"] - 1]
        elif name:
            self.values[name] = int.from_bytes(frame.data[2:], "little", signed=True)
        return []


class SimulatedBus:
    """A `Line` with an arm on it.

    Parameters
    ----------
    arm : in the plant.
    plant : behind the controllers.
    substep : of the plant, s.
    version : of all firmware.
    is_homed : whether the zero is known at the start.
    is_attended : whether a person presses Idle and Activate where that is wanted.

    Attributes
    ----------
    controllers : by node, to be changed by tests.
    on_line : what becomes of each frame, for tests: lost, doubled, another one.
    time : bus time, ns.
    """

    def __init__(
        self,
        arm: Arm,
        plant: Plant,
        substep: float,
        version: int = 200,
        is_homed: bool = True,
        is_attended: bool = True,
    ) -> None:
        self._plant, self._body = plant, RigidBody(arm)
        plant.brake(False)
        self._constant = arm.motors.torque_constant
        self._step = round(substep * BUS.second)
        self.is_attended = is_attended
        motors = range(1, len(arm.motors.names) + 1)
        self.controllers = {node: SimulatedController(node, version, _motor(node)) for node in motors}
        self._motors = list(self.controllers.values())
        self._safety = SimulatedController(BusNode.SAFETY_MODULE, version, SAFETY_VALUES | {"MODE": SafetyMode.IDLE})
        self.controllers[BusNode.SAFETY_MODULE] = self._safety
        self._show(Pendant(Button.NONE))
        self.on_line: Callable[[Frame], list[Frame]] = lambda frame: [frame]
        self._queue: deque[Frame] = deque()
        self.time = self._reached = self._requested = self._pressed = self._passed = 0
        self._offsets = [0] * len(self._motors)
        if is_homed:
            self._safety.values["ZERO"] = 1
        else:
            self._offsets = [1000 * node for node in motors]
        self._measure()

    # the line

    def now(self) -> float:
        """Bus time, s."""
        return self.time / BUS.second

    def sleep(self, seconds: float) -> None:
        """Let bus time pass."""
        self._advance(self.time + round(seconds * BUS.second))

    def let_pass(self, seconds: float, late: float) -> None:
        """A period of the host has passed, in which there may have been frames; the late part is no silence."""
        self._requested += round(late * BUS.second)
        self._passed += round(seconds * BUS.second)
        if self._passed < self.time:
            self._passed = self.time
        else:
            self._advance(self._passed)

    def close(self) -> None:
        """Nothing: a simulated bus needs no end."""

    def receive(self, timeout: float) -> Frame | None:
        """The next frame; time passes where there is none."""
        if self._queue:
            return self._queue.popleft()
        self.sleep(timeout)
        return None

    def send(self, frame: Frame) -> None:
        """Give a frame to the nodes, and keep their answers."""
        for passed in self.on_line(frame):
            self._deliver(passed)

    def _deliver(self, frame: Frame) -> None:
        self._spend(frame)
        is_request = frame.identifier == Bit.GROUP | BusGroup.MOTORS and not frame.data[0] & Bit.WRITE
        number = properties.number("P", self._motors[0].values["VERS"])
        if is_request and frame.data[0] == number:
            self._requested = self.time
        for one in self.controllers.values():
            if one.is_addressed(frame) and self._is_on(one):
                self._obey(one, frame)

    def _obey(self, one: SimulatedController, frame: Frame) -> None:
        before = dict(one.values)
        answers = one.take(frame)
        wanted = one.values["MODE"]
        if one is self._safety:
            one.values["MODE"] = before["MODE"]
            if wanted < before["MODE"] and one.values["VERS"] >= BUS.settable_version:  # only a person goes upwards
                self._set_mode(SafetyMode(before["MODE"]), SafetyMode(wanted))
        elif one.values["P"] != before["P"]:
            self._offsets[one.node - 1] += one.values["P"] - before["P"]
        elif one.values["STAT"] == BUS.ready != before["STAT"]:
            one.values["STAT"], one.woken = before["STAT"], self.time
        for answer in answers:
            self._spend(answer)
            self._queue += self.on_line(answer)

    def _spend(self, frame: Frame) -> None:
        """Let the bits of a frame pass, at 1 Mbit/s, one in ten of them stuffed."""
        self._advance(self.time + (52 + 9 * len(frame.data)) * 1000)

    def _is_on(self, one: SimulatedController) -> bool:
        """Whether a node has power and is not woken, when a frame would drive it off the bus."""
        return one is self._safety or (self._safety.values["MODE"] != SafetyMode.ESTOP and one.woken is None)

    # time

    def _advance(self, until: int) -> None:
        """Step the plant up to a time, ns."""
        while self._reached + self._step <= until:
            self._plant.step(self.torque, 1)
            self._reached += self._step
            self.time = max(self.time, self._reached)
            self._measure()
            self._watch()
        self.time = until

    def _measure(self) -> None:
        for at, (one, theta) in enumerate(zip(self._motors, self._plant.theta, strict=True)):
            one.values["P"] = math.floor(theta / math.tau * one.values["CTS"]) + self._offsets[at]

    @property
    def torque(self) -> list[float]:
        """Torque of each motor, N m: of its counts, or the resistance of its winding."""
        is_active = self._safety.values["MODE"] == SafetyMode.ACTIVE
        found = []
        for one, speed, constant in zip(self._motors, self._plant.thetad, self._constant, strict=True):
            values = one.values
            if is_active and values["MODE"] == BUS.torque_mode:
                found.append(max(-values["MT"], min(values["MT"], values["T"])) / values["IPNM"])
            else:
                found.append(-(constant**2) / BUS.winding * speed)
        return found

    @property
    def commanded(self) -> list[int]:
        """Counts that the motors follow, zero where they brake."""
        is_active = self._safety.values["MODE"] == SafetyMode.ACTIVE
        return [one.values["T"] if is_active and one.values["MODE"] == BUS.torque_mode else 0 for one in self._motors]

    # safety module and person

    def press(self, button: Button) -> None:
        """Press a button of the pendant."""
        mode = SafetyMode(self._safety.values["MODE"])
        if button is Button.ESTOP:
            wanted = SafetyMode.ESTOP
        elif button is Button.IDLE:
            wanted = SafetyMode.IDLE
        else:
            wanted = SafetyMode.ACTIVE if mode is SafetyMode.IDLE else mode
        self._set_mode(mode, wanted)
        self._show(Pendant(button))

    def _set_mode(self, before: SafetyMode, mode: SafetyMode) -> None:
        if mode is before:
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
        self._set_mode(SafetyMode(self._safety.values["MODE"]), mode)
        self._show(Pendant(Button.NONE, faults=(quantity,)))

    def _watch(self) -> None:
        for one in self._motors:
            if one.woken is not None and self.time - one.woken > BUS.waking * BUS.second:
                one.woken, one.values["STAT"] = None, BUS.ready
        values = self._safety.values
        if values["MODE"] == SafetyMode.ACTIVE:
            speeds = self._body.start_and_tool_speeds(self._plant.q, self._plant.qd)
            if max(abs(one.values["T"]) for one in self._motors) > values["TL2"]:
                self._fault("torque", SafetyMode.IDLE)
            elif 0 < values["VL2"] < max(speeds) * 4096:
                self._fault("velocity", SafetyMode.IDLE)
            elif self.time - self._requested > BUS.heartbeat * BUS.second:
                self._fault("heartbeat", SafetyMode.ESTOP)
        elif self.is_attended and self.time - self._pressed > BUS.attention * BUS.second:
            has_faults = bool(Pendant.of(values["PEN"]).faults)
            is_running = values["ZERO"] and self.time - self._requested < BUS.heartbeat * BUS.second
            if has_faults or values["MODE"] == SafetyMode.ESTOP:
                self.press(Button.IDLE)
            elif is_running:
                self.press(Button.ACTIVATE)


def _motor(node: int) -> dict[str, int]:
    """Properties of a controller."""
    return {
        "ROLE": 0,
        "STAT": 0,
        "T": 0,
        "P": 0,
        "MT": BUS.cable_limit[node - 1],
        "IPNM": BUS.gain[node - 1],
        "CTS": 4096,
        "PIDX": (node - 1) % 4 + 1,
        "POLES": BUS.wrist_poles if node == 7 else 12,
        "GRPA": 0,
        "GRPB": BusGroup.ARM if node <= 4 else BusGroup.WRIST,
        "GRPC": BusGroup.MOTORS,
    }
