"""What is known in one period of the forces of a command: as they are, as they will be, and on which link."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_control.force.axes import CommandedAxis, Links
from wam_control.force.belief import Belief, WorldTorques, belief
from wam_control.force.command_run import CommandRun
from wam_control.force.contact_place import STEEPEST
from wam_control.force.force_axis import Angles, ForceAxes
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.thresholds import FORCE
from wam_description.signals import Contact


class Knowledge(NamedTuple):
    """What is known in one period of the forces of a command.

    Attributes
    ----------
    run : of the command.
    torques : of the world on the joints.
    forces : how forces are sensed.
    own : parameters of the force loop.
    """

    run: CommandRun
    torques: WorldTorques
    forces: ForceAxes
    own: ForceLoopParameters

    def among(self, q: Angles, axes: Sequence[CommandedAxis], contact: Contact) -> Links:
        """The same axis on each link that may be touched, with the probability of that, the largest first.

        The probability is that of any contact there; less where no force that presses as commanded explains torques.
        """
        able = [axis for axis in axes if axis.sensed and axis.sensed.force_sd < math.inf]
        if len(able) < 2:
            return [(1.0, (able or axes)[0])]
        torques, logs = self.torques.now, []
        for axis in able:
            assert axis.place is not None
            there = self.forces.axis(q, axis.place, axis.direction, axis.force(torques))
            chance = contact.probability
            if axis.place.cover != contact.cover:
                chance = (1.0 - chance) / (len(axes) - 1)
            logs.append(math.log(max(FORCE.negligible, chance)) - 0.5 * there.unexplained(torques))
        chances = np.exp(np.array(logs) - max(logs))
        return sorted(zip((chances / chances.sum()).tolist(), able, strict=True), key=lambda one: -one[0])

    def of(self, q: Angles, on_links: Links) -> Belief:
        """What is known of a force in a pose (n,), rad: on one of several links, its variance is that of a mixture."""
        (probability, axis), *others = on_links
        known = self._whole(q, axis)
        variance = probability * known.errors.place**2
        for chance, other in others:
            there = self._as_placed(other)
            # a harder press shows which link it is
            apart = there.force - known.force if known.force >= axis.desired - known.tolerance else 0.0
            variance += chance * (there.sd**2 + probability * apart**2)
        return known._replace(errors=known.errors._replace(place=math.sqrt(variance)))

    def _whole(self, q: Angles, axis: CommandedAxis) -> Belief:
        """What is known of a force, with the errors that the whole commanded force will have."""
        known, place = self._as_placed(axis), axis.place
        if place is None or place.is_pinned or place.is_touched or not axis.desired:
            return known
        if known.force >= axis.desired - known.tolerance:
            return known
        if abs(float(axis.direction.dot(self.forces.link_axis(q, place.cover)))) > STEEPEST:
            return known  # nor will it be known
        # all but what no torque shows will be known, and the better the harder the arm presses
        sd = place.position_sd * max(known.force / axis.desired, 0.0) if place.is_known else 0.0
        place = place._replace(position_sd=max(sd, self.own.contact_position_sd))
        touched = axis._replace(sensed=self.forces.axis(q, place, axis.direction, axis.desired))
        return known._replace(errors=self._as_placed(touched).errors)

    def _as_placed(self, axis: CommandedAxis) -> Belief:
        """What is known of a force whose place is known as well as the axis has it."""
        own, run, torques, size = self.own, self.run, self.torques, abs(axis.desired)
        if axis.is_joint:  # the torques of the joints are one vector
            size = math.hypot(*(one.now.desired for one in run.axes if one.now.is_joint))
        if own.is_estimated and axis.sensed is not None and not run.is_touching:
            # it will press at rest: on the way there, the friction of the moving motors is less certain
            pressed = own.sensing_fed_back.torque_fraction * axis.desired * axis.sensed.press
            torques = torques._replace(sd=np.hypot(run.still_sd, pressed))
        return belief(axis, size, torques, own, run.is_touching, run.resting, run.shaking.swing(axis, own))
