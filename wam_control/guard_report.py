"""What the stability guard says of the set in force, in words and numbers."""

import math
from typing import NamedTuple

from wam_control.guard_watch import Watch
from wam_control.stability_guard import LARGEST, Judgement


class Report(NamedTuple):
    """One line, whether it is a warning, and the numbers behind it by name."""

    message: str
    is_warning: bool
    facts: dict[str, str]


def report(judgement: Judgement | None, watch: Watch | None, mode: str, is_joints: bool) -> Report:
    """What there is to say.

    Parameters
    ----------
    judgement : of the set in force, None where nothing is judged.
    watch : what the guard does while the arm moves.
    mode : of the guard.
    is_joints : whether the joints are controlled, else the force along a direction.
    """
    if judgement is None or watch is None:
        return Report("ready", False, {"guard": "off: nothing is judged" if mode == "off" else "no feedback"})
    force, length = ("N m", "rad") if is_joints else ("N", "m")
    here = min(watch.scale, judgement.scale)
    message = f"domain {judgement.domain}"
    if judgement.reason:
        message = f"not stable: {judgement.reason}"
    elif watch.factor < 1.0 and mode != "warn":
        message += f", gains taken {watch.factor:.3g} times: the arm is stiffer where it touches now"
    cycle = judgement.cycle
    facts = {
        "guard": mode,
        "domain": str(judgement.domain),
        "margin": _margin(judgement.scale),
        "margin here": _margin(here),
        "gain factor": f"{1.0 if mode == 'warn' else watch.factor:.4g}",
        "worst": judgement.where,
        f"effective stiffness [{force}/{length}]": f"{judgement.stiffness:.4g}",
        f"stable error [{force}]": "any" if math.isinf(judgement.stable_error) else f"{judgement.stable_error:.4g}",
        f"limit cycle [{force}]": f"{cycle.peak_to_peak:.4g}",
        "limit cycle [s]": f"{cycle.period:.4g}",
        f"deadband that removes it [{force}]": f"{cycle.deadband:.4g}",
        "verdict": judgement.reason or "accepted",
    }
    return Report(message, bool(judgement.reason) or (watch.factor < 1.0 and mode != "warn"), facts)


def _margin(scale: float) -> str:
    """How much larger the gains may be."""
    return f"more than {LARGEST:g}" if scale >= LARGEST else f"{scale:.4g}"
