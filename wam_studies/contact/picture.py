"""The picture of contact estimation: position errors and their calibration."""

import math
from collections.abc import Sequence

import numpy as np

from wam_description.arm import Arm
from wam_studies.contact.outcomes import ContactOutcome, ContactScore
from wam_studies.contact.rows import STATED, error_of, near, on_outer_link
from wam_studies.contact.scenarios import KINDS, RANGES
from wam_studies.figures.panels import Panel, Panels, line_only, measured

BINS = 6
CENTIMETRES = 100.0


def panels_of(scores: Sequence[ContactScore], arm: Arm) -> Panels:
    """What is drawn of the scores of scenarios."""
    found = on_outer_link(scores, arm)
    return _errors(found), _deviations(found)


def _errors(found: Sequence[ContactOutcome]) -> Panel:
    lines = []
    for kind in KINDS:
        own = [one for one in found if one.kind == kind]
        medians = {force: error_of(near(own, force)).value for force in RANGES.levels}
        known = {force: CENTIMETRES * value for force, value in medians.items() if math.isfinite(value)}
        lines.append((kind, measured(list(known), list(known.values()))))
    required = [CENTIMETRES * allowed[0][1] for allowed in STATED.median.values()]
    lines.append(("required", line_only(list(STATED.median), required)))
    return Panel("position in motion, median error", "force [N]", "error [cm]", lines)


def _deviations(found: Sequence[ContactOutcome]) -> Panel:
    given = [one for one in found if one.right_link and math.isfinite(one.error) and one.position_sd > 0.0]
    sd = CENTIMETRES * np.array([one.position_sd for one in given])
    error = CENTIMETRES * np.array([one.error for one in given])
    groups = _bins(sd)
    middle = np.array([np.median(sd[group]) for group in groups])
    inner = np.array([np.quantile(error[group], 0.683) for group in groups])
    ends = np.array([0.3, 15.0])
    lines = [("68 % quantile of the error", measured(middle, inner)), ("one reported sd", line_only(ends, ends))]
    return Panel("reported standard deviation", "reported sd of the position [cm]", "error [cm]", lines, "xy")


def _bins(values: np.ndarray) -> list[np.ndarray]:
    """Places of the values in groups of equal number, from small to large; none of too few."""
    return np.array_split(np.argsort(values), BINS) if len(values) >= BINS else []
