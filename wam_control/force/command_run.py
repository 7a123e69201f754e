"""The state of one command: a new object where something else is commanded."""

import math
from collections import defaultdict

import numpy as np

from wam_control.force.advice import Search
from wam_control.force.axes import CommandedAxis, Links
from wam_control.force.belief import UNKNOWN
from wam_control.force.contact_place import ContactPlace
from wam_control.force.force_axis import Angles, ForceAxes, Phasors
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.force_measurement import ForceMeasurement, LowPass
from wam_control.force.force_watch import ForceWatch, MotionWatch
from wam_control.force.task import AxisKind, TaskAxis, TaskCommand
from wam_control.force.thresholds import FORCE
from wam_control.thresholds import MOTION
from wam_description.arm import Arm, Covers, Servo, Timing
from wam_description.rigid_body import Array
from wam_description.signals import BASE


class AxisRun:
    """One axis of a command.

    Parameters
    ----------
    of : what is commanded.
    covers : of the arm.
    is_dithered : whether the motors have a dither.

    Attributes
    ----------
    on_links : probability of each link that may be touched, and the axis there, set as a period begins; the most
        probable first.
    known : what is known of its force.
    place : where its force acts.
    watch, touch : what is reported of its force, and whether it presses.
    anchor : position to hold where none is commanded, m or rad.
    wound_up : force, N, to which the velocity loops have wound up before its torque is fed forward; infinite while they
        do, NaN until the touch.
    rising : force, N, that is commanded by now: from the touch on it goes to the one that is desired.
    side : 1 or -1, on which side along it an impedance is touched.
    is_kept : whether its force is left as it is.
    """

    def __init__(self, of: TaskAxis, covers: Covers, is_dithered: bool) -> None:
        self.on_links: Links
        self.known = UNKNOWN
        self.place = ContactPlace(covers)
        self.watch = ForceWatch(is_dithered)
        self.touch = self.watch.touch
        self.anchor, self.wound_up, self.side, self.is_kept = math.nan, math.nan, 1.0, False
        self.rising = self._shown = 0.0
        self.of = of.bare

    @property
    def now(self) -> CommandedAxis:
        """The axis in the present period, on the link that is most probably touched."""
        return self.on_links[0][1]

    def expected(self, own: ForceLoopParameters, dt: float) -> float:
        """Force, N, that the measurement shows if the force is as it is commanded by now.

        The law would press too hard, if it compared a measured force that is late with a commanded one that is not.
        """
        desired = self.now.desired
        if not (own.limits.impact and self.touch.is_there) or self.is_settling(own):
            self.rising = self._shown = self.known.force if own.limits.impact else desired
            return desired
        most = max(desired, self.rising) * dt / max(FORCE.ramp * own.latency, dt)
        self.rising += min(max(desired - self.rising, -most), most)
        self._shown += (self.rising - self._shown) * dt / (FORCE.shown * own.latency + dt)
        return self._shown

    def is_settling(self, own: ForceLoopParameters) -> bool:
        """Whether the motors do not show yet with which force the arm has touched."""
        return own.is_estimated and self.touch.is_bouncing and not math.isfinite(self.wound_up)

    def goal(self, dt: float, lasting: float) -> float:
        """Position that is commanded along the axis, m or rad; of a velocity the one that it leads to by now."""
        axis = self.now
        if math.isnan(self.anchor):
            self.anchor = axis.at
        if axis.of.kind is AxisKind.VELOCITY:  # what is behind for long is forgotten
            self.anchor += axis.of.speed * dt + (axis.at - self.anchor) * dt / lasting
        elif axis.of.value is not None:
            return axis.of.value
        return self.anchor


