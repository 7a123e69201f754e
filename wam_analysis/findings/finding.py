"""Results of an analysis: numbers with their predictions, and sentences."""

import math
from typing import NamedTuple


class Finding(NamedTuple):
    """One number.

    Attributes
    ----------
    name : what it is, with the part of the arm.
    unit : '' for a pure number.
    measured : from the recording; NaN if it could not be measured.
    predicted : by the theory for the recorded parameters; NaN if there is no prediction.
    note : qualification of either, '' if there is none.
    """

    name: str
    unit: str
    measured: float
    predicted: float = math.nan
    note: str = ""


class Section(NamedTuple):
    """One subject of an analysis.

    Attributes
    ----------
    key : short name, the same in every version of the JSON.
    title : for people.
    sentences : sentences, the most important first.
    findings : numbers.
    lacking : topics that are not in the bag and would add to the section.
    """

    key: str
    title: str
    sentences: tuple[str, ...]
    findings: tuple[Finding, ...]
    lacking: tuple[str, ...] = ()


def shown(value: float, unit: str = "") -> str:
    """A number with its unit, to three digits; '-' if it is not known."""
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return "none" if value > 0.0 else "-none"
    text = f"{value:.3g}" if 1e-3 <= abs(value) < 999.5 or value == 0.0 else f"{value:.2e}"
    text = f"{value:.0f}" if 999.5 <= abs(value) < 1e4 else text
    return f"{text} {unit}".rstrip()


def times(number: int) -> str:
    """How often, in words: 'once', '3 times', 'never'."""
    return {0: "never", 1: "once"}.get(number, f"{number} times")
