"""What the force loop is given in one outer period."""

from collections.abc import Sequence
from typing import NamedTuple

from wam_control.force.task import TaskCommand
from wam_description.signals import Contact, ForceCommand, State


class ForceInput(NamedTuple):
    """What the force loop is given in one outer period; None is what nobody gives.

    Attributes
    ----------
    joints : joint state from the motors.  Where no motor gives any torque they are braked or in fault: all controller
        state is reset then.
    dt : outer period, s.
    sensors : joint-side sensors.
    contact : estimated contact, force of the world on the cover.  Without the signals that `feedback` names neither
        force nor joint torque is controlled.
    external, external_sd : estimated torques of the world on the joints (n,), N m, and their standard deviations.
    command : commanded force; None or zero leaves all axes to the posture.  Where a force ends with None, the arm
        stays where it is.
    posture : commanded joint angles (n,), rad; None holds those of the start, or those where a posture ended.
    rate : velocity at which the commanded posture moves (n,), rad/s.
    torque : commanded joint torques on the world (n,), N m: a task with an axis for each joint.
    task : takes the place of force and torque; where it ends, the arm stays where it is.
    """

    joints: State
    dt: float
    sensors: State | None = None
    contact: Contact | None = None
    external: Sequence[float] | None = None
    external_sd: Sequence[float] | None = None
    command: ForceCommand | None = None
    posture: Sequence[float] | None = None
    rate: Sequence[float] | None = None
    torque: Sequence[float] | None = None
    task: TaskCommand | None = None
