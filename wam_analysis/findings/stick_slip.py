"""Section about stick and slip."""

import math
from typing import NamedTuple

import numpy as np

from wam_analysis.findings.finding import Finding, Section, shown, times
from wam_analysis.foreign.sources import Piece, Source, is_still, pieces, rests
from wam_analysis.measures.runs import at_rest, runs, with_alone, without_turns
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import LAYOUT, SHAFT
from wam_bag.arrays import Mask, Numbers, Rows


def stick_section(recording: AnalysedRecording) -> Section:
    """How long each motor and joint was at rest, and how often it moved; whether it sticks under a command."""
    sentences, findings, verdict = [], [], []
    lacking = () if recording.is_foreign else recording.run.lacking("motor_states")
    for one in recording.states:
        command = recording.command_of(one)
        # not a position that is sent once and held
        is_speed = command is not None and len(command.time) >= SHAFT.fewest_samples
        least = SHAFT.motor_rest if one.topic == f"{recording.namespace}/motor_states" else SHAFT.joint_rest
        found = sticking(one, command if is_speed else None, least) if one.is_joint else None
        if found is None:
            continue
        if not found.slips and (distance := hidden_motion(one)):
            far = shown(distance, one.units["position"])
            sentences.append(
                f"{one.label}: moved by {far}, more slowly than the noise of its velocity, or too briefly."
            )
            continue
        findings += [
            Finding(f"{one.label}: at rest", "%", 100.0 * found.stuck),
            Finding(f"{one.label}: motions", "", float(found.slips)),
        ]
        sentence = f"{one.label}: {found.words}"
        if recording.is_foreign and found.stuck and 0 < found.slips == len(found.begins):  # ours have the arm's time
            begins = [f"{at:.2f}" for at in found.begins[: LAYOUT.begins]] + ["..."] * (found.slips > LAYOUT.begins)
            sentence += f" (from {', '.join(begins)} s)"
        if recording.is_foreign and found.stuck and found.slips and found.slowest:
            sentence += f"; slower than {shown(found.slowest)} {one.units['position']}/s, its noise, counts as rest"
        if found.commanded > SHAFT.disobeyed and found.slips > 2 and 100.0 * found.stuck > SHAFT.turning:
            sentence += f"; it sticks: {100.0 * found.commanded:.0f} % of its time at rest it was commanded to move"
            verdict.append(f"{sentence}.")
        sentences.append(f"{sentence}.")
    stated = sentences or ["No velocity was recorded."]
    return Section("stick_slip", "Stick and slip", stated, findings, lacking, verdict)


class Sticking(NamedTuple):
    """How a joint moved.

    Attributes
    ----------
    stuck : fraction of the time at rest.
    slips : motions between; a motion back and forth is one.
    commanded : fraction of the rest in which it was commanded to move; NaN without a command.
    begins : when each motion began, s; none of a motion back and forth.
    shortest : rest that is counted, s.
    is_turning : whether it is that of a motion back and forth.
    slowest : speed in rad/s or m/s up to which it is at rest, where the noise hides slower motions; else 0.
    """

    stuck: float
    slips: int
    commanded: float
    begins: tuple[float, ...] = ()
    shortest: float = 0.0
    is_turning: bool = False
    slowest: float = 0.0

    @property
    def words(self) -> str:
        """How much of the time it was at rest, and how often it moved."""
        if not self.slips:
            return "never moved"
        turns = ", half the time from one reversal to the next," * self.is_turning
        counted = f"rests shorter than {shown(self.shortest, 's')}{turns} do not count"
        if not self.stuck and self.slips == 1:
            return f"always in motion ({counted})"
        return f"at rest for {100.0 * self.stuck:.0f} % of the time ({counted}), moved {times(self.slips)}"


def sticking(source: Source, command: Source | None, least: float) -> Sticking | None:
    """Rest and motion of a joint, which is at rest below a least speed; None without a velocity."""
    if rests(source):
        return Sticking(1.0, 0, math.nan)
    resting = motions = total = disobeyed = 0
    shortest, slowest, is_turning = 0.0, 0.0, False
    begins: list[float] = []
    moved = next((q for q in ("velocity", "position") if q in source.values), "")
    for piece in pieces(source, moved) if moved else ():
        rest, velocity = rest_speed(piece, least), piece.values["velocity"]
        slowest = max(slowest, rest * (rest > least))
        period = float(piece.time[1] - piece.time[0])
        least_rows = max(1, round(SHAFT.shortest_phase / period))
        still = _still(piece, at_rest(velocity, rest, least_rows), least)
        total += len(still)
        sticks, slips = runs(still), runs(~still)
        if _only_turns(sticks, slips, velocity):
            motions, is_turning = motions + 1, True
            lengths, brief = np.diff(sticks, axis=1), SHAFT.brief * float(np.median(np.diff(slips, axis=1)))
            resting += int(np.sum(lengths[lengths > brief]))
            shortest = max(shortest, brief * period)
            continue
        shortest = max(shortest, least_rows * period)
        still = without_turns(still, velocity, rest)
        started = piece.time[runs(~still)[:, 0]].tolist()
        resting, motions, begins = resting + int(np.sum(still)), motions + len(started), begins + started
        if command is not None:
            disobeyed += int(np.sum(still & (np.abs(_commanded_speed(command, piece.time)) > rest)))
    if not total:
        return None
    unmet = disobeyed / resting if command is not None and resting else math.nan
    return Sticking(resting / total, motions, unmet, tuple(begins), shortest, is_turning, slowest)


def hidden_motion(source: Source) -> float:
    """How far a joint went that the noise of its velocity shows at rest, rad or m; 0 where it did not move."""
    distance = float(np.ptp(source.only("position").values.get("position", np.zeros(1))))
    return distance if distance > SHAFT.joint_rest * SHAFT.way and not rests(source) else 0.0


def _still(piece: Piece, still: Mask, least: float) -> Mask:
    """The rests without those in which the position goes on, as where its rate is too noisy to show it."""
    if "position" not in piece.values:
        return still
    position, sd, time = piece.values["position"], piece.noise["position"], piece.time
    return with_alone(still, lambda a, b: is_still(position[a:b], sd, least * float(time[b - 1] - time[a])))


def _only_turns(sticks: Rows, slips: Rows, velocity: Numbers) -> bool:
    """Whether it is one motion back and forth, which is slow for a moment where it turns."""
    between = sticks[1:-1]
    goes_back = velocity[between[:, 0] - 1] * velocity[between[:, 1]] < 0.0  # not all turns of a motion are rests
    if len(slips) < 4 or not len(between) or np.mean(goes_back) < SHAFT.turns:
        return False
    rest, motion = (float(np.median(np.diff(rows, axis=1))) for rows in (between, slips))
    return rest < SHAFT.brief * motion


def rest_speed(piece: Piece, least: float) -> float:
    """The speed up to which a joint is at rest, above the noise of its velocity."""
    return max(least, SHAFT.noisy * piece.noise["velocity"])


def _commanded_speed(command: Source, time: Numbers) -> Numbers:
    speed, position = command.only("velocity"), command.only("position")
    if np.any(speed.values.get("velocity", 0.0)):
        return np.interp(time, speed.time, speed.values["velocity"])
    if len(position.time) < SHAFT.fewest_samples:
        return np.zeros(len(time))
    return np.interp(time, position.time, np.gradient(position.values["position"], position.time))
