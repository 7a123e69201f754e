"""What is known in one period of the forces of a command: as they are, as they will be, and on which link."""

import math
from collections.abc import Sequence

import numpy as np

from wam_control.force.axes import CommandedAxis
from wam_control.force.belief import Belief, WorldTorques, belief
from wam_control.force.command_run import CommandRun
from wam_control.force.contact_place import STEEPEST
from wam_control.force.force_axis import ForceAxes
from wam_control.force.force_loop_parameters import ForceLoopParameters, sensing_of
from wam_control.force.thresholds import FORCE
from wam_description.signals import Contact


class Knowledge:
    """What is known in one period of the forces of a command.

    Parameters
    ----------
    run : of the command.
    torques : of the world on the joints.
    forces : how forces are sensed.
    own : parameters of the force loop.
    """

    def __init__(self, run: CommandRun, torques: WorldTorques, forces: ForceAxes, own: ForceLoopParameters) -> None:
        self._run, self._torques, self._forces, self._own = run, torques, forces, own

    def of(self, q: Sequence[float], axis: CommandedAxis, contact: Contact) -> Belief:
        """What is known of the force along an axis in a pose (n,), rad, with an estimated contact."""
        return self._among_links(q, axis, self.whole(q, axis), contact)

    def whole(self, q: Sequence[float], axis: CommandedAxis) -> Belief:
        """What is known of a force, with the errors that the whole commanded force will have."""
        known, place = self._as_placed(axis), axis.place
        if place is None or place.is_pinned or known.force >= axis.desired or (place.is_touched and not place.is_known):
            return known
        if abs(float(axis.direction.dot(self._forces.link_axis(q, place.cover)))) > math.sin(STEEPEST):
            return known  # nor will it be known
        # what is touched shows where, and the better the harder it is pressed
        sd = place.position_sd * max(known.force / axis.desired, 0.0) if place.is_known else 0.0
        place = place._replace(position_sd=max(sd, self._own.contact_position_sd))
        touched = axis._replace(sensed=self._forces.axis(q, place.pressed(axis.direction, axis.desired)))
        return known._replace(errors=self._as_placed(touched).errors)

    def _as_placed(self, axis: CommandedAxis) -> Belief:
        """What is known of a force whose place is known as well as the axis has it."""
        own, run, torques, size = self._own, self._run, self._torques, abs(axis.desired)
        if axis.is_joint:  # the torques of the joints are one vector
            size = math.hypot(*(one.now.desired for one in run.axes if one.now.is_joint))
        if own.is_estimated and axis.sensed is not None and not run.is_touching:
            # it will press at rest: on the way there, the friction of the moving motors is less certain
            pressed = sensing_of(own).torque_fraction * axis.desired * axis.sensed.press
            torques = torques._replace(sd=np.hypot(run.still_sd, pressed))
        return belief(axis, size, torques, own, run.is_touching, run.resting, run.shaking.swing(axis, own))

    def _among_links(self, q: Sequence[float], axis: CommandedAxis, known: Belief, contact: Contact) -> Belief:
        """The same where it is not known which link is touched: the variance of the place is that of a mixture."""
        place, forces = axis.place, self._forces
        is_sure = not contact.cover or contact.probability >= self._own.link_probability_limit
        if place is None or place.is_pinned or place.is_known or is_sure:
            return known
        covers, place_sd, probability = forces.covers, known.errors.place, contact.probability
        for name, length in zip(covers.names, covers.length, strict=True):
            if name != place.cover:
                other = place._replace(cover=name, position=FORCE.middle * length)
                there = axis._replace(sensed=forces.axis(q, other.pressed(axis.direction, axis.desired)))
                assert there.sensed is not None
                apart = there.force(self._torques.now) - known.force
                spread = probability * known.errors.place**2 + (1.0 - probability) * there.sensed.place_sd**2
                place_sd = max(place_sd, math.sqrt(spread + probability * (1.0 - probability) * apart**2))
        return known._replace(errors=known.errors._replace(place=place_sd))
