"""What is sent and taken in each period once the arm is started."""

import math
from collections.abc import Collection, Sequence

from wam_description.event import Value
from wam_driver.bus import frames
from wam_driver.bus.bus_fault import BusFault
from wam_driver.bus.frames import HOST, SAFETY, BusGroup, Frame
from wam_driver.bus.host import Host
from wam_driver.bus.motor import Motor
from wam_driver.bus.safety_module import SafetyMode, faults
from wam_driver.thresholds import BUS


class Cycle:
    """Sends torques and takes positions and modes, in each period.

    Parameters
    ----------
    host : on the bus, whose first trouble brakes.
    motors : of the arm.
    period : s.

    Attributes
    ----------
    safety_mode : of the safety module.
    is_released : whether the controllers follow torques.
    """

    def __init__(self, host: Host, motors: Sequence[Motor], period: float) -> None:
        self._host, self.motors, self._period = host, motors, period
        self._by_answer = {frames.position(motor.node, 0).identifier: motor for motor in motors}
        self.safety_mode: int = SafetyMode.IDLE
        self._patience = BUS.collect * period + host.line.slack
        self._poll_at, self._is_answered, self._pendant = host.now(), True, 0
        self._lost_at = -math.inf  # s, when a position did not come in time
        self._torque, self._mode = host.number(BusGroup.MOTORS, "T"), host.number(BusGroup.MOTORS, "MODE")
        # the pendant first: it states why the mode changes
        requested = (SAFETY, "PEN"), (SAFETY, "MODE"), (BusGroup.MOTORS, "MODE"), (BusGroup.MOTORS, "P")
        self._requests = [frames.get(to, host.number(to, name)) for to, name in requested]
        self.brake(True)

    def brake(self, on: bool) -> None:
        """Let the controllers idle, or follow their torques, which are zero first."""
        self.is_released = not on
        self.command([0.0] * len(self.motors))
        self._host.write(BusGroup.MOTORS, "MODE", BUS.idle_mode if on else BUS.torque_mode)

    def stop(self) -> None:
        """Brake, and let the safety module go to idle where its firmware takes that from the host."""
        self.brake(True)
        if self.safety_mode == SafetyMode.ACTIVE and self._host.versions[SAFETY] >= BUS.settable_version:
            self._host.write(SAFETY, "MODE", SafetyMode.IDLE)

    def command(self, currents: Sequence[float]) -> None:
        """Send torques by currents, A, (n,), clipped."""
        counts = [motor.torque(current) for motor, current in zip(self.motors, currents, strict=True)]
        self._host.send(frames.torques(BusGroup.ARM, self._torque, counts[:4]))
        if len(counts) > 4:
            self._host.send(frames.torques(BusGroup.WRIST, self._torque, counts[4:]))

    def exchange(self) -> None:
        """Ask for positions and, from time to time, modes; take what comes."""
        host = self._host
        if host.trouble:
            self.brake(True)  # in every period, as one may not have arrived
        if host.now() >= self._poll_at:
            self._poll()
        for _ in range(BUS.most_frames):
            if (late := host.line.receive(0.0)) is None:
                break
            # a position that was awaited before is no answer to this request
            if late.identifier not in self._by_answer or host.now() - self._lost_at > BUS.silent:
                self._take(late)
        host.send(self._requests[-1])
        requested, awaited = host.now(), self._by_answer.copy()
        for _ in range(BUS.most_frames):
            if not awaited or (frame := host.line.receive(self._patience)) is None:
                break
            identifier, data = frame
            motor = awaited.pop(identifier, None)
            if motor is None:
                self._take(frame)
            elif not motor.take(data, requested):
                awaited[identifier] = motor
        if awaited:
            self._judge(awaited.values())

    def _poll(self) -> None:
        """Ask for the modes; that there was no answer to the last requests is a fault."""
        if not self._is_answered:
            self._fault(BusFault.SAFETY_SILENT)
        self._is_answered = False
        self._poll_at = self._host.now() + BUS.poll
        for request in self._requests[:-1]:
            self._host.send(request)

    def _take(self, frame: Frame) -> None:
        """Take a frame that is no awaited position."""
        found = frames.read(frame)
        if frame.sender == HOST:
            if not self._host.line.slack:  # no echo
                self._stray(BusFault.FOREIGN)
        elif found is None or found.node not in self._host.versions:
            self._host.counts["other frames"] += 1
        elif found.number is None:
            self._stray(BusFault.DOUBLED, found.node)
        elif found.number == self._mode:
            self._take_mode(found.node, found.value)
        elif found.node == SAFETY:
            self._pendant, self._is_answered = found.value, True

    def _take_mode(self, node: int, mode: int) -> None:
        if node == SAFETY:
            self._is_answered, self.safety_mode = True, mode
            if self.is_released and mode != SafetyMode.ACTIVE:
                self._fault(BusFault.SAFETY_IDLE if mode == SafetyMode.IDLE else BusFault.ESTOP)
        elif self.is_released and mode != BUS.torque_mode:
            self._fault(BusFault.CONTROLLER_IDLE, node, mode)
        elif not self.is_released and mode != BUS.idle_mode:  # as after Shift-Activate
            self.brake(True)

    def _judge(self, awaited: Collection[Motor]) -> None:
        """Look for motors whose positions have not come for too long."""
        self._host.counts["lost replies"] += len(awaited)
        self._lost_at = self._host.now()
        for motor in awaited:
            motor.missed += 1
        silent = [motor for motor in awaited if motor.missed * self._period >= BUS.silent]
        if not silent or self._host.trouble:
            return
        node = silent[0].node
        if self._host.refused:
            self._fault(BusFault.NOT_SENT, 0, self._host.refused)
        elif len(silent) == len(self.motors):  # E-stop, power or cable, by what the safety module answers
            mode = self._host.ask(SAFETY, "MODE", 1)
            named: dict[int | None, BusFault] = {None: BusFault.NO_POWER, SafetyMode.ESTOP: BusFault.ESTOP}
            self._fault(named.get(mode, BusFault.ALL_SILENT))
        elif silent[0].has_jumped:
            self._fault(BusFault.JUMP, node)
        else:
            self._fault(BusFault.RESET if self._host.ask(node, "STAT", 1) == 0 else BusFault.NO_REPLY, node)

    def _stray(self, fault: BusFault, node: int = 0) -> None:
        """Count a frame that nobody may send; more than some are a fault."""
        name = f"{fault.name.lower()} frames"
        self._host.counts[name] += 1
        if self._host.counts[name] % BUS.stray == 0:
            self._fault(fault, node)

    def _fault(self, fault: BusFault, node: int = 0, detail: Value = "") -> None:
        if fault in (BusFault.ESTOP, BusFault.SAFETY_IDLE) and (lit := faults(self._pendant)):
            detail = " and ".join(lit)
        self._host.trouble = self._host.trouble or fault.event(node, detail)
        self.stop()
