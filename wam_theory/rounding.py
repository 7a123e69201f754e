"""Numbers that are advised, to three digits, on the side that is accepted."""

from decimal import ROUND_CEILING, ROUND_FLOOR, Context


def rounded_down(value: float) -> float:
    """A value to three digits and never above it, so that a value that is named as allowed is accepted."""
    return float(Context(3, ROUND_FLOOR).create_decimal(str(value)))


def rounded_up(value: float) -> float:
    """A value to three digits and never below it, so that a value that is named as the least allowed is accepted."""
    return float(Context(3, ROUND_CEILING).create_decimal(str(value)))
