"""Slips of many friction nodes at once: `slip_arc` for arrays, beyond the Routh limit.

In the units of (5.14): time in sqrt(J_l/(k_tr + k_c)), force in F_dynamic k_c/(k_tr + k_c) of F_c.
Then a slip in the direction + obeys xi''' + 2 zeta xi'' + xi' + 2 zeta gamma xi = 0 for
xi = F_c - F_des, and the spring force minus friction is xi''.  Beyond gamma = 1 the pair of roots is
always complex and grows, so that every slip ends.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_theory.arguments import Array

_TURN = 2.0 * math.pi


class Modes(NamedTuple):
    """Roots of (5.14) for n nodes, arrays (n,): the real one, and the pair alpha +- i width."""

    real: Array
    alpha: Array
    width: Array

    @property
    def apart(self) -> Array:
        """Square of the distance from the real root to the pair."""
        return (self.real - self.alpha) ** 2 + self.width**2

    @property
    def square(self) -> Array:
        """Square of the magnitude of the pair."""
        return self.alpha**2 + self.width**2

    def of(self, which: NDArray[np.generic]) -> "Modes":
        """A selection of the nodes."""
        return Modes(self.real[which], self.alpha[which], self.width[which])


class Standstill(NamedTuple):
    """End of each slip, arrays (n,).

    `error` is xi, `acceleration` xi'' (zero or less); `pair` and `real` are the sizes of the growing
    and of the real mode at the start of the slip.
    """

    error: Array
    acceleration: Array
    pair: Array
    real: Array


def modes(gamma: Array, zeta: Array) -> Modes:
    """Roots of s^3 + 2 zeta s^2 + s + 2 zeta gamma by Cardano, polished by Newton.

    Parameters
    ----------
    gamma : (n,), above 1.
    zeta : (n,), above zero.
    """
    c2, c0 = 2.0 * zeta, 2.0 * zeta * gamma
    p = 1.0 - c2 * c2 / 3.0
    q = (2.0 * c2 * c2 / 27.0 - 1.0 / 3.0) * c2 + c0
    u = np.cbrt(np.abs(q) / 2.0 + np.sqrt(q * q / 4.0 + p**3 / 27.0))
    real = np.copysign(u - p / (3.0 * u), -q) - c2 / 3.0
    for _ in range(3):
        real = real - (((real + c2) * real + 1.0) * real + c0) / ((3.0 * real + 2.0 * c2) * real + 1.0)
    alpha = -(c2 + real) / 2.0
    return Modes(real, alpha, np.sqrt(-c0 / real - alpha * alpha))


def slip(nodes: Modes, error: Array, acceleration: Array) -> Standstill:
    """The slip in direction + from one standstill to the next.

    Parameters
    ----------
    nodes : n nodes.
    error : (n,), xi at the start.
    acceleration : (n,), xi'' at the start, zero or more.
    """
    lam, alpha, w = nodes.real, nodes.alpha, nodes.width
    real = (acceleration + nodes.square * error) / nodes.apart
    b = error - real
    c = -lam * real - alpha * b
    p = -lam * real
    q = alpha * c - w * w * b
    t = _stops(alpha - lam, w, p, q / w)
    growth, decay = np.exp(alpha * t), np.exp(lam * t)
    cos, sin = growth * np.cos(w * t), growth * np.sin(w * t) / w
    return Standstill(
        real * decay + b * cos + c * sin,
        lam * lam * real * decay + (alpha * p + q) * cos + (alpha * q - w * w * p) * sin,
        np.hypot(b, c / w),
        real,
    )


def _stops(beta: Array, width: Array, p: Array, q: Array) -> Array:
    """First time above zero at which h = -p e^(-beta t) + p cos(w t) + q sin(w t), v e^(-alpha t), is zero.

    The minima of h e^(beta t) are one turn apart, each deeper than the last.  The one before the start is not
    above zero, since v rises from there to zero: the next one is negative, and the zero lies between it and
    the preceding maximum.
    """
    size = np.hypot(p, q)
    lag = np.arctan(beta / width)
    phase = np.arctan2(q, p)
    since = np.mod(-phase - lag - math.pi, _TURN)  # phase since the last minimum
    since = np.where(since > 0.75 * _TURN, since - _TURN, since)  # from rest v can only rise: the minimum itself
    high, low = (_TURN - since) / width, (math.pi - since) / width
    middle = (low + high) / 2.0
    cosine = np.clip(p * np.exp(-beta * middle) / size, -1.0, 1.0)
    t = high - (math.pi + lag - np.arccos(cosine)) / width
    return _falling_zero((-p, size, beta, width, phase), np.where((t > low) & (t < high), t, middle), low, high)


def _falling_zero(wave: tuple[Array, Array, Array, Array, Array], t: Array, low: Array, high: Array) -> Array:
    """Zero of a e^(-beta t) + A cos(w t - phi), which falls from low to high, by Newton within the bracket."""
    for _ in range(80):
        a, size, beta, width, phase = wave
        e = a * np.exp(-beta * t)
        angle = width * t - phase
        h = e + size * np.cos(angle)
        above = h > 0.0
        low, high = np.where(above, t, low), np.where(above, high, t)
        slope = -beta * e - width * size * np.sin(angle)
        with np.errstate(divide="ignore", invalid="ignore"):
            after = t - h / slope
        after = np.where((after >= low) & (after <= high), after, (low + high) / 2.0)
        if np.all(np.abs(after - t) <= 1e-11 * t):
            return after
        t = after
    return t
