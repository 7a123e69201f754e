"""Results of an analysis: numbers with their predictions, and sentences."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from wam_analysis.thresholds import LAYOUT, SHAFT
from wam_bag.arrays import Numbers


class Finding(NamedTuple):
    """One number.

    Attributes
    ----------
    name : 'subject: quantity', or the quantity alone.
    unit : '' for a pure number.
    measured : from the recording; NaN if it could not be measured.
    predicted : by the theory for the recorded parameters; NaN if there is no prediction.
    note : qualification of either, '' if there is none.
    error : standard error of `measured`; NaN if it is not known.
    is_lower_bound : whether `measured` is the least value that is possible, and no estimate.
    """

    name: str
    unit: str
    measured: float
    predicted: float = math.nan
    note: str = ""
    error: float = math.nan
    is_lower_bound: bool = False

    @property
    def subject(self) -> str:
        """The hold, motor, joint or topic; '' for none."""
        return self.name.rpartition(": ")[0]

    @property
    def quantity(self) -> str:
        """What was measured."""
        return self.name.rpartition(": ")[2]

    @property
    def title(self) -> str:
        """Of its row or column: the quantity with its unit."""
        return titled(self.quantity, self.unit)

    @property
    def bound(self) -> float:
        """Three standard errors of the deviation from the prediction; NaN where one of them is not known."""
        return SHAFT.sigmas * math.hypot(self.error, SHAFT.neglected * self.predicted)

    @property
    def deviates(self) -> bool:
        """Whether it differs from its prediction by more than that."""
        return bool(abs(self.measured - self.predicted) > self.bound)  # not with NaN


class Section(NamedTuple):
    """One subject of an analysis.

    Attributes
    ----------
    key : short name, the same in every version of the JSON.
    title : for people.
    sentences : sentences, the most important first.
    findings : numbers.
    shows, wrong : what of it belongs to the verdict, the most important first: what the recording shows, and what is
        wrong with it.
    """

    key: str
    title: str
    sentences: Sequence[str]
    findings: Sequence[Finding] = ()
    shows: Sequence[str] = ()
    wrong: Sequence[str] = ()

    @property
    def problems(self) -> list[str]:
        """What is wrong, with its reason where a sentence that begins alike has one."""
        return [next((full for full in self.sentences if full.startswith(one[:-1])), one) for one in self.wrong]


def deviations(findings: Sequence[Finding]) -> tuple[str, ...]:
    """A sentence on the numbers that differ by more than three standard errors from their predictions, or none."""
    found = [one for one in findings if one.deviates]
    if not found:
        return ()
    found.sort(key=lambda one: -abs(one.measured - one.predicted) / max(abs(one.predicted), 1e-300))
    words = [
        f"{one.name} {shown(one.measured)} +- {shown(one.error, one.unit)}, predicted {shown(one.predicted)}"
        for one in found[: LAYOUT.stated]
    ]
    more = f"; and {len(found) - len(words)} more" * (len(found) > len(words))
    return (f"More than {SHAFT.sigmas:g} standard errors from the prediction: {'; '.join(words)}{more}.",)


def shown(value: float, unit: str = "") -> str:
    """A number with its unit, to three digits; '-' if it is not known."""
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return "none"
    text = f"{value:.3g}" if 1e-3 <= abs(value) < 999.5 or value == 0.0 else f"{value:.2e}"
    text = f"{value:.0f}" if 999.5 <= abs(value) < 1e4 else text
    return f"{text} {unit}".rstrip()


def titled(quantity: str, unit: str) -> str:
    """A quantity with its unit, '' for a pure number."""
    return f"{quantity} [{unit}]" if unit else quantity


def when(at: Numbers) -> str:
    """Some times, s, in words."""
    return f"at {at[0]:.1f} s" if len(at) == 1 else f"{times(len(at))}, first at {at[0]:.1f} s"


def stated(text: str) -> str:
    """Some words as a sentence."""
    return f"{text[0].upper()}{text[1:]}."


def counted(number: int, name: str) -> str:
    """A number of things, as '1 joint' and '2 joints'."""
    return f"{number} {name}{'s' * (number != 1)}"


def times(number: int) -> str:
    """How often, in words: 'once', '3 times', 'never'."""
    return {0: "never", 1: "once"}.get(number, f"{number} times")