class Shaking:
    """How a dithered arm vibrates before it moves along a force, and the force swing that follows from it.

    What shakes the free arm also shakes it on a surface of stiffness k.  With the vibration x of the free links and
    their receptance G, the swing of the force along a lever l is the sum of 2 |l.x| / |1/k + l.G l| over the harmonics
    of the dither that friction makes.  Dry friction damps the joints, the smaller harmonics half as much as the first.

    Parameters
    ----------
    timing : of the loops and the dither.
    """

    def __init__(self, timing: Timing) -> None:
        self._cycle, self._poses = timing.dither_cycle * timing.period, list[Array]()
        self._free: list[tuple[Phasors, Phasors]] | None = None

    def is_watching(self, q: Angles, forces: ForceAxes, servo: Servo, dt: float) -> bool:
        """Take a pose (n,), rad, unless there are enough; whether one was taken."""
        if not self._cycle or self._free is not None:
            return False
        self._poses.append(np.array(q))
        if len(self._poses) * dt > max(FORCE.watched_time, self._cycle):
            frequency = 2.0 * math.pi / self._cycle
            first, *others = harmonics(np.array(self._poses), frequency * dt)
            damping = forces.friction_damping(q, first, frequency)
            each = [(first, damping), *((one, 0.5 * damping) for one in others)]
            self._free = [forces.vibration(q, one[0], i * frequency, one[1], servo) for i, one in enumerate(each, 1)]
        return True

    @property
    def is_watched(self) -> bool:
        """Whether the vibration is still being watched."""
        return bool(self._poses) and self._free is None

    def swing(self, axis: CommandedAxis, own: ForceLoopParameters) -> float:
        """Swing of the force on the stiffest surface, N peak to peak."""
        if not self._free or axis.sensed is None or axis.sensed.force_sd == math.inf:
            return 0.0
        lever, yielding = axis.along, 1.0 / own.guard.contact_stiffness
        return math.fsum(
            2.0 * abs(lever.dot(x)) / abs(yielding + lever.dot(receptance).dot(lever)) for x, receptance in self._free
        )


def harmonics(values: Array, turn: float) -> list[Phasors]:
    """Complex amplitudes (n,) of drifting values (m, n), of each harmonic below half the sampling frequency.

    Parameters
    ----------
    values : one row in each period.
    turn : of the first harmonic in a period, rad.
    """
    steps = np.arange(float(len(values)))
    waves = [np.exp(1j * order * turn * steps) for order in range(1, math.ceil(math.pi / turn - MOTION.rounding))]
    shapes = np.column_stack([np.ones_like(steps), steps, *(part for one in waves for part in (one.real, -one.imag))])
    parts = np.linalg.lstsq(shapes, values)[0][2:]
    return [real + 1j * imaginary for real, imaginary in zip(parts[::2], parts[1::2], strict=True)]


