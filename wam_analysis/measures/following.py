"""How a signal follows a command that moves: by a factor, a delay and a play."""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from wam_analysis.measures.runs import median_step, noise
from wam_analysis.thresholds import CYCLE, SHAFT, STREAM
from wam_bag.arrays import Numbers

GOLDEN = (0.382, 0.618)  # parts of an interval, between which the least is looked for


class Following(NamedTuple):
    """How a signal follows its command.

    Attributes
    ----------
    rms, largest : error, in the unit of the signal.
    at : s, when it is largest.
    gain, delay : what moves of the signal is `gain` times that of the command of `delay` s before; NaN where that does
        not explain the motion, or little of the error, as where something else moved it for a while.
    offset : mean of the signal less that of this command.
    play : by which the command moves after it turned until the signal does, 0 where that does not show.
    unexplained : rms of what these leave, over that of the motion.
    """

    rms: float
    largest: float
    at: float
    gain: float
    delay: float
    offset: float
    play: float
    unexplained: float


class _Fit(NamedTuple):
    """Rest of a fit, rms, and its numbers."""

    rest: float
    delay: float
    gain: float
    offset: float


def following(time: Numbers, value: Numbers, stamps: Numbers, sent: Numbers) -> Following:
    """How a signal follows its command.

    The command is a path that is sent in points, or it is held from message to message where that fits much better.
    A signal that has a sample or so in each of these steps cannot show which.

    Parameters
    ----------
    time, value : (n,), s, rising, and the signal.
    stamps, sent : (m,), s, rising, and the command, which moves.
    """
    paths = [(stamps, sent), (np.repeat(stamps, 2)[1:], np.repeat(sent, 2)[:-1])]
    error = min((value - np.interp(time, *path) for path in paths), key=lambda one: float(one @ one))
    rms, worst = math.sqrt(np.mean(error**2)), int(np.argmax(np.abs(error)))
    largest, at = float(np.abs(error[worst])), float(time[worst])
    steps = np.sort(np.diff(stamps))
    usual = float(steps[np.searchsorted(np.cumsum(steps), 0.5 * np.sum(steps))])  # for half of the time
    shows_steps = STREAM.changes * median_step(time) < usual
    motion = float(np.std(value)) or math.inf
    fits = [best_fit(time, value, *path) for path in paths]
    is_held = shows_steps and fits[1].rest < SHAFT.much_better * fits[0].rest
    fit, (stamps, sent) = fits[is_held], paths[is_held]

    def with_play(play: float) -> _Fit:
        return best_fit(time, value, stamps, _played(sent, play))

    low, high = 0.0, 2.0 * largest / max(abs(fit.gain), 1.0)
    for _ in range(CYCLE.sections):
        plays = [low + share * (high - low) for share in GOLDEN]
        low, high = (low, plays[1]) if with_play(plays[0]) < with_play(plays[1]) else (plays[0], high)
    play = 0.5 * (low + high)
    loose = with_play(play)
    fit, play = (loose, play) if loose.rest < SHAFT.much_better * fit.rest else (fit, 0.0)
    most = math.hypot(noise(value), max(SHAFT.much_better * rms, SHAFT.late * motion))
    gain = fit.gain if fit.rest < min(SHAFT.agree * motion, most) else math.nan
    return Following(rms, largest, at, gain, fit.delay, fit.offset, play, fit.rest / motion)


def _played(path: Numbers, play: float) -> Numbers:
    """What moves a path through a play, which it begins in the middle."""
    moved, at = np.empty(len(path)), float(path[0])
    turns = [0, *(np.flatnonzero(np.diff(np.sign(np.diff(path)))) + 1).tolist(), len(path)]
    for begin, end in pairwise(turns):
        part = path[begin:end]
        moved[begin:end] = np.clip(at, part - 0.5 * play, part + 0.5 * play)
        at = float(moved[end - 1])
    return moved


def best_fit(
    time: Numbers, value: Numbers, stamps: Numbers, sent: Numbers, longest: float = CYCLE.longest_delay
) -> _Fit:
    """The fit with the delay that leaves less than those about it; where a command repeats, the shortest such.

    Nothing moves before its command.  A delay of up to four times the longest, s, is taken where no other explains it.
    """
    some = slice(None, None, math.ceil(len(time) / CYCLE.compared))
    time, value = time[some], value[some]
    span = longest * np.linspace(-1.0, 1.0, CYCLE.delays)
    fits = [_fit(time, value, stamps, sent, delay) for delay in span[CYCLE.delays // 2 - 1 :].tolist()]
    right = [one for one in fits if one.gain > 0.0] or fits
    if SHAFT.much_better * min(right).rest > min(fits).rest:
        right = fits  # its sign is the other one
    most = min(right).rest / SHAFT.better
    about = zip(right, right[1:], right[2:], strict=False)
    least = [here for before, here, after in about if here.rest <= most and here <= min(before, after)]
    best = next(iter(least), min(right))
    for finer in (0.5 * CYCLE.delays, (0.5 * CYCLE.delays) ** 2):
        near = best.delay + span / finer
        best = min(_fit(time, value, stamps, sent, delay) for delay in near.tolist())
    if best.rest < SHAFT.agree * np.std(value) or longest > CYCLE.longest_delay:
        return best
    return min(best, best_fit(time, value, stamps, sent, 4.0 * longest))


def _fit(time: Numbers, value: Numbers, stamps: Numbers, sent: Numbers, delay: float) -> _Fit:
    """The fit for one delay."""
    path = np.interp(time - delay, stamps, sent)
    middle, level = float(np.mean(path)), float(np.mean(value))
    power = float((path - middle) @ (path - middle))
    gain = float((path - middle) @ value) / power if power else 0.0
    rest = value - level - gain * (path - middle)
    return _Fit(math.sqrt(float(rest @ rest) / len(rest)), delay, gain, level - middle)
