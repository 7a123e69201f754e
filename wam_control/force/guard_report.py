"""The stability guard's report on the parameters in force, as text and numbers."""

import math
from typing import Final, NamedTuple

from wam_control.force.guard_watch import Watch
from wam_control.force.stability_guard import LARGEST, GuardAssessment, posture_of

UNKNOWN: Final = "not assessed yet: it is while a force is commanded; the margin is that of guard.posture"


class Report(NamedTuple):
    """One line, whether it is a warning, and the numbers behind it by name."""

    message: str
    is_warning: bool
    facts: dict[str, str]


def report(assessment: GuardAssessment | None, watch: Watch | None, mode: str, is_joints: bool) -> Report:
    """Report on the parameters in force.

    Parameters
    ----------
    assessment : of these parameters; None where the guard is off or nothing is fed back.
    watch : what the guard does while the arm moves.
    mode : of the guard.
    is_joints : whether joint torques are controlled, else the force along a direction.
    """
    if assessment is None or watch is None:
        return Report("ready", False, {"guard": "off" if mode == "off" else "no feedback"})
    force, length = ("N m", "rad") if is_joints else ("N", "m")
    here = min(watch.scale, assessment.scale)
    message = f"domain {assessment.domain}"
    if assessment.reason:
        message = f"not stable: {assessment.reason}"
    elif watch.factor < 1.0 and mode != "warn":
        message += f", gains scaled by {watch.factor:.3g}: the contact is stiffer here than where they were tuned"
    cycle = assessment.cycle
    facts = {
        "guard": mode,
        "domain": str(assessment.domain),
        "margin": _margin(assessment.scale),
        "margin here": _margin(here),
        "margin here, assessed": f"{posture_of(watch.assessed[0])}, when a force was last commanded"
        if watch.assessed
        else UNKNOWN,
        "gain factor": f"{1.0 if mode == 'warn' else watch.factor:.4g}",
        "worst": assessment.where,
        f"effective stiffness [{force}/{length}]": f"{assessment.stiffness:.4g}",
        f"stable error [{force}]": "any" if math.isinf(assessment.stable_error) else f"{assessment.stable_error:.4g}",
        f"limit cycle [{force}]": f"{cycle.peak_to_peak:.4g}",
        "limit cycle [s]": f"{cycle.period:.4g}",
        f"deadband that removes it [{force}]": f"{cycle.deadband:.4g}",
        "verdict": assessment.reason or "accepted",
    }
    return Report(message, bool(assessment.reason) or (watch.factor < 1.0 and mode != "warn"), facts)


def _margin(scale: float) -> str:
    """Factor by which the gains may be larger."""
    return f"more than {LARGEST:g}" if scale >= LARGEST else f"{scale:.4g}"
