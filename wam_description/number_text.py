"""Numbers as messages and YAML write them."""

import math
from typing import Any


def brief(value: float, digits: int = 2) -> str:
    """A number to a few digits, without an exponent from 1e-4 to 1e10, or a sign of zero: 0.0042, 7.1, 120, 0."""
    return f"{float(f'{value:.{digits}g}') + 0.0:.10g}"


def digits_apart(value: float, other: float) -> int:
    """Number of digits with which `brief` writes two different numbers differently; at least two, at most six."""
    return next((digits for digits in range(2, 6) if brief(value, digits) != brief(other, digits)), 6)


def apart(value: float, limit: float, decimals: int = 1) -> str:
    """A number with at least so many decimals, and with more if it would be written as its limit."""
    texts = [f"{value:.{more}f}" for more in range(decimals, 6)]
    return next((text for text in texts if float(text) != limit), texts[0])


def as_number(value: Any) -> str:
    """What to write where a text in place of a number looks like one, as a clause of a refusal; '' where it does not.

    YAML 1.1 takes numbers such as 1e-3 and .5e3 for texts, and whatever is in quotes.
    """
    try:
        number = float(value) if isinstance(value, str) else math.nan
    except ValueError:
        return ""
    if not math.isfinite(number):
        return ""
    written = repr(int(number) if number.is_integer() and abs(number) < 1e15 else number)
    written = written if "." in written else written.replace("e", ".0e")
    return f"; YAML reads {value!r} as a text: write {written}"
