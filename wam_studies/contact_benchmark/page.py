"""The result of the benchmark as text: tables, and the page of the documentation."""

import math
from collections.abc import Sequence

from wam_analysis.table import markdown
from wam_description.arm import Arm
from wam_studies.contact_benchmark.contacts import EDGE, MOVING, SETTLED, SETTLED_AT_REST, SETTLED_IN_FOAM
from wam_studies.contact_benchmark.evaluation import BenchmarkResult
from wam_studies.contact_benchmark.free_motion import SLIDING
from wam_studies.contact_benchmark.scenarios import FRICTION, MASS, PAYLOAD, STIFFNESS
from wam_studies.contact_benchmark.score import (
    ANY,
    FREE_REQUIRED,
    FREE_TARGET,
    Bound,
    Metric,
    ScenarioScore,
    further_metrics,
    required_metrics,
)
from wam_studies.scores import FEW, Interval, counted

# every seed that was looked at while the estimator, its configuration or the benchmark was changed
TUNED = (1, 2, 3, 11, 21, 22, 101, 102, 103, 201, 202, 203, 301, 302, 401, 41)
MET, TARGET_MET, MARGINAL, MISSED = "met", "**target met**", "met, marginal", "**MISSED**"
MISSED_MARGINAL, TARGET_MISSED = "**MISSED**, marginal", "target missed"


def holds(value: float, bound: Bound) -> bool:
    """Whether a value is allowed, apart from rounding."""
    low, high = bound
    return low - 1e-12 <= value <= high + 1e-12


def mark(required: Bound, target: Bound, found: Interval) -> str:
    """Comparison with the required and the target values, '' without any."""
    if required == ANY and target == ANY:
        return ""
    if math.isnan(found.value):
        return "no data"
    counts = required == (0.0, 0.0)  # a count that must be zero: the interval of a count never is
    if counts and found.observed < FREE_REQUIRED and found.value == 0.0:
        return FEW
    if math.isnan(found.low) or math.isnan(found.high):
        return FEW
    if target != ANY and holds(found.value, target) and not (counts and found.observed < FREE_TARGET):
        return TARGET_MET
    if required == ANY:
        return TARGET_MISSED
    if not holds(found.value, required):
        low, high = required
        return MISSED if counts or found.high < low or found.low > high else MISSED_MARGINAL
    clear = counts or (holds(found.low, required) and holds(found.high, required))
    return MET if clear else MARGINAL


def missed(result: BenchmarkResult, arm: Arm) -> list[str]:
    """Metrics whose required value is missed by all seeds together."""
    total = result.total
    return [
        metric.name
        for metric in required_metrics(arm)
        if mark(metric.required, metric.target, metric.of(total)) in (MISSED, MISSED_MARGINAL)
    ]


def table(result: BenchmarkResult, arm: Arm, metrics: Sequence[Metric]) -> str:
    """Metrics by row: a column for each seed, then all seeds with 95 % interval, count and mark."""
    head = [
        "quantity",
        "unit",
        "required",
        "target",
        *(f"seed {seed}" for seed in result.seeds),
        "all",
        "95 %",
        "n",
        "",
    ]
    rows = []
    for metric in metrics:
        found = metric.of(result.total)
        if found.observed == 0 and metric.required == ANY == metric.target:
            continue
        single = [number(metric.of(result.scores[seed]).value, metric.scale) for seed in result.seeds]
        span = f"{number(found.low, metric.scale)} to {number(found.high, metric.scale)}"
        bounds = [bound_text(metric.required, metric.scale), bound_text(metric.target, metric.scale)]
        value = number(found.value, metric.scale)
        assessed = counted(mark(metric.required, metric.target, found), found.observed)
        rows.append([metric.name, metric.unit, *bounds, *single, value, span, str(found.observed), assessed])
    return markdown(head, rows)


def extent(scores: Sequence[ScenarioScore]) -> str:
    """Number of scenarios and contacts, as a sentence."""
    contacts = [contact for scenario in scores for contact in scenario.contacts]
    stopped = [f"{scenario.name}: {scenario.failure}" for scenario in scores if scenario.failure]
    free = sum(scenario.contact_free.seconds for scenario in scores if scenario.contact_free.group == "free")
    text = (
        f"{len(scores)} scenarios; {len(contacts)} contacts evaluated, "
        f"{sum(scenario.excluded for scenario in scores)} too short or too hard, "
        f"{sum(scenario.not_made for scenario in scores)} planned but not made; {free:.0f} s of free motion."
    )
    return text + (f" Stopped early: {'; '.join(stopped)}." if stopped else "")


