"""When the arm has left what it pressed on."""

from collections.abc import Sequence

LEFT = 0.05  # rad, motion of a joint


def has_left(pressed_at: Sequence[float], q: Sequence[float]) -> bool:
    """Whether a joint has moved by `LEFT` from the pose (n,), rad, in which the arm pressed last."""
    return any(abs(a - b) > LEFT for a, b in zip(pressed_at, q, strict=True))
