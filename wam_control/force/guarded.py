"""What the force loop controls, as its guard sees it: the linear part of the problem of a period."""

from collections.abc import Sequence

import numpy as np

from wam_control.force.axes import CommandedAxis
from wam_control.force.contact_place import ContactPlace
from wam_control.force.force_axis import ForceAxes
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.guard import Supervision
from wam_control.force.problem import linear
from wam_control.force.stability_guard import Guarded, GuardedContact, GuardedForces, triple
from wam_control.force.task import AxisKind, TaskAxis
from wam_control.force.thresholds import FORCE
from wam_description.signals import Contact


def guarded(
    q: Sequence[float],
    axes: Sequence[CommandedAxis],
    contact: Contact,
    forces: ForceAxes,
    own: ForceLoopParameters,
    supervision: Supervision,
) -> list[Guarded]:
    """Where the commanded axes press: at all contacts at once; nothing where nothing presses.

    Torques of joints press wherever something is: each of its contacts is considered by itself.

    Parameters
    ----------
    q : joint angles (n,), rad.
    axes : that are commanded.
    contact : estimated.
    forces : how forces are sensed.
    own : parameters of the force loop.
    supervision : its gains.
    """
    contacts = []
    for axis in axes:
        if axis.place is not None and axis.sensed is not None and axis.sensed.force_sd < np.inf:
            direction = triple(axis.direction)
            contacts.append(GuardedContact(tuple(q), *axis.place[:3], direction, axis.desired or FORCE.hand))
    if contacts:
        together = [tuple(contacts)]
    elif any(axis.is_joint and axis.is_force for axis in axes):
        places = ContactPlace(forces.covers).step(TaskAxis(AxisKind.FORCE, position=None), contact, 0.0, own)
        together = [
            (one,) for place in places for one in supervision.guard.contacts(q, *place[:3], [FORCE.sized_force])
        ]
    else:
        return []
    n = len(q)
    move, left = linear([axis.along for axis in axes], n)
    hold, sense, gain = own.posture_gain * left, np.zeros((len(axes), n)), np.zeros((2, len(axes)))
    for i, axis in enumerate(axes):
        if axis.of.is_sensed:
            sense[i] = axis.along if axis.sensed is None else axis.sensed.sense
        if axis.is_force:
            move[:, i] *= 1.0 if axis.sensed is None else axis.sensed.speed_fraction
            law = supervision.torque_law if axis.is_joint else supervision.force_law.along(axis.in_frame.tolist())
            at = max(axis.of.joint, 0)
            gain[:, i] = law.gain[at], law.proportional_gain[at]
        elif axis.of.kind is not AxisKind.VELOCITY:
            rate = own.task.largest_rate
            if axis.of.kind is AxisKind.IMPEDANCE:
                damping = own.task.damping(axis.of)
                rate, gain[0, i] = axis.of.stiffness / damping, 1.0 / damping
            hold = hold + rate * np.outer(move[:, i], axis.along)
    return [GuardedForces(each, sense, move, gain[0], gain[1], hold) for each in together]
