"""Limit cycles of joints and wrench axes in windows of a recording, or cycles that were commanded; their spectrum."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.foreign.sources import Piece, Source, longest, pieces
from wam_analysis.measures.episodes import Episode, episodes
from wam_analysis.measures.limit_cycle import limit_cycle
from wam_analysis.measures.lines import SpectralLine, spectral_lines

Numbers = NDArray[np.float64]

LEAST = {"rad": 1e-4, "m": 1e-5, "rad/s": 1e-3, "m/s": 1e-4, "N m": 1e-3, "N": 1e-2, "A": 1e-3}  # peak to peak
LOUD = 4.0  # standard deviations of the noise: a smaller cycle is not reported
ALIKE = 0.03  # relative difference of two frequencies that are the same
COMMANDED = 0.2  # of a cycle: a command that is smaller does not cause it
HARMONICS = 20  # of a commanded motion that are taken off before another cycle is looked for
NEAR = 0.1  # of a frequency: what remains so near to the first harmonics is the command with a changing size
LINES = 3  # of a spectrum

COMMANDED_CYCLE, LIMIT_CYCLE, UNKNOWN = "commanded", "limit cycle", "not known whether commanded"


class FoundCycle(NamedTuple):
    """A cycle: of what, s, Hz, peak to peak, how sure, and `COMMANDED_CYCLE`, `LIMIT_CYCLE` or `UNKNOWN`."""

    label: str
    unit: str
    begin: float
    end: float
    frequency: float
    peak_to_peak: float
    confidence: float
    origin: str


def traced(source: Source) -> list[str]:
    """The quantities in which cycles are looked for: the first of position, velocity and effort, or each axis."""
    if not source.is_joint:
        return list(source.values)
    return [next(q for q in ("position", "velocity", "effort") if q in source.values)]


def cycles(source: Source, command: Source | None) -> list[FoundCycle]:
    """The cycles of a joint or wrench.

    Parameters
    ----------
    source : what was measured.
    command : of the same joint or wrench; None if there is none.
    """
    found = []
    for quantity in traced(source):
        label = source.label if source.is_joint else f"{source.label} {quantity}"
        unit = source.units[quantity]
        for piece in pieces(source):
            least = max(LOUD * piece.noise[quantity], LEAST.get(unit, 0.0))
            for one, origin in _of_piece(piece, quantity, command, least):
                cycle = one.cycle
                frequency = 1.0 / cycle.period
                numbers = (one.begin, one.end, frequency, cycle.peak_to_peak, cycle.confidence)
                found.append(FoundCycle(label, unit, *numbers, origin))
    return found


def _of_piece(piece: Piece, quantity: str, command: Source | None, least: float) -> list[tuple[Episode, str]]:
    result = []
    for one in episodes(piece.time, piece.values[quantity], least):
        frequency = _commanded_frequency(one, quantity, command)
        if frequency is None:
            result.append((one, UNKNOWN))
        elif abs(frequency * one.cycle.period - 1.0) > ALIKE:
            result.append((one, LIMIT_CYCLE))
        else:
            result.append((one, COMMANDED_CYCLE))
            inner = (piece.time >= one.begin) & (piece.time <= one.end)
            rest = _without(piece.time[inner], piece.values[quantity][inner], frequency)
            result += [
                (other, LIMIT_CYCLE)
                for other in episodes(piece.time[inner], rest, least)
                if abs(_order(other, frequency) - round(_order(other, frequency))) > NEAR
                or _order(other, frequency) > 0.5 + HARMONICS
            ]
    return result


def _order(one: Episode, frequency: float) -> float:
    return 1.0 / (one.cycle.period * frequency)


def _commanded_frequency(one: Episode, quantity: str, command: Source | None) -> float | None:
    """Frequency of the command during an episode, Hz, 0 if it does not repeat; None if there was no command."""
    if command is None or not len(command.time) or command.time[0] > one.begin:
        return None
    asked = quantity if quantity in command.values else next(iter(command.values))
    time = np.linspace(one.begin, one.end, max(len(one.cycle.shape), round(40.0 * one.cycle.cycles)))
    value = held(command, asked, time)
    cycle = limit_cycle(time, value)
    is_small = asked == quantity and cycle.peak_to_peak < COMMANDED * one.cycle.peak_to_peak
    return 0.0 if math.isnan(cycle.period) or cycle.confidence < 0.5 or is_small else 1.0 / cycle.period


def held(command: Source, quantity: str, time: Numbers) -> Numbers:
    """The last command before each of some times, (n,)."""
    rows = np.maximum(np.searchsorted(command.time, time, side="right") - 1, 0)
    values: Numbers = command.values[quantity][rows]
    return values


def _without(time: Numbers, value: Numbers, frequency: float) -> Numbers:
    """A signal less its mean, its drift and the harmonics of a frequency."""
    most = min(HARMONICS, int(0.5 / (frequency * float(time[1] - time[0]))) - 1)
    angles = 2.0 * np.pi * frequency * np.outer(time - time[0], np.arange(1, most + 1))
    columns = np.column_stack([np.ones(len(time)), time - time[0], np.cos(angles), np.sin(angles)])
    rest: Numbers = value - columns @ np.linalg.lstsq(columns, value, rcond=None)[0]
    return rest


def lines(source: Source) -> list[tuple[str, str, SpectralLine]]:
    """Label, unit and line: the strongest lines in the spectrum of the longest stretch without a gap."""
    piece = longest(pieces(source))
    if piece is None:
        return []
    return [
        (source.label if source.is_joint else f"{source.label} {quantity}", source.units[quantity], line)
        for quantity in traced(source)
        for line in spectral_lines(piece.time, piece.values[quantity], LINES)
        if 2.0 * line.amplitude > LEAST.get(source.units[quantity], 0.0)
    ]
