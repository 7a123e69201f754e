"""Numbers that are advised, to three digits, on the side that is accepted."""

import math


def rounded_down(value: float) -> float:
    """A value to three digits and never above it, so that a value that is named as allowed is accepted."""
    if not value:
        return 0.0
    digit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return math.floor(value / digit) * digit


def rounded_up(value: float) -> float:
    """A value to three digits and never below it, so that a value that is named as the least allowed is accepted."""
    digit = 10.0 ** (math.floor(math.log10(value)) - 2) if value else 1.0
    return math.ceil(value / digit) * digit
