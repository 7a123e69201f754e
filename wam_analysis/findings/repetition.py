"""Limit cycles of joints and wrench axes in windows of a recording, or cycles that were commanded; their spectrum."""

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from wam_analysis.findings.finding import Finding, Section, shown
from wam_analysis.foreign.pieces import Piece, pieces, rests
from wam_analysis.foreign.source import Source, Treatment
from wam_analysis.held_messages import row_at
from wam_analysis.measures.episodes import Episode, episodes, without_drift
from wam_analysis.measures.limit_cycle import limit_cycle, size_of_cycle
from wam_analysis.measures.lines import spectral_lines
from wam_analysis.measures.runs import count, median_step
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import CYCLE, SHAFT, STREAM
from wam_bag.arrays import Numbers

LEAST = {"rad": 1e-4, "m": 1e-5, "rad/s": 1e-3, "m/s": 1e-4, "N m": 1e-3, "N": 1e-2, "A": 1e-3}  # peak to peak

COMMANDED_CYCLE, LIMIT_CYCLE, UNKNOWN = "commanded", "limit cycle", "not known whether commanded"
HARMONIC = "near a multiple of the commanded frequency"
ORIGINS = {  # in words
    LIMIT_CYCLE: "a limit cycle: it was not commanded",
    HARMONIC: f"{HARMONIC}: a limit cycle, or the commanded motion, which is not followed linearly",
    UNKNOWN: "its command is not known: give its topic with --command, or in a CSV file name its column "
    "command.position.JOINT",
    COMMANDED_CYCLE: "repeats at the commanded frequency",
}


class FoundCycle(NamedTuple):
    """A cycle: from where it comes, and the standard error of its size where what was commanded was taken off."""

    episode: Episode
    origin: str
    error: float = math.nan


def repetition_section(recording: AnalysedRecording) -> Section:
    """What repeats, and whether it was commanded."""
    findings, cycling, taken = list[Finding](), defaultdict[str, list[tuple[float, str, str]]](list), set[str]()
    alike: dict[str, list[str]] = {origin: [] for origin in ORIGINS}
    for one, quantity, label in traced(recording.states):
        unit, command = one.units[quantity], recording.command_of(one)
        own = None if command is None else command.only(quantity if quantity in command.values else "velocity")
        for piece in pieces(one, quantity):
            least = max(CYCLE.loud * piece.noise[quantity], LEAST[unit])
            for (begin, end, cycle), origin, error in _of_piece(piece, quantity, own, least):
                if cycle.alternates and any(each.what is Treatment.BETWEEN for each in one.treated):
                    continue  # as a motion does whose messages are evenly placed, but were not sent so
                name = label if label not in taken else f"{label} from {begin:.1f} s"
                taken.add(name)
                change = 100.0 * (cycle.growth - 1.0)
                is_steady = CYCLE.changing < cycle.growth < 1.0 / CYCLE.changing
                changes = f" (changes by {change:+.0f} % from half to half)" * (not is_steady)
                alike[origin].append(name + changes)
                frequency = 1.0 / cycle.period
                if origin in (LIMIT_CYCLE, UNKNOWN):
                    at, wide = shown(frequency, "Hz"), shown(cycle.peak_to_peak, unit)
                    text = f"{name} repeats at {at}, {wide} peak to peak"
                    if cycle.alternates:
                        at, text = "", f"{name} alternates from message to message, by {wide}"
                    text += changes + ", not commanded" * (origin == LIMIT_CYCLE)
                    cycling[at + origin].append((cycle.peak_to_peak / LEAST[unit], text, label))
                size = "from message to message" if cycle.alternates else "cycle, peak to peak"
                findings.append(Finding(f"{name}: {size}", unit, cycle.peak_to_peak, note=origin, error=error))
                if not cycle.alternates:
                    findings.append(Finding(f"{name}: frequency", "Hz", frequency, note=origin))
                findings += [
                    Finding(f"{name}: begin", "s", begin),
                    Finding(f"{name}: end", "s", end),
                    Finding(f"{name}: confidence", "", cycle.confidence),
                ]
    which = "that was not commanded" if recording.commands else "in this recording"
    sentences = [f"{', '.join(names)}: {ORIGINS[origin]}." for origin, names in alike.items() if names]
    stated = sentences or [f"Nothing {which} was found to repeat five times without a gap."]
    shows = []
    for those in cycling.values():
        others = len({label for *_, label in those}) - 1
        shows.append(f"{max(those)[1]}{f', and {others} more at this frequency' * (others > 0)}.")
    return Section("stability", "Cycles", stated, findings, shows)


