"""Section about stick and slip."""

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from wam_analysis.findings.finding import Finding, Section, shown, times
from wam_analysis.findings.topics import in_words
from wam_analysis.foreign.pieces import Piece, pieces, resolution, rests, ways
from wam_analysis.foreign.source import Source
from wam_analysis.measures.following import best_fit
from wam_analysis.measures.runs import at_rest, count, runs, stays, summed, without_turns
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import LAYOUT, SHAFT, STREAM
from wam_bag.arrays import Mask, Numbers


def stick_section(recording: AnalysedRecording) -> Section:
    """How long each motor and joint was at rest, how often it moved; whether it sticks, or an encoder slips."""
    findings, verdict, alike = [], [], defaultdict[str, list[str]](list)
    wrong = [] if recording.is_foreign else [*_slipped(recording.states)]
    for one in recording.states:
        is_motor = not recording.is_foreign and one.topic.endswith("/motor_states")
        least = SHAFT.motor_rest if is_motor else SHAFT.joint_rest
        found = sticking(one, recording.command_of(one), least) if one.is_joint else None
        if found is None:
            continue
        position = one.only("position").values.get("position", np.zeros(1))
        if not found.begins and found.shortest and np.ptp(position) > SHAFT.joint_rest * SHAFT.way:
            far = shown(float(np.ptp(position)), one.units["position"])
            slow = f"{shown(found.slowest or least)} {one.units['position']}/s"
            alike[f"moved by {far}, more slowly than {slow}, or too briefly"].append(one.label)
            continue
        findings += [
            Finding(f"{one.label}: at rest", "%", 100.0 * found.stuck),
            Finding(f"{one.label}: motions", "", float(len(found.begins))),
        ]
        sentence = found.words
        if recording.is_foreign and found.stuck and found.begins:  # ours have the arm's time
            begins = [f"{at:.2f}" for at in found.begins[: LAYOUT.named]]
            begins += ["..."] * (len(found.begins) > LAYOUT.named)
            sentence += f" (from {', '.join(begins)} s)"
            if found.slowest:
                sentence += f"; slower than {shown(found.slowest)} {one.units['position']}/s, its noise, counts as rest"
        if found.commanded > SHAFT.disobeyed and 100.0 * found.stuck > SHAFT.turning:
            sentence += (
                f"; it sticks, is stopped or has play: {100.0 * found.commanded:.0f} % of its time at rest it was "
                "commanded to move"
            )
            verdict.append(f"{one.label}: {sentence}.")
        alike[sentence].append(one.label)
    sentences = [f"{', '.join(labels)}: {sentence}." for sentence, labels in alike.items()]
    stated = [*(sentences or ["No velocity was recorded."]), *wrong]
    return Section("stick_slip", "Stick and slip", stated, findings, verdict, wrong)


def _slipped(states: Iterable[Source]) -> Iterator[str]:
    """Where positions move otherwise than their velocities: at once, or in a second."""
    for one in states:
        moved = tuple(each for each in one.treated if each.quantity == "position")
        yield from in_words([one._replace(treated=moved)])
        if unlike := contradiction(one):
            yield f"{one.label}: {unlike}."


class Sticking(NamedTuple):
    """How a joint moved.

    Attributes
    ----------
    stuck : fraction of the time at rest.
    commanded : fraction of the rest in which it was commanded to move; NaN without a command.
    begins : when each motion began, s; a motion back and forth is one.
    shortest : rest that is counted, s; 0 where it never moved.
    slowest : speed in rad/s or m/s up to which it is at rest, where the noise hides slower motions; else 0.
    """

    stuck: float
    commanded: float
    begins: tuple[float, ...] = ()
    shortest: float = 0.0
    slowest: float = 0.0

    @property
    def words(self) -> str:
        """How much of the time it was at rest, and how often it moved."""
        if not self.begins:
            return "never moved"
        counted = f"rests shorter than {shown(self.shortest, 's')} do not count"
        if not self.stuck and len(self.begins) == 1:
            return f"always in motion ({counted})"
        return f"at rest for {100.0 * self.stuck:.0f} % of the time ({counted}), moved {times(len(self.begins))}"


def sticking(source: Source, command: Source | None, least: float) -> Sticking | None:
    """Rest and motion of a joint, which is at rest below a least speed; None without a velocity."""
    if rests(source):
        return Sticking(1.0, math.nan)
    resting = total = disobeyed = 0
    shortest = slowest = ended = 0.0
    place = math.nan  # where the last piece ended in motion
    begins: list[float] = []
    placed = source.only("position")
    positions = placed.values.get("position", np.zeros(0))
    has_velocity = "velocity" in source.values
    hidden = resolution(positions) * (SHAFT.noisy if has_velocity else SHAFT.stays)  # by noise
    moving = [q for q in ("velocity", "position") if q in source.values]
    moved = max(moving, key=lambda q: np.count_nonzero(np.isfinite(source.values[q])), default="")
    late = _delay(source, command)
    for piece in pieces(source, moved) if moved else ():
        velocity = piece.values["velocity"]
        if has_velocity:
            rest, least_rows = rest_speed(piece, least), max(1, round(SHAFT.shortest_phase / piece.period))
            still = at_rest(velocity, rest, least_rows)
        else:
            still, rest, least_rows = _staying(piece, least)
            velocity = np.where(still, 0.0, velocity)
        slowest = max(slowest, rest * (rest > least))
        total += len(still)
        shortest = max(shortest, max(least_rows, SHAFT.rest_samples) * piece.period)
        at = np.interp(piece.time, placed.time, positions) if len(positions) else None
        still = without_turns(still, velocity, rest, at, hidden, piece.period)
        if at is not None:
            still = _with_noise(still, at, SHAFT.passing * rest * piece.period, hidden)
        first = runs(~still)[:, 0]
        goes_on = at is not None and abs(at[0] - place) > rest * (piece.time[0] - ended)  # over a gap, in motion
        place, ended = math.nan if at is None or still[-1] else at[-1], piece.time[-1]
        begins += piece.time[first[first >= goes_on]].tolist()
        resting += int(np.sum(still))
        if command is not None:
            disobeyed += int(np.sum(still & (np.abs(_commanded_speed(command, piece.time - late)) > rest)))
    if not total:
        return None
    unmet = disobeyed / resting if command is not None and resting else math.nan
    return Sticking(resting / total, unmet, tuple(begins), shortest, slowest)


