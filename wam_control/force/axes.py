"""What is commanded, as the axes of one problem.

A force command is a task with one force axis, joint torques are a task with one axis for each joint, and a posture
alone is a task without axes.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_control.force.force_axis import UNTURNED, Angles, ForceAxes, ForceAxis, ForcePlace
from wam_control.force.task import TaskAxis, TaskCommand
from wam_control.force.thresholds import FORCE
from wam_description.rigid_body import Array, RigidBody
from wam_description.signals import BASE


class CommandedAxis(NamedTuple):
    """One commanded axis in one pose of the arm.

    Attributes
    ----------
    of : what is commanded.
    along : velocity along it per joint velocity, and torque on the joints per force (n,), m or 1.
    direction, in_frame : towards what is touched, in the base frame and in that of the command (3,); zeros of a joint.
    desired : size of the force, N; torque of a joint, N m; 0 for a motion.
    at : position along it, m or rad.
    jacobian : of the point of a motion (3, n); None of others.
    sensed, place : how its force is measured, and where it acts; None for a motion or a joint.
    """

    of: TaskAxis
    along: Array
    direction: Array
    in_frame: Array
    desired: float
    at: float
    sensed: ForceAxis | None = None
    place: ForcePlace | None = None
    jacobian: Array | None = None

    @property
    def is_force(self) -> bool:
        """Whether a force or a torque is commanded along it."""
        return self.of.is_force

    @property
    def is_joint(self) -> bool:
        """Whether it is a joint."""
        return self.of.is_joint

    @property
    def side(self) -> float:
        """1, or -1 where it is pressed against the direction that is written."""
        return -1.0 if float(self.in_frame @ np.array(self.of.direction)) < 0.0 else 1.0

    def force(self, external: Array) -> float:
        """Force of the arm on the world along it, N or N m, from torques of the world on the joints (n,), N m."""
        return -float((self.along if self.sensed is None else self.sensed.sense).dot(external))


# an axis on each link that may be touched, with the probability of that, the largest first
Links = list[tuple[float, CommandedAxis]]


class TaskAxes:
    """Makes the commanded axes of tasks, for one arm.

    Parameters
    ----------
    body : its kinematics and dynamics.
    forces : how forces are sensed.
    """

    def __init__(self, body: RigidBody, forces: ForceAxes) -> None:
        self._body, self.forces = body, forces

    def of(
        self, q: Angles, task: TaskCommand, places: Sequence[ForcePlace], sides: Sequence[float]
    ) -> list[CommandedAxis]:
        """The axes of a task; the force along each is measured with those of the others as unknowns.

        Parameters
        ----------
        q : joint angles (n,), rad.
        task : what is commanded.
        places : where each axis acts.
        sides : 1 or -1, where along its direction each impedance touches; 1 for others.
        """
        rotation = self.rotation(q, task.frame)
        in_frame = [
            (-side if axis.is_force and (axis.value or 0.0) < 0.0 else side) * np.array(axis.direction)
            for axis, side in zip(task.axes, sides, strict=True)
        ]
        directions = [rotation.dot(along) for along in in_frame]
        each = zip(task.axes, places, directions, strict=True)
        torques = [[] if len(places) == 1 else self._disturbance(q, *one) for one in each]
        return [self._axis(q, i, task.axes, in_frame[i], directions[i], torques, places[i]) for i in range(len(places))]

    def rotation(self, q: Angles, frame: str) -> Array:
        """Rotation (3, 3) of the frame of a command into the base frame."""
        return UNTURNED if frame == BASE else self._body.cover_pose(q, frame).rotation

    def _disturbance(self, q: Angles, axis: TaskAxis, place: ForcePlace, direction: Array) -> list[Array]:
        """Torques (n,), N m, by which a force along an axis disturbs the others; a hand has no friction."""
        if axis.is_joint or not axis.is_sensed:
            return []
        if not axis.is_force:
            return [FORCE.hand * self.forces.lever(q, place.cover, place.position, direction)]
        return self.forces.disturbance(q, place, direction, _size(axis))

    def _axis(
        self,
        q: Angles,
        i: int,
        axes: Sequence[TaskAxis],
        in_frame: Array,
        direction: Array,
        torques: Sequence[list[Array]],
        place: ForcePlace,
    ) -> CommandedAxis:
        axis = axes[i]
        if axis.is_joint:
            desired = (axis.value or 0.0) if axis.is_force else 0.0
            return CommandedAxis(axis, np.eye(len(q))[axis.joint], direction, in_frame, desired, float(q[axis.joint]))
        point = np.array(self.forces.covers.on_axis(place.cover, place.position))
        at = float(direction.dot(self._body.point(q, place.cover, point)))
        if not axis.is_sensed:
            jacobian = self._body.point_jacobian(q, place.cover, point)
            along: Array = direction.dot(jacobian)
            return CommandedAxis(axis, along, direction, in_frame, 0.0, at, jacobian=jacobian)
        others: list[Array] = []
        for k, each in enumerate(torques):
            # two axes at one position are parts of one force, whose friction is that of `sensed` already
            is_same = (axes[k].cover, axes[k].position) == (axis.cover, axis.position)
            others += [] if k == i else each[:1] if is_same else each
        sensed = self.forces.axis(q, place, direction, _size(axis), others)
        desired = _size(axis) if axis.is_force else 0.0
        return CommandedAxis(axis, sensed.lever, direction, in_frame, desired, at, sensed, place)


def _size(axis: TaskAxis) -> float:
    """Size of the force along an axis, N, as an unknown of the others."""
    return abs(axis.value or 0.0) if axis.is_force else FORCE.hand
