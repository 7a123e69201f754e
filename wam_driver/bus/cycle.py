"""What is sent and taken in each period once the arm is started."""

from collections import Counter
from collections.abc import Collection, Sequence

from wam_driver.bus import frames
from wam_driver.bus.bus_fault import BusFault, Trouble
from wam_driver.bus.frames import Bit, BusGroup, BusNode, Frame
from wam_driver.bus.host import Host
from wam_driver.bus.motor_track import MotorTrack
from wam_driver.bus.safety_module import Pendant, SafetyMode
from wam_driver.bus.start_up import Settings
from wam_driver.thresholds import BUS


class Cycle:
    """Torques, positions and modes.

    Parameters
    ----------
    host : on the bus.
    settings : of the arm.
    torque_constant : N m/A, (n,).
    period : s.

    Attributes
    ----------
    motors : their positions.
    safety_mode : of the safety module.
    is_released : whether the controllers follow torques.
    trouble : the first fault; it brakes.
    """

    def __init__(self, host: Host, settings: Settings, torque_constant: Sequence[float], period: float) -> None:
        self._host, self._limit, self._period = host, settings.limit, period
        self._patience = BUS.collect * period
        self._gain = [gain * k for gain, k in zip(settings.gain, torque_constant, strict=True)]  # counts/A
        self.motors = [MotorTrack(node, turn) for node, turn in enumerate(settings.counts, 1)]
        self.safety_mode = SafetyMode.IDLE
        self.trouble: Trouble | None = None
        self._strays: Counter[BusFault] = Counter()
        self._by_answer = {frames.position(motor.node, 0).identifier: motor for motor in self.motors}
        self._poll_at, self._is_answered, self._pendant = host.now(), True, 0
        self._torque, self._mode = host.number(1, "T"), host.number(1, "MODE")
        self._requests = [  # the pendant first: it states why the mode changes
            frames.get(BusNode.SAFETY_MODULE, host.number(BusNode.SAFETY_MODULE, "PEN")),
            frames.get(BusNode.SAFETY_MODULE, self._mode),
            frames.get(BusGroup.MOTORS, self._mode, Bit.GROUP),
            frames.get(BusGroup.MOTORS, host.number(1, "P"), Bit.GROUP),
        ]
        self.set_released(False)

    def set_released(self, is_released: bool) -> None:
        """Let the controllers follow their torques, which are zero first, or idle."""
        self.is_released = is_released
        self.command([0.0] * len(self.motors))
        mode = BUS.torque_mode if is_released else BUS.idle_mode
        self._host.send(frames.put(BusGroup.MOTORS, self._mode, mode, Bit.GROUP))

    def stop(self) -> None:
        """Brake, and let the safety module go to idle where its firmware takes that from the host."""
        self.set_released(False)
        is_settable = self._host.versions[BusNode.SAFETY_MODULE] >= BUS.settable_version
        if is_settable and self.safety_mode is SafetyMode.ACTIVE:
            self._host.send(frames.put(BusNode.SAFETY_MODULE, self._mode, SafetyMode.IDLE))

    def command(self, currents: Sequence[float]) -> list[float]:
        """Send torques by currents, A, (n,), clipped; what was sent."""
        limited = zip(currents, self._gain, self._limit, strict=True)
        counts = [max(-most, min(most, round(i * gain))) for i, gain, most in limited]
        self._host.send(frames.torques(BusGroup.ARM, self._torque, counts[:4]))
        if len(counts) > 4:
            self._host.send(frames.torques(BusGroup.WRIST, self._torque, counts[4:]))
        return [count / gain for count, gain in zip(counts, self._gain, strict=True)]

    def exchange(self) -> None:
        """Ask for positions and, from time to time, modes; take what comes."""
        host = self._host
        if host.now() >= self._poll_at:
            self._poll()
        host.send(self._requests[-1])
        requested, awaited = host.now(), self._by_answer.copy()
        for _ in range(BUS.most_frames):
            if not awaited or (frame := host.receive(self._patience)) is None:
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
        found = frames.read(frame)
        if found is None:
            self._host.counts["other frames"] += 1
            if frame.sender == BusNode.HOST:
                self._stray(BusFault.FOREIGN)
        elif found.node == BusNode.SAFETY_MODULE:
            self._is_answered = True
            if found.number != self._mode:
                self._pendant = found.value
            elif 0 <= found.value <= SafetyMode.ACTIVE:
                self._take_safety_mode(SafetyMode(found.value))
        elif found.node > len(self.motors):
            self._host.counts["other frames"] += 1
        elif found.number is None:
            self._stray(BusFault.DOUBLED, found.node)
        elif found.number == self._mode:
            self._take_mode(found.node, found.value)

    def _take_safety_mode(self, mode: SafetyMode) -> None:
        self.safety_mode = mode
        if self.is_released and mode is not SafetyMode.ACTIVE:
            self._fault(BusFault.SAFETY_IDLE if mode is SafetyMode.IDLE else BusFault.ESTOP)

    def _take_mode(self, node: int, mode: int) -> None:
        if self.is_released and mode != BUS.torque_mode:
            self._fault(BusFault.CONTROLLER_IDLE, node, str(mode))
        elif not self.is_released and mode != BUS.idle_mode:  # as after Shift-Activate
            self.set_released(False)

    def _judge(self, awaited: Collection[MotorTrack]) -> None:
        """Look for motors whose positions have not come for too long."""
        self._host.counts["lost replies"] += len(awaited)
        for motor in awaited:
            motor.missed += 1
        silent = [motor for motor in awaited if motor.missed * self._period >= BUS.silent]
        if not silent or self.trouble:
            return
        if self._host.refused:
            self._fault(BusFault.NOT_SENT, 0, f"{self._host.refused} frames")
        elif len(silent) == len(self.motors):  # E-stop, power or cable, by what the safety module answers
            mode = self._host.ask(BusNode.SAFETY_MODULE, "MODE", 1)
            if mode is None:
                self._fault(BusFault.NO_POWER)
            else:
                self._fault(BusFault.ESTOP if mode == SafetyMode.ESTOP else BusFault.ALL_SILENT)
        elif silent[0].has_jumped:
            self._fault(BusFault.JUMP, silent[0].node)
        else:
            is_reset = self._host.ask(silent[0].node, "STAT", 1) == 0
            self._fault(BusFault.RESET if is_reset else BusFault.NO_REPLY, silent[0].node)

    def _stray(self, fault: BusFault, node: int = 0) -> None:
        """Count a frame that nobody may send; more than some are a fault."""
        self._strays[fault] += 1
        if self._strays[fault] % BUS.stray == 0:
            self._fault(fault, node)

    def _fault(self, fault: BusFault, node: int = 0, detail: str = "") -> None:
        if fault in (BusFault.ESTOP, BusFault.SAFETY_IDLE) and (lit := Pendant.of(self._pendant).faults):
            detail = f", fault of the {' and '.join(lit)}"
        self.trouble = self.trouble or Trouble(fault, node, detail)
        self.stop()
