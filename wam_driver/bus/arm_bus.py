"""The driver of the arm on its bus, one call per period, without ROS; its clock is that of the line."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress

from wam_driver.bus import frames
from wam_driver.bus.bus_fault import BusFault, StartError, Trouble
from wam_driver.bus.frames import Bit, BusGroup, BusNode, Frame, Position, Value
from wam_driver.bus.line import Line, LineError
from wam_driver.bus.safety_module import Pendant, SafetyMode
from wam_driver.bus.start_up import Nodes, Settings, StartUp, Wait
from wam_driver.thresholds import BUS


class ArmBus:
    """Motors and safety module of an arm.

    Parameters
    ----------
    line : to the bus.
    torque_constant : N m/A, (n,); the arm is commanded torques, so that it only defines what an ampere is.
    home : angles of the motors at the home pose, rad, (n,).
    period : s, between two calls of `exchange`.

    Attributes
    ----------
    position, velocity, current : of the motors, rad, rad/s, A; no current is measured: it is the commanded one.
    wait : what a person has to do, or what the start waits for.
    trouble : the first fault since `begin` or `clear`.
    counts : lost replies, frames that were not sent, and other things that are no fault if they are rare.
    """

    def __init__(self, line: Line, torque_constant: Sequence[float], home: Sequence[float], period: float) -> None:
        self._line, self._constant, self._home, self._period = line, torque_constant, home, period
        self.position, self.velocity, self.current = ([0.0] * len(home) for _ in range(3))
        self.counts: Counter[str] = Counter()
        self.begin()

    def begin(self) -> None:
        """Begin the start-up, also once more."""
        self.trouble: Trouble | None = None
        self._start = StartUp(self._line, self._home)
        self._steps: Iterator[Wait] = self._start.steps()
        self._cycle: BusCycle | None = None
        self.wait = Wait.POWER

    def clear(self) -> None:
        """Forget a fault; the start-up is repeated where controllers or their zero may be lost."""
        if self.trouble is not None and self.trouble.fault.loses_controllers:
            self.begin()
        self.trouble = None

    def confirm_home(self) -> bool:
        """A person states that the arm is at its home pose; whether that was requested."""
        self._start.is_at_home = self.wait is Wait.HOME
        return self._start.is_at_home

    @property
    def is_running(self) -> bool:
        """Whether the start-up has ended, so that positions are known."""
        return self._cycle is not None

    def go_on(self) -> None:
        """Take a step of the start-up, which may last some hundredths of a second."""
        if self.trouble is not None or self._cycle is not None:
            return
        try:
            self.wait = next(self._steps)
        except StopIteration:
            assert self._start.settings is not None
            self._cycle = BusCycle(self._line, self._start.settings, self._period, self.counts)
            self.wait = Wait.ACTIVATE
        except StartError as error:
            self.trouble = error.trouble

    def release(self) -> None:
        """Let the motors follow their torques."""
        if self._cycle is not None:
            self._cycle.release()

    def brake(self) -> None:
        """Command zero torque and let the windings brake; this arm has no brakes, it sinks."""
        self.current = [0.0] * len(self._home)
        if self._cycle is not None:
            self._cycle.brake()

    def stop(self) -> None:
        """Brake, and let the safety module go to idle where its firmware takes that from the host."""
        self.brake()
        if self._cycle is not None:
            self._cycle.idle_safety_module()

    def command(self, currents: Sequence[float]) -> None:
        """Send torques at once, A each, clipped; nothing unless the motors are released."""
        cycle = self._cycle
        if cycle is None or not cycle.is_released:
            return
        gains = cycle.settings.gain
        sent = cycle.command([i * k * gain for i, k, gain in zip(currents, self._constant, gains, strict=True)])
        self.current = [count / gain / k for count, gain, k in zip(sent, gains, self._constant, strict=True)]

    @property
    def advice(self) -> str:
        """What a person has to do, in words; '' where nothing."""
        return self.wait.value

    @property
    def fault(self) -> str:
        """The trouble, in words; '' where there is none."""
        return self.trouble.text if self.trouble else ""

    def close(self) -> None:
        """Brake, and end the connection."""
        self.brake()
        self._line.close()

    def exchange(self, periods: int = 1) -> None:
        """Ask for the positions, some periods after the last time, and take them."""
        cycle = self._cycle
        if cycle is None:
            return
        self._line.let_pass(periods * self._period, (periods - 1) * self._period)
        if self.trouble is not None and self.trouble.fault.loses_controllers:
            cycle.brake()  # until the start is repeated
            return
        cycle.exchange()
        self._turn(cycle)
        self.wait = Wait.NOTHING if cycle.safety_mode is SafetyMode.ACTIVE else Wait.ACTIVATE
        if cycle.trouble is not None:
            self.trouble, cycle.trouble = self.trouble or cycle.trouble, None
            self.stop()

    def _turn(self, cycle: "BusCycle") -> None:
        """Angles and velocities of the new positions."""
        for at, (count, steps, dt) in cycle.moved.items():
            step = math.tau / cycle.settings.counts[at]
            self.position[at] = count * step
            if dt > 0.0:
                self.velocity[at] = steps * step / dt


class BusCycle:
    """What is sent and taken in each period once the arm is started.

    Attributes
    ----------
    settings : of the arm.
    moved : by index of the motor, its counts, the counts since its last position, and the time since that, s.
    safety_mode : of the safety module.
    trouble : a fault of this period.
    is_released : whether the controllers follow torques.
    """

    def __init__(self, line: Line, settings: Settings, period: float, counts: Counter[str]) -> None:
        self._line, self.settings, self._period, self._counts = line, settings, period, counts
        self._n = len(settings.limit)
        self._zero = [0] * self._n
        self.is_released, self._was_answered = False, True
        self._missed, self._jumped, self._refused = [0] * self._n, [0] * self._n, 0
        self._strays: Counter[BusFault] = Counter()
        self._last: dict[int, tuple[int, float]] = {}
        self._poll_at, self._pendant = line.now(), 0
        self.moved: dict[int, tuple[int, int, float]] = {}
        self.safety_mode = SafetyMode.IDLE
        self.trouble: Trouble | None = None
        numbers = {name: settings.number(1, name) for name in ("P", "T", "MODE")}
        self._torque, self._mode = numbers["T"], numbers["MODE"]
        self._ask = frames.get(BusGroup.MOTORS, numbers["P"], Bit.GROUP)
        self._pendant_number = settings.number(BusNode.SAFETY_MODULE, "PEN")
        self._questions = [  # the pendant first: it states why the mode changes
            frames.get(BusNode.SAFETY_MODULE, self._pendant_number),
            frames.get(BusNode.SAFETY_MODULE, self._mode),
            frames.get(BusGroup.MOTORS, self._mode, Bit.GROUP),
        ]
        self.brake()

    def release(self) -> None:
        """Let the controllers follow their torques, which are zero first."""
        self.is_released = True
        self._send_torques(self._zero)
        self._send(frames.put(BusGroup.MOTORS, self._mode, BUS.torque_mode, Bit.GROUP))

    def brake(self) -> None:
        """Zero torque, and idle controllers."""
        self.is_released = False
        self._send_torques(self._zero)
        self._send(frames.put(BusGroup.MOTORS, self._mode, BUS.idle_mode, Bit.GROUP))

    def idle_safety_module(self) -> None:
        """Let the safety module go to idle, where its firmware takes that."""
        is_settable = self.settings.versions[BusNode.SAFETY_MODULE] >= BUS.settable_version
        if is_settable and self.safety_mode is SafetyMode.ACTIVE:
            self._send(frames.put(BusNode.SAFETY_MODULE, self._mode, SafetyMode.IDLE))

    def command(self, wanted: Sequence[float]) -> list[int]:
        """Send torques in counts, (n,), clipped; what was sent."""
        pairs = zip(wanted, self.settings.limit, strict=True)
        sent = [max(-most, min(most, round(one))) for one, most in pairs]
        self._send_torques(sent)
        return sent

    def exchange(self) -> None:
        """Ask for positions and, from time to time, modes; take what comes."""
        if self._line.now() >= self._poll_at:
            self._poll()
        self._send(self._ask)
        self._collect()
        self._judge()

    def _poll(self) -> None:
        """Ask for the modes; that there was no answer to the last questions is a fault."""
        if not self._was_answered:
            self._fault(BusFault.SAFETY_SILENT)
        self._was_answered = False
        self._poll_at = self._line.now() + BUS.poll
        for question in self._questions:
            self._send(question)

    def _collect(self) -> None:
        """Take the positions of this period, and all else that has come before them."""
        requested, patience = self._line.now(), BUS.collect * self._period
        self.moved = {}
        for _ in range(BUS.most_frames):
            if len(self.moved) == self._n:
                break
            try:
                frame = self._line.receive(patience)
            except LineError:
                self._counts["bus errors"] += 1
                break
            if frame is None:
                break
            self._take(frame, requested)

    def _take(self, frame: Frame, requested: float) -> None:
        if frame.sender == BusNode.HOST:
            self._stray(BusFault.FOREIGN, 0)
        found = frames.read(frame)
        if isinstance(found, Position) and 1 <= found.node <= self._n:
            self._take_position(found.node, found.motor, requested)
        elif isinstance(found, Value) and found.node == BusNode.SAFETY_MODULE:
            self._was_answered = True
            if found.number == self._mode and 0 <= found.value <= SafetyMode.ACTIVE:
                self._take_safety_mode(SafetyMode(found.value))
            elif found.number == self._pendant_number:
                self._pendant = found.value
        elif isinstance(found, Value) and found.number == self._mode and 1 <= found.node <= self._n:
            self._take_mode(found.node, found.value)
        elif found is None:
            self._counts["other frames"] += 1

    def _take_position(self, node: int, count: int, requested: float) -> None:
        at = node - 1
        if at in self.moved:
            self._stray(BusFault.DOUBLED, node)
            return
        before, when = self._last.get(at, (count, requested))
        if abs(count - before) > BUS.jump * self.settings.counts[at]:
            self._jumped[at] += 1
            return
        self._last[at] = count, requested
        self.moved[at] = count, count - before, requested - when

    def _take_safety_mode(self, mode: SafetyMode) -> None:
        self.safety_mode = mode
        if self.is_released and mode is not SafetyMode.ACTIVE:
            self._fault(BusFault.SAFETY_IDLE if mode is SafetyMode.IDLE else BusFault.ESTOP)

    def _take_mode(self, node: int, mode: int) -> None:
        if self.is_released and mode != BUS.torque_mode:
            self._fault(BusFault.CONTROLLER_IDLE, node, str(mode))
        elif not self.is_released and mode != BUS.idle_mode:  # as after Shift-Activate
            self.brake()

    def _judge(self) -> None:
        """Look for positions that have not come for too long, and for frames that were not sent."""
        if len(self.moved) == self._n:
            self._missed, self._jumped = [0] * self._n, [0] * self._n
            return
        self._missed = [0 if at in self.moved else missed + 1 for at, missed in enumerate(self._missed)]
        self._counts["lost replies"] += self._n - len(self.moved)
        silent = [at + 1 for at, missed in enumerate(self._missed) if missed * self._period >= BUS.silent]
        if not silent:
            return
        if self._refused:
            self._fault(BusFault.NOT_SENT, 0, f"{self._refused} frames")
        elif len(silent) == self._n:
            self._judge_silence()
        elif self._jumped[silent[0] - 1]:
            self._fault(BusFault.JUMP, silent[0])
        else:
            is_reset = self._requested(silent[0], "STAT") == 0
            self._fault(BusFault.RESET if is_reset else BusFault.NO_REPLY, silent[0])

    def _judge_silence(self) -> None:
        """No controller answers: E-stop, power or cable, by what the safety module answers."""
        mode = self._requested(BusNode.SAFETY_MODULE, "MODE")
        if mode is None:
            self._fault(BusFault.NO_POWER)
        else:
            self._fault(BusFault.ESTOP if mode == SafetyMode.ESTOP else BusFault.ALL_SILENT)

    def _requested(self, node: int, name: str) -> int | None:
        with suppress(StartError):
            nodes = Nodes(self._line)
            nodes.versions = self.settings.versions
            return nodes.ask(node, name, 1)
        return None

    def _stray(self, fault: BusFault, node: int) -> None:
        """Count a frame that nobody may send; more than some are a fault."""
        self._strays[fault] += 1
        if self._strays[fault] >= BUS.stray:
            self._strays.clear()
            self._fault(fault, node)

    def _fault(self, fault: BusFault, node: int = 0, detail: str = "") -> None:
        if self.trouble is None:
            if fault in (BusFault.ESTOP, BusFault.SAFETY_IDLE):
                lit = Pendant.of(self._pendant).faults
                detail = f", fault of the {' and '.join(lit)}" if lit else ""
            self.trouble = Trouble(fault, node, detail)
            self.brake()

    def _send_torques(self, counts: Sequence[int]) -> None:
        for group, start in zip((BusGroup.ARM, BusGroup.WRIST), range(0, self._n, 4), strict=False):
            self._send(frames.torques(group, self._torque, counts[start : start + 4]))

    def _send(self, frame: Frame) -> None:
        try:
            self._line.send(frame)
            self._refused = 0
        except LineError:
            self._refused += 1
            self._counts["frames not sent"] += 1