def spectrum_section(recording: AnalysedRecording) -> Section:
    """The strongest lines of each joint, or of its effort at rest, and of each wrench axis, in its longest stretch."""
    findings, begins, looked = list[Finding](), list[float](), set[str]()
    efforts = (
        (one, "effort", f"{one.label} effort") for one in recording.states if "effort" in one.values and rests(one)
    )
    for one, quantity, label in (*traced(recording.states), *efforts):
        if (piece := max(pieces(one, quantity), key=lambda part: len(part.time), default=None)) is None:
            continue
        begins.append(CYCLE.episode_cycles / float(np.ptp(piece.time)))
        looked.add(quantity if one.is_joint else "force")
        unit = one.units[quantity]
        for line in spectral_lines(piece.time, piece.values[quantity], piece.stamps):
            begins.append(line.frequency)
            if 2.0 * line.amplitude > max(LEAST[unit], count(piece.recorded[quantity])):
                name = f"{label}, {shown(line.frequency, 'Hz')}"
                findings.append(Finding(f"{name}: amplitude", unit, line.amplitude))
                findings.append(Finding(f"{name}: frequency", "Hz", line.frequency))
    if not begins:
        return Section("frequency", "Spectrum", ("No stretch is long enough.",))
    least = shown(min(begins), "Hz")
    span = f"To find vibrations below {least}, record longer without a gap."
    silent = f"No clear vibration was found above {least} that lasts throughout, in {' or '.join(sorted(looked))}."
    return Section("frequency", "Spectrum", (span if findings else silent,), findings)


def traced(sources: Iterable[Source]) -> Iterator[tuple[Source, str, str]]:
    """Sources with each quantity that is looked at, and a label of both.

    Of a joint it is the first of position, velocity and effort, of a wrench each axis.  One that is in less than half
    of the messages comes last.
    """
    for one in sources:
        if one.is_joint:
            seldom = {q: 2 * np.count_nonzero(np.isfinite(v)) < len(v) for q, v in one.values.items()}
            quantities = (q for q in ("position", "velocity", "effort") if q in seldom)
            yield one, min(quantities, key=seldom.__getitem__), one.label
        else:
            yield from ((one, axis, f"{one.label} {axis}") for axis in one.values)


def _of_piece(piece: Piece, quantity: str, command: Source | None, least: float) -> list[FoundCycle]:
    """The cycles of a stretch."""
    result: list[FoundCycle] = []
    rest = None if command is None else _without_response(piece, quantity, command)
    for one in _found(piece, quantity, piece.values[quantity], least):
        frequency = _commanded_frequency(one, quantity, command)
        if frequency is None:
            result.append(FoundCycle(one, UNKNOWN))
        elif abs(frequency * one.cycle.period - 1.0) > CYCLE.same_period:
            if rest is None:
                result.append(FoundCycle(one, LIMIT_CYCLE))
        else:
            result.append(FoundCycle(one, COMMANDED_CYCLE))
    if rest is None or command is None:
        return result
    rate = 1.0 / max(median_step(command.time), STREAM.quickest) if len(command.time) > 1 else 0.0
    for one in _found(piece, quantity, rest, least):
        frequency = _commanded_frequency(one, quantity, command) or 0.0
        if min(abs(each * one.cycle.period - 1.0) for each in (frequency, rate)) <= CYCLE.same_period:
            continue  # the commanded motion itself, which it does not follow linearly, or the steps of its messages
        if quantity in command.values and one.cycle.peak_to_peak < CYCLE.commanded * _commanded_size(one, command):
            continue  # a part of it, likewise
        order = 1.0 / (one.cycle.period * frequency) if frequency > 0.0 else math.inf
        is_harmonic = order <= 0.5 + CYCLE.harmonics and abs(order - round(order)) <= CYCLE.near_harmonic
        error = (1.0 - one.cycle.confidence) * one.cycle.peak_to_peak
        result.append(FoundCycle(one, HARMONIC if is_harmonic else LIMIT_CYCLE, error))
    return result


