"""The stability guard on a recorded press, at its pose and against its surface."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.findings.finding import shown
from wam_analysis.recorded import PredictionParameters
from wam_control.force_loop_parameters import force_law, task_of
from wam_control.friction_verdict import Domain
from wam_control.stability_guard import LARGEST, GuardAssessment, GuardedContact, StabilityGuard
from wam_description.parameters import ParameterError
from wam_description.rigid_body import RigidBody

Numbers = NDArray[np.float64]
TYPICAL = 10.0  # N, of a press


class Guarded(NamedTuple):
    """The guard's result for the sampled loop with its velocity loops, see `wam_control.sampled_loop`.

    Attributes
    ----------
    assessment : at this contact.
    surface : its stiffness, N/m.
    gain : G_I along the force, m/s/N.
    fraction : of the largest linearly stable gain, up to which the guard accepts gains.
    """

    assessment: GuardAssessment
    surface: float
    gain: float
    fraction: float


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
    touches = guard.with_lever(GuardedContact(tuple(q), cover, position, 0.0, (x, y, z), TYPICAL))
    if not touches or not any((*law.gain, *law.proportional_gain)):
        return None
    found = guard.assess(task_of(loop, law), touches)
    return Guarded(found, parameters.contact_stiffness, max(law.gain), parameters.stability_fraction)


def sentence(found: Guarded) -> str:
    """The result as a sentence."""
    assessment = found.assessment
    text = f"Stability guard (sampled loop with its velocity loops, contact of {shown(found.surface)} N/m)"
    over = f"{shown(1.0 / assessment.scale)} times the largest linearly stable ones" if assessment.scale else ""
    if assessment.domain is Domain.I:
        more = f"more than {LARGEST:g}" if assessment.scale >= LARGEST else shown(assessment.scale)
        return f"{text}: domain I; the gains may be {more} times as large."
    if assessment.scale >= 1.0:
        return (
            f"{text}: stable, but the gains may be only {shown(assessment.scale)} times as large; "
            f"the guard requires {shown(1.0 / found.fraction)}."
        )
    if not over:
        return f"{text}: NOT stable, not even with a hundredth of the gains."
    if assessment.stable_error > 0.0:
        return (
            f"{text}: domain {assessment.domain}; the gains are {over}; friction keeps it stable for errors up to "
            f"{shown(assessment.stable_error, 'N')}."
        )
    return f"{text}: NOT stable, domain {assessment.domain}; the gains are {over}."
