"""Why a row of the requirement is missed, and the bound that physics sets: counted in the same recordings.

Each row that can be missed has an account of its own.  Nothing in it is known before: it is what was counted.
"""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from wam_analysis.table import markdown
from wam_studies.contact_benchmark.page import bound_text
from wam_studies.contact_robustness.replay import SECOND_WITHIN, SLIDING, SURE, TouchOutcome
from wam_studies.contact_robustness.requirements import (
    COVERAGE,
    POSITIONS,
    ROUGH,
    STRONG,
    WITHIN,
    RequiredRow,
    coverage,
)
from wam_studies.contact_robustness.rows import SMALL_SD, Scores, calibration, near, outcomes
from wam_studies.identification.trial import IdentificationResult
from wam_studies.scores import quantile

SOON = 0.5  # s after a contact
NO_BOUND = "none, because {}"
OWN = "sets and probabilities are the estimator's own"


class Evidence(NamedTuple):
    """What was measured, as for `requirements.required_rows`.

    Attributes
    ----------
    wide, second, masses : scores by degradation.
    identified : scores of the realistic mix after an identification.
    identifications : of plants with every error of friction.
    bounds : rows of `bounds.bounds`, the last three for errors in free motion; none where there are none.
    reference : time of the reference workload on this computer, s.
    """

    wide: Mapping[str, Scores]
    second: Mapping[str, Scores]
    masses: Mapping[str, Scores]
    identified: Scores
    identifications: Sequence[IdentificationResult]
    bounds: Sequence[Sequence[str]]
    reference: float

    def of(self, row: RequiredRow) -> Scores:
        """The scores that a row of one degradation, or of the identified arms, is about."""
        name = row.of.removeprefix("the worst: ")
        return self.wide.get(name, self.identified)

    @property
    def every(self) -> list[TouchOutcome]:
        """Contacts in motion of all recordings, without masses."""
        return outcomes([*(score for own in self.wide.values() for score in own), *self.identified])

    def bound(self, column: int, part: int = 0) -> str:
        """A value of the rows of the bounds for the smallest and the largest errors in free motion."""
        return " to ".join(own[column].split(" / ")[part] for own in self.bounds[-3::2]) or "not computed"


Account = Callable[[RequiredRow, Evidence], tuple[str, str]]  # the bound and why


def missed_table(rows: Sequence[RequiredRow], evidence: Evidence) -> str:
    """Markdown table of the rows that are missed: the bound that physics sets, and why."""
    missed = []
    for row in filter(lambda row: row.is_missed, rows):
        bound, why = account_of(row)(row, evidence)
        missed.append([row.name, row.unit, bound_text(row.must, row.scale), row.measured[0], bound, why])
    head = ("quantity", "unit", "required", "measured", "best possible", "why, as counted")
    return markdown(head, missed) if missed else "Nothing."


def account_of(row: RequiredRow) -> Account:
    """The account of a row, by how its name begins.

    Raises
    ------
    LookupError
        for a row without one.
    """
    for begin, account in ACCOUNTS:
        if row.name.startswith(begin):
            return account
    raise LookupError(f"no reason is known for the row '{row.name}'; add it to ACCOUNTS")


def _part(hits: Sequence[bool]) -> str:
    return f"{sum(hits)} of {len(hits)}"


def _false_alarms(row: RequiredRow, evidence: Evidence) -> tuple[str, str]:
    alarms = [alarm for score in evidence.of(row) for alarm in score.alarms]
    slow = sum(alarm.slowest < SLIDING for alarm in alarms)
    soon = sum(alarm.after < SOON for alarm in alarms)
    excess = max((alarm.excess for alarm in alarms), default=math.nan)
    bound = NO_BOUND.format(f"a threshold {excess:.2g} times as high has none, at the price of detection")
    why = f"of {len(alarms)} alarms {slow} with a motor below {SLIDING:g} rad/s, {soon} within {SOON:g} s of a contact"
    return bound, why


