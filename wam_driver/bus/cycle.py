"""What is sent and taken in each period once the arm is started."""

from collections import Counter
from collections.abc import Collection, Iterator, Sequence

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
    is_zero_lost : whether the position of a motor has jumped.
    """

    def __init__(self, host: Host, motors: Sequence[Motor], period: float) -> None:
        self._host, self.motors, self._period = host, motors, period
        self._by_answer = {frames.position(motor.node, 0).identifier: motor for motor in motors}
        self.safety_mode: int = SafetyMode.IDLE
        self._patience = BUS.collect * period + host.line.slack
        self._poll_at, self._is_answered, self._pendant = host.now(), True, 0
        self._unanswered: Counter[int] = Counter()  # questions in a row for the mode, by node
        self.is_zero_lost = False
        self._was_released = False  # when the modes were requested last
        self._torque, self._mode = host.number(BusGroup.MOTORS, "T"), host.number(BusGroup.MOTORS, "MODE")
        # the pendant first: it states why the mode changes
        requested = (SAFETY, "PEN"), (SAFETY, "MODE"), (BusGroup.MOTORS, "MODE"), (BusGroup.MOTORS, "P")
        self._requests = [frames.get(to, host.number(to, name)) for to, name in requested]
        self.brake(True)

    def brake(self, on: bool) -> None:
        """Let the controllers idle, or follow their torques, which are zero first."""
        self.is_released = not on
        self.command([0.0] * len(self.motors))
        self._host.put(BusGroup.MOTORS, "MODE", BUS.idle_mode if on else BUS.torque_mode)

    def stop(self) -> None:
        """Brake, and let the safety module go to idle where its firmware takes that from the host."""
        self.brake(True)
        if self.safety_mode == SafetyMode.ACTIVE and self._host.versions[SAFETY] >= BUS.settable_version:
            self._host.put(SAFETY, "MODE", SafetyMode.IDLE)
            self.safety_mode = SafetyMode.IDLE  # until it answers otherwise

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
            self.stop()  # in every period, as one may not have arrived
        for late in self._arriving(0.0):
            self._take(late)  # a position that was awaited before is no answer to this request
        host.send(self._requests[-1])
        self._owe()
        requested, awaited = host.now(), self._by_answer.copy()
        if requested >= self._poll_at:  # after the positions, whose times it would change
            self._poll()
        for frame in self._arriving(self._patience):
            found, motor = self._take(frame), awaited.get(frame.identifier)
            if motor and found and motor.take(found.value, requested):
                del awaited[frame.identifier]
                if not awaited:
                    return
        self._judge(awaited.values())

    def _arriving(self, patience: float) -> Iterator[Frame]:
        """Frames, each waited for so long, s, but for a period in all; later only those that are there."""
        host = self._host
        end = host.now() + self._period + host.line.slack
        for _ in range(BUS.most_frames):
            if (frame := host.line.receive(max(0.0, min(patience, end - host.now())))) is None:
                return
            yield frame

    def _owe(self) -> None:
        """Positions are requested, by this host or another one; as many answers may come."""
        for motor in self.motors:
            motor.owed = min(motor.owed + 1, round(BUS.silent / self._period))

    def _poll(self) -> None:
        """Ask for the modes; that there was no answer to the last requests is a fault."""
        if not self._is_answered or self._unanswered[SAFETY] >= BUS.attempts:
            self._fault(BusFault.SAFETY_SILENT)
        if silent := [motor.node for motor in self.motors if self._unanswered[motor.node] >= BUS.attempts]:
            self._fault(BusFault.NO_MODE, silent[0])
        if self.is_zero_lost:  # now and then, as one may not arrive
            self._host.put(SAFETY, "ZERO", 0)
        self._poll_at, self._was_released = self._host.now() + BUS.poll, self.is_released
        for request in self._requests[:-1]:
            self._host.send(request)
        self._is_answered = self._host.refused > 0  # then nothing is to be answered
        if not self._is_answered:
            self._unanswered.update([SAFETY, *(motor.node for motor in self.motors)])

    def _take(self, frame: Frame) -> frames.Value | None:
        """Take a frame, and return what a node answers in it."""
        found, motor = frames.read(frame), self._by_answer.get(frame.identifier)
        if frame.sender == HOST:
            if not self._host.line.slack:  # no echo
                self._stray(BusFault.FOREIGN)
                if frame.data == self._requests[-1].data:
                    self._owe()
        elif found is None or found.node not in self._host.versions:
            self._host.counts["other frames"] += 1
        elif motor:
            motor.owed -= 1
            if motor.owed < 0:
                motor.owed = 0
                self._stray(BusFault.DOUBLED, motor.node)
        elif found.number == self._mode:
            self._take_mode(found.node, found.value)
        elif found.node == SAFETY:
            self._pendant, self._is_answered = found.value, True
        return found

    def _take_mode(self, node: int, mode: int) -> None:
        self._unanswered[node] = 0
        if node == SAFETY:
            self._is_answered, self.safety_mode = True, mode
            if self.is_released and mode != SafetyMode.ACTIVE:
                self._fault(BusFault.SAFETY_IDLE if mode == SafetyMode.IDLE else BusFault.ESTOP)
        elif self._was_released != self.is_released:
            return  # it answers a request from before the change
        elif self.is_released and mode != BUS.torque_mode:
            self._fault(BusFault.CONTROLLER_IDLE, node, mode)
        elif not self.is_released and mode != BUS.idle_mode:  # as after Shift-Activate
            self.brake(True)

    def _judge(self, awaited: Collection[Motor]) -> None:
        """Look for motors whose positions have not come for too long."""
        self._host.counts["lost replies"] += len(awaited)
        for motor in awaited:
            motor.missed += 1
        silent = [motor for motor in awaited if motor.missed * self._period >= BUS.silent]
        if not silent:
            return
        self.is_zero_lost |= any(motor.has_jumped for motor in silent)
        if self._host.trouble:
            return
        node, refused = silent[0].node, self._host.refused
        self.stop()  # first: to find out why takes some periods
        if refused:
            self._fault(BusFault.NOT_SENT, 0, refused)
        elif len(silent) == len(self.motors):
            fault = self._host.silence(BusFault.ALL_SILENT)
            self._pendant = (fault == BusFault.ESTOP and self._host.ask(SAFETY, "PEN", 1)) or self._pendant
            self._fault(fault)
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
