"""What the stability guard says of a press that was recorded, at the pose and against the surface that it met."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.findings.finding import shown
from wam_analysis.recorded import RecordedParameters
from wam_control.force_loop_parameters import force_law, task_of
from wam_control.friction_verdict import Domain
from wam_control.stability_guard import LARGEST, Judgement, StabilityGuard, Touch
from wam_description.parameters import ParameterError
from wam_description.rigid_body import RigidBody

Numbers = NDArray[np.float64]


class Guarded(NamedTuple):
    """The sampled loop with its speed loops, `wam_control.sampled_loop`, as the guard judges it.

    Attributes
    ----------
    judgement : at this touch.
    surface : stiffness that it is for, N/m.
    gain : G_I along the force, m/s/N, that the judgement is for.
    share : part of the largest linearly stable gain that the guard accepts.
    """

    judgement: Judgement
    surface: float
    gain: float
    share: float


def guarded(
    recorded: RecordedParameters, q: Sequence[float], cover: str, place: float, direction: Numbers, surface: float
) -> Guarded | None:
    """Judge the recorded set of the force loop; None where the bag does not say enough.

    Parameters
    ----------
    recorded : arm, timing and gains; those of the velocity loop count before what the guard takes for them.
    q : (n,), rad.
    cover, place : where it presses, m.
    direction : (3,), of the force, in the cover's frame.
    surface : stiffness of what is pressed, N/m; NaN takes the stiffest one that the guard was told of.
    """
    arm, loop, timing, speed = recorded.arm, recorded.force_loop, recorded.timing, recorded.velocity_loop
    if arm is None or loop is None or timing is None or loop.mode != "hybrid":
        return None
    parameters = loop.guard
    if math.isfinite(surface):
        parameters = replace(parameters, contact_stiffness=surface)
    if speed is not None:
        parameters = replace(parameters, servo_proportional=speed.proportional_gain, servo_integral=speed.integral_gain)
    axis = RigidBody(arm).cover_pose(q, cover).rotation @ (direction / float(np.linalg.norm(direction)))
    x, y, z = axis.tolist()
    law = force_law(loop)
    try:
        guard = StabilityGuard(arm, timing, parameters)
    except ParameterError:
        return None
    touches = guard.touching(Touch(tuple(q), cover, place, (x, y, z)))
    if not touches or not any((*law.gain, *law.proportional_gain)):
        return None
    found = guard.judge(task_of(loop, law), touches)
    return Guarded(found, parameters.contact_stiffness, max(law.gain), parameters.share)


def sentence(found: Guarded) -> str:
    """Its verdict, and the loop that it is for."""
    judged = found.judgement
    text = f"The sampled loop with its speed loops, as the stability guard takes it, against {shown(found.surface)} N/m"
    over = f"{shown(1.0 / judged.scale)} times the largest linearly stable ones" if judged.scale else ""
    if judged.domain is Domain.I:
        more = f"more than {LARGEST:g}" if judged.scale >= LARGEST else shown(judged.scale)
        return f"{text}: domain I; the gains may be {more} times as large."
    if judged.scale >= 1.0:
        return (
            f"{text}: stable, but with gains that may be only {shown(judged.scale)} times as large, less than the "
            f"guard asks for ({shown(1.0 / found.share)})."
        )
    if not over:
        return f"{text}: NOT stable, and neither is a hundredth of the gains."
    if judged.stable_error > 0.0:
        return (
            f"{text}: domain {judged.domain}; the gains are {over}, friction holds the loop together for errors up to "
            f"{shown(judged.stable_error, 'N')}."
        )
    return f"{text}: NOT stable, domain {judged.domain}; the gains are {over}."