def _fast(row: RequiredRow, evidence: Evidence) -> tuple[str, str]:
    found = [one for one in near(outcomes(evidence.identified, "outer"), 5.0) if not math.isnan(one.latency)]
    late = [one for one in found if one.latency > 0.03 + 1e-9]
    sliding = [one.latency <= 0.03 + 1e-9 for one in found if one.slowest > SLIDING]
    never = sum(math.isinf(one.latency) for one in late)
    slow = sum(one.slowest <= SLIDING for one in late)
    bound = NO_BOUND.format(f"with all motors sliding {_part(sliding)} are in time")
    return (
        bound,
        f"of {len(late)} late ones {slow} begin with a motor below {SLIDING:g} rad/s; {never} are never detected",
    )


def _position(column: int, part: int, force: float) -> Account:
    def account(row: RequiredRow, evidence: Evidence) -> tuple[str, str]:
        found = near(outcomes(evidence.identified, "outer"), force)
        beyond = [one for one in found if one.error > row.must[1]]
        elsewhere = sum(one.detected and not one.right_link for one in beyond)
        missing = sum(not one.detected for one in beyond)
        unknown = sum(one.detected and one.right_link and math.isinf(one.error) for one in beyond)
        held = sum(one.in_set for one in beyond)
        limit = f"{row.scale * row.must[1]:g} cm"
        return evidence.bound(column, part), (
            f"of {len(found)} contacts {len(beyond)} err by more than {limit}: {missing} not detected, "
            f"{elsewhere} on the other link, {unknown} without a position; the 90 % sets contain {held} of them"
        )

    return account


def _small(row: RequiredRow, evidence: Evidence) -> tuple[str, str]:
    found = outcomes(evidence.identified, "outer")
    sds = [one.position_sd for one in found if one.position_sd > 0.0]
    middle = 100.0 * quantile(sds, 0.5).value
    small = sum(one.error < SMALL_SD for one in found)
    return evidence.bound(3), (
        f"{len(sds)} of {len(found)} have a position, median sd {middle:.2g} cm; errors are "
        f"{calibration(evidence.identified)} of the sd (68 %); {small} err by less than {100.0 * SMALL_SD:g} cm"
    )


def _coverage(row: RequiredRow, evidence: Evidence) -> tuple[str, str]:
    alone = [coverage(own) for own in evidence.wide.values()]
    outside = sum(not COVERAGE[0] <= one.value <= COVERAGE[1] for one in alone)
    sure = sum(one.high < COVERAGE[0] or one.low > COVERAGE[1] for one in alone)
    side = "too long" if row.found.value > COVERAGE[1] else "too short"
    sizes = [one.set_length for one in outcomes(evidence.of(row)) if one.detected]
    bound = NO_BOUND.format(OWN)
    return bound, (
        f"its sets are {side}, median {100.0 * quantile(sizes, 0.5).value:.0f} cm, errors "
        f"{calibration(evidence.of(row))} of the sd; {outside} of {len(alone)} rows are outside, "
        f"{sure} of them by more than chance"
    )


def _rough(row: RequiredRow, evidence: Evidence) -> tuple[str, str]:
    found = [one for one in evidence.every if one.detected and abs(one.force - STRONG) <= WITHIN]
    groups = [[one.in_set for one in found if (one.friction == ROUGH) is most] for most in (True, False)]
    rough, smooth = map(_part, groups)
    return NO_BOUND.format(
        OWN
    ), f"at mu {ROUGH:g} the sets contain {rough}, at less {smooth} contacts of the same forces"


def _wrong(row: RequiredRow, evidence: Evidence) -> tuple[str, str]:
    masses = outcomes([score for own in evidence.masses.values() for score in own])
    sure = [one for one in [*evidence.every, *masses] if one.detected and one.probability > SURE]
    kinds = Counter(one.kind for one in sure if not one.right_link)
    of = Counter(one.kind for one in sure)
    counted = ", ".join(f"{count} of {of[kind]} {kind}" for kind, count in kinds.most_common())
    return NO_BOUND.format(OWN), f"wrong with p > 0.95: {counted}"


