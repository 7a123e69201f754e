"""The table of the battery as text."""

import math
from collections.abc import Sequence

from wam_analysis.contact_battery.judgement import Judgement
from wam_analysis.contact_battery.scenes import FRICTION, MASS, PAYLOAD, STIFFNESS
from wam_analysis.contact_battery.score import ANY, FREE_MUST, FREE_STRETCH, Bound, Row, SceneScore, asked, stated
from wam_analysis.contact_battery.statistics import Figure
from wam_analysis.contact_battery.touches import EDGE, MOVING, SETTLED, SETTLED_AT_REST, SETTLED_IN_FOAM, SLIDING
from wam_description.arm import Arm

# every seed that anybody looked at while the estimator, its configuration or the judge was changed
TUNED = (1, 2, 3, 11, 21, 22, 101, 102, 103, 201, 202, 203, 301, 302, 401)
MET, STRETCH, MARGINAL, MISSED = "must", "**stretch**", "must, marginal", "**MISSED**"
MISSED_MARGINAL, FEW = "**MISSED**, marginal", "not enough"


def holds(value: float, bound: Bound) -> bool:
    """Whether a value is allowed, but for rounding."""
    low, high = bound
    return low - 1e-12 <= value <= high + 1e-12


def mark(row: Row, found: Figure) -> str:
    """How a row stands against what is asked, '' where nothing is."""
    if row.must == ANY and row.stretch == ANY:
        return ""
    if math.isnan(found.value):
        return "no data"
    counts = row.must == (0.0, 0.0)  # a count that must be none: its interval never is
    if counts and found.observed < FREE_MUST and found.value == 0.0:
        return FEW
    if math.isnan(found.low) or math.isnan(found.high):
        return FEW
    if row.stretch != ANY and holds(found.value, row.stretch) and not (counts and found.observed < FREE_STRETCH):
        return STRETCH
    if row.must == ANY:
        return "below the aim"
    if not holds(found.value, row.must):
        low, high = row.must
        return MISSED if counts or found.high < low or found.low > high else MISSED_MARGINAL
    clear = counts or (holds(found.low, row.must) and holds(found.high, row.must))
    return MET if clear else MARGINAL


def missed(judgement: Judgement, arm: Arm) -> list[str]:
    """Rows whose must is missed by all seeds together."""
    total = judgement.total
    return [row.name for row in asked(arm) if mark(row, row.of(total)) in (MISSED, MISSED_MARGINAL)]


def table(judgement: Judgement, arm: Arm, rows: Sequence[Row]) -> str:
    """Rows, a column a seed, all together with 95 % interval and count, and the mark."""
    head = [
        "quantity",
        "unit",
        "must",
        "stretch",
        *(f"seed {seed}" for seed in judgement.seeds),
        "all",
        "95 %",
        "n",
        "",
    ]
    lines = [head, ["---"] * len(head)]
    for row in rows:
        found = row.of(judgement.total)
        if found.observed == 0 and row.must == ANY == row.stretch:
            continue
        single = [_number(row, row.of(judgement.scores[seed]).value) for seed in judgement.seeds]
        span = f"{_number(row, found.low)} to {_number(row, found.high)}"
        asks = [_bound(row, row.must), _bound(row, row.stretch)]
        lines.append(
            [row.name, row.unit, *asks, *single, _number(row, found.value), span, str(found.observed), mark(row, found)]
        )
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def counted(scores: Sequence[SceneScore]) -> str:
    """What was played, in a sentence."""
    touches = [touch for scene in scores for touch in scene.touches]
    stopped = [f"{scene.name}: {scene.failure}" for scene in scores if scene.failure]
    text = (
        f"{len(scores)} scenes; {len(touches)} contacts judged, "
        f"{sum(scene.unfit for scene in scores)} too short or too hard, "
        f"{sum(scene.missed for scene in scores)} meant that never touched; "
        f"{sum(scene.quiet.seconds for scene in scores if scene.quiet.group == 'free'):.0f} s of free motion."
    )
    return text + (f" Stopped early: {'; '.join(stopped)}." if stopped else "")


def report(judgement: Judgement, arm: Arm) -> str:
    """What the command prints."""
    parts = [counted(judgement.total), "", table(judgement, arm, asked(arm)), table(judgement, arm, stated(arm))]
    return "\n".join(parts)


def _number(row: Row, value: float) -> str:
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "none"
    return f"{row.scale * value:.3g}"


def _bound(row: Row, bound: Bound) -> str:
    low, high = (f"{row.scale * end:.3g}" for end in bound)
    if bound == ANY:
        return ""
    if bound[0] <= 0.0:
        return high
    return f"at least {low}" if bound[1] >= 1.0 else f"{low} to {high}"


def page(judgement: Judgement, arm: Arm, command: str, compute: str, picture: str) -> str:
    """The page of the documentation.

    Parameters
    ----------
    command : what writes this page.
    compute : the part on the times.
    picture : the figure's path, seen from the page.
    """
    total = judgement.total
    parts = [
        PREFACE.format(command=command),
        counted(total),
        "",
        f"![What the battery found]({picture})",
        "",
        "## What must be met",
        "",
        table(judgement, arm, asked(arm)),
        "## What else was found",
        "",
        table(judgement, arm, stated(arm)),
        compute,
        "",
        RULES,
    ]
    return "\n".join(parts)


PREFACE = f"""# Contact estimation, judged

Written by `{{command}}`; nothing here is written by hand.

Each seed draws poses, moves, contacts and an arm. The arm differs from what its controllers know: friction of each
motor and joint by up to {FRICTION:.0%}, mass of each link by {MASS:.0%}, stiffness of each cable by {STIFFNESS:.0%},
evenly distributed. In every other scene of free motion the tool carries an unknown mass of up to
{1e3 * PAYLOAD:.0f} g, which is declared; in all others nothing is carried and nothing declared.
The estimator is that of the configuration, with the masses and the friction that the arm is configured with.

The seeds of this page were chosen after the code was frozen. Those that it was tuned with:
{", ".join(map(str, TUNED))}.
"""
RULES = f"""## How it is judged

* Truth is what the simulator's contacts say: link, force, centre of force along the link, moment. Torques on the joints
  come from it by the simulator's own kinematics. What was meant and did not touch is not counted.
* Contacts: `push`, a force at a point of the link's axis, of an exact size; `sphere` and `flat`, hands with a soft
  surface that follow the moving link, half of them sliding over it, friction 0 to 0.5, and 0.8 for every fifth; `foam`,
  a post that stands still and that the arm runs into.
* An answer is read {SETTLED:g} s after the touch, once for each contact, because samples of one contact err alike
  ({SETTLED_IN_FOAM:g} s in foam, which stops the arm; {SETTLED_AT_REST:g} s at rest).
* At rest, dithered: the estimate is a mean over a whole cycle of the dither, and so is the truth that it is held
  against; a hand that rubs on the shaking link pulls it to and fro.
* In motion: the fastest joint is above {MOVING:g} rad/s, at the touch and when the answer is read; some motors may
  rest. Every motor slides: the slowest is above {SLIDING:g} rad/s.
* A contact that is not felt, for which no place is given or whose link is wrong counts as infinitely wrong: 'none',
  where that is the median.
* Latency counts from the last period without force. Torques are not judged within {EDGE:g} s of a touch that begins or
  ends.
* A false alarm is one that begins without touch, from the release of the brakes on.
* The 90 % set is the estimator's own where it gives one, else the densest one of its hypotheses.
* 95 %: Wilson for shares, order statistics for quantiles, scenes resampled for rms, Poisson for counts. Marginal: met,
  but the interval reaches over the limit.
"""