def _found(piece: Piece, quantity: str, value: Numbers, least: float) -> Iterator[Episode]:
    """Episodes of a signal of a piece; where the stamps are irregular, their sizes are those of the recorded values."""
    for one in episodes(piece.time, value, least):
        if piece.stamps is not piece.time and not one.cycle.alternates:
            period = one.cycle.period
            first, last = (
                CYCLE.edge * period * (at not in (piece.time[0], piece.time[-1])) for at in (one.begin, one.end)
            )
            inner = (piece.stamps >= one.begin + first) & (piece.stamps <= one.end - last)
            drift = piece.values[quantity] - without_drift(piece.time, value, period)
            stamps = piece.stamps[inner]
            level = piece.recorded[quantity][inner] - np.interp(stamps, piece.time, drift)
            yield one._replace(cycle=one.cycle._replace(peak_to_peak=size_of_cycle(stamps, level, period)))
        else:
            yield one


def _without_response(piece: Piece, quantity: str, command: Source) -> Numbers | None:
    """A signal less what follows a command, or the way of a commanded velocity, linearly; None where that is still."""
    if len(command.time) < SHAFT.fewest_samples or not is_known(command, piece.time):
        return None
    (known,) = command.values
    desired = held(command, known, piece.time)
    if not np.ptp(desired) > 0.0:
        return None
    between = np.interp(piece.time, command.time, command.values[known])  # of a path that is sent in points
    paths = [one if known == quantity else np.cumsum(one) for one in (desired, between)]
    rests = [_less(piece, piece.values[quantity], one) for one in paths]
    return min(rests, key=lambda rest: float(np.sum(rest**2)))


def _less(piece: Piece, value: Numbers, desired: Numbers) -> Numbers:
    """A signal less its linear response to a command at the same times."""
    lags = np.unique(np.round(np.linspace(0.0, CYCLE.longest_lag / piece.period, CYCLE.lags)).astype(np.int64))
    late = [np.concatenate([np.full(lag, desired[0]), desired[: len(desired) - lag]]) for lag in lags.tolist()]
    columns = np.column_stack([np.ones(len(desired)), piece.time - piece.time[0], *late])
    return value - columns @ np.linalg.lstsq(columns, value, rcond=CYCLE.singular)[0]


def _commanded_frequency(one: Episode, quantity: str, command: Source | None) -> float | None:
    """Frequency of the command during an episode, Hz, 0 if it does not repeat; None if it is not known."""
    time = np.linspace(one.begin, one.end, round(40.0 * one.cycle.cycles))
    if command is None or not len(command.time) or not is_known(command, time):
        return None
    (known,) = command.values
    cycle = limit_cycle(time, held(command, known, time))
    is_small = known == quantity and cycle.peak_to_peak < CYCLE.commanded * one.cycle.peak_to_peak
    return 0.0 if cycle.confidence < 0.5 or is_small else 1.0 / cycle.period


def _commanded_size(one: Episode, command: Source) -> float:
    """Peak to peak of the part of the command with the period of an episode, in that of its halves with less of it."""
    ((known, _),) = command.values.items()
    sizes = []
    for time in np.array_split(np.linspace(one.begin, one.end, round(40.0 * one.cycle.cycles)), 2):
        sent = held(command, known, time)
        turns = np.hanning(len(time)) * (sent - np.mean(sent)) * np.exp(-2j * np.pi * time / one.cycle.period)
        sizes.append(8.0 * float(np.abs(np.mean(turns))))
    return min(sizes)


def is_known(command: Source, time: Numbers) -> bool:
    """Whether it is known what was commanded at some times.

    Of two topics that begin at once either may have the first message.
    """
    period = median_step(command.time) if len(command.time) >= SHAFT.fewest_samples else 0.0
    return bool(command.time[0] <= time[0] + STREAM.changes * period) and not np.any(command.is_away(time))


def held(command: Source, quantity: str, time: Numbers) -> Numbers:
    """The last command before each of some times, before the first one that, (n,)."""
    return command.values[quantity][row_at(command.time, time)]
