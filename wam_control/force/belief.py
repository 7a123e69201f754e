"""What is known of a force, and by how much the true one will be off: one number decides.

The predicted error e of the true force has independent parts, in N: torques and masses, friction of the surface, the
position of the contact, torques that were there before the touch, a surface that moves ahead of the loop, and an arm
that shakes.  Its size per tolerated error is the doubt of a command.
"""

import math
from typing import Final, NamedTuple

from wam_control.force.axes import CommandedAxis
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.limits import approach_speed, yielding
from wam_control.force.thresholds import FORCE
from wam_description.rigid_body import Array


class Errors(NamedTuple):
    """Predicted error of a true force by its causes, N; infinite where a cause forbids the force."""

    torques: float = 0.0
    friction: float = 0.0
    place: float = 0.0
    resting: float = 0.0
    moving_surface: float = 0.0
    slow_arm: float = 0.0
    shaking_arm: float = 0.0

    @property
    def size(self) -> float:
        """Root of the sum of squares, N."""
        return math.hypot(*self)

    @property
    def cause(self) -> str:
        """Name of the largest part."""
        return self._fields[self.index(max(self))]


class Belief(NamedTuple):
    """What is known of one force in one period.

    Attributes
    ----------
    force, before : measured now and a period ago, N.
    sd : of the measured force, N.
    chi2 : of the torques that the force does not explain.
    errors : predicted.
    tolerance : of the force, N.
    """

    force: float
    before: float
    sd: float
    chi2: float
    errors: Errors
    tolerance: float

    @property
    def doubt(self) -> float:
        """Predicted error per tolerated error."""
        return self.errors.size / self.tolerance if self.tolerance else math.inf


UNKNOWN: Final = Belief(0.0, 0.0, math.inf, 0.0, Errors(torques=math.inf), 0.0)


class WorldTorques(NamedTuple):
    """Torques of the world on the joints, and what is known of them.

    Attributes
    ----------
    now, before : filtered (n,), N m, in this period and the one before.
    acceleration : of the joints (n,), rad/s^2, where sensors measure the torques of the links' motion, too; else None.
    sd : of each (n,), N m.
    """

    now: Array
    before: Array
    acceleration: Array | None
    sd: Array


def predicted(
    axis: CommandedAxis, torque_sd: Array, own: ForceLoopParameters, resting: float = 0.0, shaking: float = 0.0
) -> Errors:
    """Predicted error of a force.

    Parameters
    ----------
    axis : of the force.
    torque_sd : of the torques (n,), N m.
    own : parameters of the force loop.
    resting : force, N, that torques at rest look like, and nothing touched gives.
    shaking : swing of the force, N peak to peak, as the arm shakes on the stiffest surface.
    """
    sensed = axis.sensed
    if sensed is None or sensed.force_sd == math.inf:
        return Errors(torques=math.inf)
    limits, soft = own.limits, yielding(sensed, own)
    pace = max(max(own.force_gain) * sensed.speed_fraction, FORCE.negligible)
    slope = FORCE.friction_turn * FORCE.surface_slope * limits.slide_speed / soft
    free, touching = (sensed.speed_fraction * approach_speed(axis, is_touching, own) for is_touching in (False, True))
    is_slow = FORCE.settled * soft / pace > limits.settling_time or free < FORCE.creep / limits.settling_time
    return Errors(
        torques=sensed.error(torque_sd),
        friction=sensed.friction_sd,
        place=sensed.place_sd,
        resting=abs(resting),
        moving_surface=math.inf if touching < limits.surface_speed else limits.surface_speed / pace + slope,
        slow_arm=math.inf if is_slow else 0.0,
        shaking_arm=limits.tolerance * shaking,  # a swing by the whole force is all that is tolerated
    )


def belief(
    axis: CommandedAxis,
    size: float,
    torques: WorldTorques,
    own: ForceLoopParameters,
    is_touching: bool,
    resting: Array,
    shaking: float,
) -> Belief:
    """The belief of one force axis.

    Parameters
    ----------
    axis : of the force.
    size : of the command, N: of the force, or of the torques of all joints together, N m.
    torques : of the world on the joints.
    own : parameters of the force loop.
    is_touching : whether something is touched: until then, what sensors measure of the arm's own motion is no force.
    resting : torques at rest before (n,), N m, that no touched surface gives.
    shaking : as `predicted` has it.
    """
    sensed, chi2 = axis.sensed, 0.0
    force, before = axis.force(torques.now), axis.force(torques.before)
    if sensed is None:
        sd = float(torques.sd[axis.of.joint])
        errors = Errors(torques=sd, resting=abs(float(resting[axis.of.joint])))
    else:
        if torques.acceleration is not None and not is_touching:
            # the acceleration is the mean of a period
            force = before = 0.5 * (force + before) - float(sensed.carried.dot(torques.acceleration))
        errors = predicted(axis, torques.sd, own, float(sensed.sense.dot(resting)), shaking)
        sd = math.hypot(errors.torques, errors.friction, errors.place)
        if axis.desired and sd < math.inf:  # friction and position are known per force
            chi2 = sensed.unexplained(torques.now) / max(1.0, force / axis.desired) ** 2
    return Belief(force, before, sd, chi2, errors, own.limits.tolerance * size)