class CommandRun:
    """The state of the axes that are commanded.

    Parameters
    ----------
    key : what makes a command the same as before: its type, its feedback, its frame, and the axes of a task.
    task : what is commanded; None for a posture alone.
    arm : the arm as the controller knows it.
    timing : of the loops.
    q : joint angles (n,), rad.
    resting : torques of the world on the joints (n,), N m, of the arm at rest as it begins, not taken as zero.
    still_sd : standard deviations of the torques of the world (n,), N m, as it begins, or as the arm last held.
    is_moving : whether the arm moves too fast for these to be known.

    Attributes
    ----------
    axes : one of each axis.
    held_at : joint angles (n,), rad, that the arm holds while the command is not obeyed; None while it is.
    resting : torques at rest (n,), N m, that are the error of a model, not those of a touched surface.
    approached : way of the posture along the forces to what they touch (n,), rad.
    free_at : where the arm last was free (n,), rad.
    is_moving : whether the arm still moves as it did when the command began.
    may_zero : whether it was not free and at rest then, so that its zero is older.
    delayed : speeds along the axes that are still to come, m/s or rad/s.
    motions : what is reported of the motions along the axes, or of the joints in a posture.
    friction : that is fed forward, N m at the joints (n,), filtered.
    search : for what would help a refused force; None where none is.
    """

    def __init__(
        self,
        key: tuple[object, ...],
        task: TaskCommand | None,
        arm: Arm,
        timing: Timing,
        q: Array,
        resting: Array,
        still_sd: Array,
        is_moving: bool,
    ) -> None:
        self.key = key
        self.axes = [AxisRun(axis, arm.covers, timing.dither_cycle > 0) for axis in (task.axes if task else ())]
        self.held_at: Array | None = None
        self.shaking, self.resting, self._is_decided = Shaking(timing), resting, not resting.any()
        self.approached = np.zeros_like(resting)
        self.free_at = q
        self.is_moving, self.may_zero = is_moving, False
        self.still_sd = still_sd
        self.delayed = list[list[float]]()
        self.motions = defaultdict[int, MotionWatch](MotionWatch)
        self.friction = LowPass()
        self.search: Search | None = None

    @property
    def frame(self) -> str:
        """In which it is commanded."""
        return str(self.key[2]) if self.key else BASE

    def go_on(self, before: "CommandRun", is_touched: bool) -> None:
        """Of axes that were commanded before, keep where they touch and hold, and with what they press.

        Where something is touched already, the velocity loops carry the force of the others.
        """
        for one in self.axes:
            one.wound_up = math.inf if is_touched else math.nan
            for other in before.axes:
                if (before.frame, other.of) == (self.frame, one.of):
                    one.place, one.anchor, one.wound_up = other.place, other.anchor, other.wound_up
                    one.rising, one._shown = other.rising, other._shown
                    self.friction = before.friction

    @property
    def is_touching(self) -> bool:
        """Whether something is touched by one of its forces."""
        return any(one.touch.is_there for one in self.axes)

    def judge(self, q: Angles, measurement: ForceMeasurement, forces: ForceAxes, limit: float) -> None:
        """Decide once, for the first axis, whether the torques at rest are those of a touched surface.

        Torques that a payload explains are not.  Of others, those above a limit, N m, are.
        """
        axis = self.axes[0].now
        if self._is_decided or (axis.sensed is not None and axis.sensed.force_sd == math.inf):
            return
        self._is_decided, torques = True, self.resting
        if measurement.payload(torques, float(measurement.torques.sd.max())):
            return
        force = axis.force(torques)
        if axis.place is not None and float(np.abs(torques).max()) <= limit:
            sensed = forces.axis(q, axis.place, axis.direction, abs(force))
            if force <= 0.0 or sensed.unexplained(torques) > FORCE.unexplained:
                return
        self.resting = np.zeros_like(torques)

    def move(self, moved: Array, forces: ForceAxes, q: Angles) -> None:
        """Count a motion of the joints (n,), rad: what is touched stays, and the link slides along it."""
        # another motion may lead to what is to be touched
        is_approach = all(one.now.is_force for one in self.axes)
        for one in self.axes:
            axis = one.now
            if not axis.is_force or axis.place is None or not (is_approach or one.touch.is_there):
                continue
            one.place.slide(forces.slide(q, axis.place.cover, axis.place.position, moved))
            square = float(axis.along.dot(axis.along))
            if not one.touch.is_there and square:
                self.approached = self.approached + axis.along * (float(axis.along.dot(moved)) / square)

    def fed_forward(self, holds: bool, own: ForceLoopParameters) -> Array:
        """Torque of the forces (n,), N m, besides their velocity: after the touch, where the place is known.

        The velocity loops need not wind up to it; what they have wound up to before is left out.

        Parameters
        ----------
        holds : whether the arm holds instead.
        own : parameters of the force loop.
        """
        fed = np.zeros(len(self.approached))
        for one in self.axes:
            axis = one.now
            if not holds:
                fed += own.force_feedforward * axis.desired * axis.along
            if self.is_touching and axis.is_force and axis.place is not None:
                if holds or not axis.place.is_known or one.is_settling(own):
                    one.wound_up = math.inf
                    continue
                if not math.isfinite(one.wound_up):
                    one.wound_up = one.known.force * (own.is_estimated or one.wound_up == math.inf)
                fed += ((1.0 - own.force_feedforward) * one.rising - one.wound_up) * axis.along
        return fed
