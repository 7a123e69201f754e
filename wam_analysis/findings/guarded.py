"""The stability guard on a recorded press, at its pose and against its surface."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wam_analysis.findings.finding import shown
from wam_analysis.recorded import PredictionParameters
from wam_analysis.thresholds import HOLD
from wam_bag.arrays import Numbers
from wam_control.force.force_loop_parameters import force_law, task_of
from wam_control.force.stability_guard import GuardAssessment, GuardedContact, StabilityGuard, posture_of
from wam_description.parameters import ParameterError
from wam_description.rigid_body import RigidBody


class Guarded(NamedTuple):
    """The guard's result for the sampled loop with its velocity loops, see `wam_control.force.sampled_loop`.

    Attributes
    ----------
    assessment : at this contact.
    surface : its stiffness, N/m.
    posture : of this contact, in words.
    """

    assessment: GuardAssessment
    surface: float
    posture: str


def guarded(
    recorded: PredictionParameters, q: Sequence[float], cover: str, position: float, direction: Numbers, surface: float
) -> Guarded | None:
    """Evaluate the recorded gains of the force loop; None if the bag has too few parameters.

    Parameters
    ----------
    recorded : arm, timing and gains.
    q : (n,), rad.
    cover, position : where it presses, m.
    direction : (3,), of the force, in the cover's frame.
    surface : stiffness of what is pressed, N/m; NaN takes that of the guard's parameters.
    """
    arm, loop, timing, servo = recorded.arm, recorded.force_loop, recorded.timing, recorded.servo
    if arm is None or loop is None or timing is None or servo is None or loop.mode != "hybrid":
        return None
    parameters = loop.guard
    if math.isfinite(surface):
        parameters = replace(parameters, contact_stiffness=surface)
    axis = RigidBody(arm).cover_pose(q, cover).rotation @ (direction / float(np.linalg.norm(direction)))
    x, y, z = axis.tolist()
    law = force_law(loop)
    try:
        guard = StabilityGuard(arm, servo, timing, parameters, loop.sensing)
    except ParameterError:
        return None
    touches = guard.with_lever(GuardedContact(tuple(q), cover, position, 0.0, (x, y, z), HOLD.typical_press))
    if not touches or not any((*law.gain, *law.proportional_gain)):
        return None
    found = guard.assess(task_of(loop), touches)
    return Guarded(
        found,
        parameters.contact_stiffness,
        posture_of(touches[0]._replace(q=tuple(np.round(q, 3)))),
    )


def sentence(found: Guarded) -> str:
    """The result as a sentence."""
    domain, scale = found.assessment.domain, found.assessment.scale
    stable = "linearly stable with up to" if scale >= 1.0 else "NOT linearly stable with more than"
    return (
        f"Stability guard (sampled loop with its velocity loops, contact of {shown(found.surface)} N/m, "
        f"{found.posture}): domain {domain}, {stable} {shown(scale)} times these gains."
    )