def _with_noise(still: Mask, position: Numbers, way: float, least: float) -> Mask:
    """The rests, (n,), with motions of the velocity alone: by less than `least`, brief ones by `way` per sample."""
    found = still.copy()
    for begin, end in runs(~still).tolist():
        moved = float(np.ptp(position[max(begin - 1, 0) : end + 1]))
        if moved < least + way * (end - begin) * (end - begin < SHAFT.window_samples):
            found[begin:end] = True
    return found


def _staying(piece: Piece, least: float) -> tuple[Mask, float, int]:
    """The rests, (n,), by positions alone, above which speed they show a motion, and over how many samples.

    Longer rests show slower motions.
    """
    reach = max(SHAFT.stays * piece.noise["position"], least * SHAFT.window)
    speed = np.percentile(np.abs(piece.values["velocity"]), 95.0)
    wait = min(max(reach / max(least, SHAFT.slow * float(speed)), SHAFT.window), SHAFT.widest_window)
    rows = max(math.ceil(wait / piece.period), SHAFT.rest_samples)
    return stays(piece.values["position"], reach, rows), max(least, reach / (rows * piece.period)), rows


def rest_speed(piece: Piece, least: float) -> float:
    """The speed up to which a joint is at rest, above the noise of its velocity."""
    return max(least, SHAFT.noisy * piece.noise["velocity"])


def _delay(source: Source, command: Source | None) -> float:
    """By how much later than its command a joint moves, s; 0 where its position was not commanded, or the same."""
    own, sent = source.known("position"), command.known("position") if command else np.zeros(0)
    if command is None or min(len(own), len(sent)) < SHAFT.fewest_samples or not np.ptp(sent):
        return 0.0
    return best_fit(source.only("position").time, own, command.only("position").time, sent).delay


def _commanded_speed(command: Source, time: Numbers) -> Numbers:
    speed, position = command.only("velocity"), command.only("position")
    if len(speed.time) >= SHAFT.fewest_samples and np.any(speed.values.get("velocity", 0.0)):
        return np.interp(time, speed.time, speed.values["velocity"], 0.0, 0.0)
    if len(position.time) < SHAFT.fewest_samples:  # it is sent once and held
        return np.zeros(len(time))
    return np.interp(time, position.time, np.gradient(position.values["position"], position.time), 0.0, 0.0)


def contradiction(source: Source) -> str:
    """How the recorded velocity is not the rate of the position, '' where the two agree."""
    if not {"position", "velocity"} <= source.values.keys():
        return ""
    factor = source.velocity_factor
    if abs(factor - 1.0) > SHAFT.agree:
        return (
            f"the recorded velocity is {factor:.3g} times the rate of the position; one of the two has another unit or "
            "sign, or is of another joint"
        )
    lost = (_lost_way(piece, source.units["position"]) for piece in pieces(source, "position", "velocity"))
    return next(filter(None, lost), "")


def _lost_way(piece: Piece, unit: str) -> str:
    """Where the position moves least as the velocity has it, and by how much each; '' where they agree.

    A velocity that is late differs only as far as it changes meanwhile; one of another scale, or of the other side of a
    play, differs alike all the time, and by less than an encoder that slips now and then.
    """
    time, velocity, period = piece.time, piece.values["velocity"], piece.period
    width = max(1, round(SHAFT.way / period))
    if len(time) <= width:
        return ""
    moved, by = ways(piece, width)
    path = period * summed(np.abs(velocity[1:]))
    far, change = path[width:] - path[:-width], np.abs(velocity[width:] - velocity[:-width])
    left, turns = np.abs(moved - by), change >= 0.5 * np.max(change)
    lag = SHAFT.longest_effort_lag  # or what is much more than usual
    if np.any(change):
        lag = min(lag, STREAM.zero * float(np.median(left[turns]) / np.median(change[turns])))
    usual = STREAM.zero * np.median(left[far >= np.median(far)])
    excess = left - np.minimum(SHAFT.agree * far, np.maximum(SHAFT.late * far, usual))
    noise = piece.noise["position"] + piece.noise["velocity"] * period * math.sqrt(width)
    rounded = 0.5 * count(piece.recorded["velocity"])  # all the time the same way, as of a slow motion
    allowed = (SHAFT.joint_rest + rounded) * SHAFT.way + max(lag, period) * change
    excess -= allowed + SHAFT.noisy * noise
    if 2 * np.sum(excess > 0.0) < width:
        return ""
    worst = int(np.argmax(excess))
    return (
        f"in the {SHAFT.way:g} s from {time[worst]:.4g} s, the position changes by {shown(moved[worst], unit)}, the "
        f"integral of the velocity by {shown(by[worst], unit)}; an encoder slips or stops, the velocity is late, or "
        "one of the two is of something else"
    )