def report(result: BenchmarkResult, arm: Arm) -> str:
    """The output of the command."""
    tables = [table(result, arm, required_metrics(arm)), table(result, arm, further_metrics(arm))]
    return "\n".join([extent(result.total), "", *tables])


def number(value: float, scale: float) -> str:
    """A measured value as text; none is infinite or could not be measured."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "none"
    return f"{scale * value:.3g}"


def bound_text(bound: Bound, scale: float) -> str:
    """Allowed values as text, '' for any."""
    low, high = (f"{scale * end:.3g}" for end in bound)
    if bound == ANY:
        return ""
    if bound[0] <= 0.0:
        return high
    return f"at least {low}" if bound[1] == 1.0 else f"{low} to {high}"


def page(result: BenchmarkResult, arm: Arm, command: str, times: str, picture: str) -> str:
    """The page of the documentation.

    Parameters
    ----------
    command : that writes this page.
    times : the section on computing time.
    picture : the figure's path relative to the page.
    """
    total = result.total
    parts = [
        PREFACE.format(command=command, arm="" if arm.name == "wam" else f", {arm.name}"),
        extent(total),
        "",
        f"![Errors, calibration, latency and link identification]({picture})",
        "",
        "## Required",
        "",
        table(result, arm, required_metrics(arm)),
        "## Further results",
        "",
        table(result, arm, further_metrics(arm)),
        times,
        "",
        RULES,
    ]
    return "\n".join(parts)


PREFACE = f"""# Benchmark of contact estimation{{arm}}

Written by `{{command}}`; nothing here is written by hand.

How well the [contact estimator](estimator.md) detects, locates and measures contacts on simulated arms that are as
well known as after an identification: to decide whether its output is good enough for a purpose. The
required values come first, further results and the method after them. sd: standard deviation; mu: friction coefficient
of the contact; 90 % set: the positions that the estimator gives with 90 % probability; 95 %: confidence interval of
the value of all seeds; n: number of observations, "too few" below 20, or where no interval can show what is required.

Poses, moves, contacts and the true arm are drawn from each seed. The true arm differs from the controllers' model,
uniformly distributed: friction of each motor and joint by up to {FRICTION:.0%}, mass of each link by {MASS:.0%},
stiffness of each cable by {STIFFNESS:.0%}. In every second scenario of free motion the tool carries an unmodelled
payload of up to {1e3 * PAYLOAD:.0f} g, for which the estimator's payload range is set; in all others there is none.
The estimator is that of the configuration, with the configured masses and friction; it states the uncertainty of an
arm that was identified to this range (`IDENTIFIED` in `wam_studies/contact_benchmark/scenarios.py`). On an arm that
was not identified: [contact-robustness.md](contact-robustness.md).

The seeds of this page were chosen after the code was frozen. Seeds used for tuning:
{", ".join(map(str, TUNED))}.
"""
RULES = f"""## Method

* The truth comes from the simulator's contacts: link, force, centre of force along the link, moment. The joint torques
  follow from it by the simulator's own kinematics. Planned contacts that did not happen are not counted.
* Contacts: `push`, an exact force at a point of the link's axis; `sphere` and `flat`, hands with a soft surface that
  follow the moving link, half of them sliding over it, friction 0 to 0.5, and 0.8 for every fifth; `foam`, a fixed post
  that the arm runs into.
* The estimate is evaluated once per contact, because errors within one contact are correlated: {SETTLED:g} s after its
  start ({SETTLED_IN_FOAM:g} s in foam, which stops the arm; {SETTLED_AT_REST:g} s at rest).
* At rest, dithered: the estimate is a mean over a dither cycle, and so is the truth it is compared with, because the
  dither moves the hand back and forth on the link.
* In motion: the fastest joint is above {MOVING:g} rad/s at the start and at the evaluation of the contact; some motors
  may be at rest. Every motor slides: the slowest motor is above {SLIDING:g} rad/s.
* A contact that is missed, has no estimated position or a wrong link has an infinite position error; 'none' marks an
  infinite median.
* Latency counts from the last period without force. Torques are not evaluated within {EDGE:g} s after the start or end
  of a contact.
* A false alarm is a detection that starts without contact, from the release of the brakes on.
* The 90 % set is the estimator's own if it reports one, else the set of highest density of its hypotheses.
* 95 %: Wilson for fractions, order statistics for quantiles, bootstrap over scenarios for rms values, Poisson for
  counts. Marginal: the interval includes the limit.
"""