def _inner(row: RequiredRow, evidence: Evidence) -> tuple[str, str]:
    found = near([one for one in evidence.every if one.kind == "inner"], 10.0)
    hits = [one.position for one in found if one.latency <= 0.2 + 1e-9 or math.isnan(one.latency)]
    rest = [one.position for one in found if not (one.latency <= 0.2 + 1e-9 or math.isnan(one.latency))]
    middle = [100.0 * quantile(places, 0.5).value for places in (rest, hits)]
    return evidence.bound(5), (
        f"the {len(rest)} missed are {middle[0]:.0f} cm from the shoulder in the median, "
        f"the {len(hits)} detected {middle[1]:.0f} cm"
    )


def _second(row: RequiredRow, evidence: Evidence) -> tuple[str, str]:
    found = [one for own in evidence.second.values() for score in own for one in score.second]
    shares = []
    for kind in sorted({one.kind for one in found}):
        times = [one.latency for one in found if one.kind == kind]
        shares.append(f"{kind.removeprefix('second ')} {_part([time <= SECOND_WITHIN for time in times])}")
    return NO_BOUND.format("a lower threshold finds more, with more false ones"), f"reported {', '.join(shares)}"


def _changes(row: RequiredRow, evidence: Evidence) -> tuple[str, str]:
    where = {name: sum(score.changes for score in own) for name, own in evidence.second.items()}
    counted = ", ".join(f"{count} with {name}" for name, count in where.items() if count)
    return NO_BOUND.format("with a higher threshold there are fewer"), f"false ones: {counted}"


def _start(which: int) -> Account:
    def account(row: RequiredRow, evidence: Evidence) -> tuple[str, str]:
        pairs = [pair for score in evidence.identified for pair in score.started]
        missed = [pair for pair in pairs if not pair[which]]
        both = sum(not any(pair) for pair in pairs)
        bound = NO_BOUND.format("9 N and more are above what is detected where the model's errors are known")
        return bound, f"{len(missed)} of {len(pairs)} are missed, {both} of them both warm and cold"

    return account


def _friction(row: RequiredRow, evidence: Evidence) -> tuple[str, str]:
    worst = max(evidence.identifications, key=lambda result: float(np.abs(result.level).max()))
    at = int(np.abs(worst.level).argmax())
    motors = len(worst.level) // 2
    way = ("positive", "negative")[at // motors]
    bound = NO_BOUND.format("a longer recording averages; what the law leaves out is in the standard error")
    return bound, (
        f"motor {at % motors + 1} in {way} motion, seed {worst.seed}: error {100.0 * worst.level[at]:+.2g} %, "
        f"standard error {100.0 * worst.level_sd[at]:.2g} %"
    )


def _stated(row: RequiredRow, evidence: Evidence) -> tuple[str, str]:
    ratios = {result.seed: result.level / result.level_sd for result in evidence.identifications}
    counted = ", ".join(f"{seed}: {np.sqrt(np.mean(own**2)):.2g}" for seed, own in ratios.items())
    return NO_BOUND.format("the standard error is the program's own"), f"by seed {counted}"


def _update(row: RequiredRow, evidence: Evidence) -> tuple[str, str]:
    ratio = row.found.value / evidence.reference
    return NO_BOUND.format("it is the speed of this computer, at the time of the run"), (
        f"{ratio:.2g} times ten solutions of a 4 x 4 system by NumPy, which take {1e6 * evidence.reference:.0f} us here"
    )


ACCOUNTS: tuple[tuple[str, Account], ...] = (  # how the name of a row begins
    ("false alarms per minute", _false_alarms),
    ("the same, realistic mix", _false_alarms),
    ("5 N detected", _fast),
    *(
        (f"position on the outer link, moving, {force:g} N, {title}", _position(column, part, force))
        for column, (_, title, limits) in enumerate(POSITIONS, 1)
        for part, (force, *_) in enumerate(limits)
    ),
    ("contacts with a reported sd", _small),
    ("90 % set contains the truth, any", _coverage),
    ("90 % set contains the truth at 20 N", _rough),
    ("wrong link where", _wrong),
    ("inner link", _inner),
    ("second contact detected", _second),
    ("false second contacts", _changes),
    ("start in contact, warm", _start(0)),
    ("start in contact, cold", _start(1)),
    ("identified friction per motor and direction, largest", _friction),
    ("identified friction per motor and direction, error", _stated),
    ("whole update", _update),
)
