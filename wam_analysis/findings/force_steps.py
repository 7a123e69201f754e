"""Section about the steps of a commanded force or torque, and the response of the measured one."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_analysis.findings.effort import limited
from wam_analysis.findings.finding import Finding, Section, counted, shown, when
from wam_analysis.findings.force import SWINGS_ON, fate_words, response_findings
from wam_analysis.findings.repetition import LEAST, is_known
from wam_analysis.findings.topics import frame_change
from wam_analysis.foreign.pieces import pieces
from wam_analysis.foreign.raw_values import jumps
from wam_analysis.foreign.source import AXES, Source
from wam_analysis.held_messages import row_at, value_changes
from wam_analysis.measures.response import StepResponse, force_response
from wam_analysis.measures.runs import noise
from wam_analysis.measures.swings import Swings
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import HOLD, SHAFT, STREAM

FORCE = AXES[:3]


class ForceStep(NamedTuple):
    """A step of a command at a time, s, and its response, N or N m, with the signs of the axis of the change.

    What was commanded before is NaN where that was not recorded.
    """

    label: str
    begin: float
    before: float
    commanded: float
    response: StepResponse
    swings: Swings

    @property
    def error(self) -> float:
        """Of the steady force or torque; NaN where it was not steady at the end."""
        return abs(self.response.final - self.commanded)


def _along(measured: Source, command: Source) -> Source:
    """A command of a single axis, which a number may be, on the axis of the measured force that follows it most."""
    if len(command.values) != 1 or not measured.values:
        return command
    (value,) = command.values.values()
    wanted = value[row_at(command.time, measured.time)]
    follows = {axis: abs(force @ (wanted - np.mean(wanted))) for axis, force in measured.values.items()}
    return command._replace(values={max(follows, key=follows.__getitem__): value})


def force_steps(measured: Source, command: Source) -> list[ForceStep]:
    """The steps of a command, and how what was measured followed; a force may have the sign of the reaction.

    A step ends where the sender of either goes over to another frame; one from another frame is none.  Axes that are
    not known of both are left out.
    """
    axes = [axis for axis in measured.values if axis in command.values]
    measured, command = measured.only(*axes), command.only(*axes)
    known = ~command.is_away(measured.time)
    if not np.any(known):
        return []
    desired = np.column_stack([command.values[axis] for axis in axes])
    least = LEAST[measured.units[axes[0]]] if measured.is_joint else HOLD.equal_force
    edges = np.flatnonzero([True, *value_changes(desired, least), True])
    at = np.append(command.time, measured.time[-1])[edges]
    is_held = command.arrives[edges[:-1]] | (np.diff(at) >= HOLD.shortest)  # or else part of a ramp
    is_held[0] = True
    stretches = pieces(measured)
    got = np.column_stack([measured.values[axis][known] for axis in axes])
    sent = desired[row_at(command.time, measured.time[known])]
    middle = sent.mean(axis=0) if np.any(sent != sent[0]) else 0.0
    sign = 1.0 if measured.is_joint else np.sign(np.sum(got * (sent - middle))) or 1.0
    found, held = [], np.flatnonzero(is_held)
    for left, part in zip([0, *held + 1], held, strict=False):
        row, begin = edges[part], max(float(at[part]), float(measured.time[0]))
        end = min(at[part + 1], command.leaves(begin), measured.leaves(begin))
        since, was = at[left], desired[edges[left] - 1] * (left > 0)
        wanted = np.median(desired[row : edges[part + 1]], axis=0)  # a path that begins slowly has left it at the end
        change = wanted - was
        size = float(np.linalg.norm(change))
        if size <= least or command.arrives[row] or end - begin < HOLD.shortest:
            continue
        way = change / size
        way *= np.sign(way[np.argmax(np.abs(way))])
        for piece in stretches:
            value = sign * sum(way[i] * piece.values[axis] for i, axis in enumerate(axes))
            before = value[(piece.time < since) & (piece.time >= since - HOLD.before)]
            after = (piece.time >= since) & (piece.time < end)
            if np.count_nonzero(after) < 8 or float(piece.time[after][-1]) < end - HOLD.before:
                continue
            time, reached = piece.time[after] - begin, value[after]
            away, to = (float(one @ way) for one in (was, wanted))
            start = float(np.mean(before)) if len(before) else math.nan
            is_first = not row and is_known(command, measured.time)
            response, swinging = force_response(time, reached, start, to, size)
            found.append(ForceStep(measured.label, begin, math.nan if is_first else away, to, response, swinging))
    return found


def worst(steps: Sequence[ForceStep]) -> ForceStep:
    """The step with the largest steady error, which is NaN where none was steady at its end."""
    return max(steps, key=lambda step: np.nan_to_num(step.error, nan=-1.0))


def steady_error(steps: Sequence[ForceStep], what: str, unit: str) -> str:
    """How many steps there are, and the largest error; what was commanded from the beginning is no step."""
    number, most = sum(not math.isnan(step.before) for step in steps), worst(steps)
    error = f"the largest steady error is {shown(most.error, unit)} of {shown(most.commanded, unit)}"
    error = "none was steady at its end" if math.isnan(most.error) else error
    return f"{counted(number, what) if number else 'commanded from the beginning'}; {error}"


def step_section(recording: AnalysedRecording) -> Section | None:
    """Steps of a commanded force or torque, and how the measured one followed; None where no force was recorded."""
    forces, commands = [one for one in recording.states if not one.is_joint], recording.commands
    if not forces:
        return None
    pairs = [(one, recording.command_of(one)) for one in forces]
    followed = [(one, command) for one, command in pairs if command is not None]
    sentences, findings, shows = [], [], []
    doubts = [
        f"{one.label}, in the frame {one.frame}, is not compared with the command {other.topic}, in the frame "
        f"{other.frame}."
        for one, command in pairs
        for other in commands
        if command is None and not other.is_joint and not one.shares_frame(other)
    ]
    topics = [command.topic for _, command in followed]
    doubts += [text for one in commands if one.topic in topics and (text := _arrival(one))]
    for quantity, unit, axes in (("force", "N", FORCE), ("torque", "N m", AXES[3:])):
        steps: list[ForceStep] = []
        for one, command in followed:
            measured, wanted = one.only(*axes), command.only(*axes)
            on_axis = _along(measured, wanted)
            doubts += [
                f"{command.topic} has no {axis}, but {axis} of {one.label} follows it most, and is evaluated."
                for axis in on_axis.values.keys() - wanted.values.keys()
            ]
            steps += force_steps(measured, on_axis)
        for step in steps:
            name = f"{step.label}, {shown(step.commanded, unit)} at {step.begin:.1f} s"
            response = step.response
            settled = ", without staying within 5 % of it" * math.isinf(response.settling)
            settled += ", still changing at the end" * (bool(settled) and math.isnan(response.rise))
            settled += ", without a lasting rise in its last stretch without a gap" * math.isnan(response.settling)
            came = f"a step from {shown(step.before, unit)}{settled}"
            sentences.append(f"{name}: {'commanded from the beginning' if math.isnan(step.before) else came}.")
            if step.swings.verdict in SWINGS_ON:
                doubts.append(f"{name}: the {quantity} {fate_words(step.swings)}.")
            findings += [
                Finding(f"{name}: {quantity} in the steady state", unit, response.final, step.commanded),
                *response_findings(name, response),
                Finding(f"{name}: ripple", unit, response.ripple),
            ]
        if steps:
            shows.append(f"{steady_error(steps, f'{quantity} step', unit)}.")
    if not shows and not doubts:
        hint = "; name the topic of its command with --command" * (not followed)
        sentences.append(f"No step of a commanded force was recorded{hint}.")
    doubts += [text for pair in pairs if (text := _tared(*pair))]
    doubts += [
        f"{one.label}: {text}."
        for one in forces
        for axis, value in one.values.items()
        if noise(value) and (text := limited(one, axis))
    ]
    return Section("force", "Force", (*sentences, *doubts), findings, shows, doubts)


def _tared(measured: Source, command: Source | None) -> str:
    """That a force jumps from one message to the next, and does not change about it, where no command changes."""
    force = measured.only(*FORCE)
    if not force.values:
        return ""
    values = np.array([*force.values.values()])
    moves = np.array([jumps(force.time, value, HOLD.equal_force) for value in values])
    rows = np.flatnonzero(np.any(moves, axis=0))
    after, before = (np.clip(rows + by, 0, len(force.time) - 1) for by in (STREAM.around, -1 - STREAM.around))
    moved = moves[:, rows]
    around = np.where(moved, values[:, after] - values[:, before] - moved, 0.0)
    rows = rows[np.linalg.norm(around, axis=0) < SHAFT.agree * np.linalg.norm(moved, axis=0)]
    if command is not None and len(rows):
        changed = np.any([np.diff(value) for value in command.values.values()], axis=0)
        since = force.time[rows] - command.time[1:][changed][:, np.newaxis]
        rows = rows[~np.any(np.abs(since) < HOLD.shortest, axis=0)]
    if not len(rows):
        return ""
    size = shown(float(np.max(np.linalg.norm(moves[:, rows], axis=0))), "N")
    return (
        f"{measured.label}: the force jumps from one message to the next {when(force.time[rows])}, by up to {size}, "
        "as by a tare, an impact or a lost contact."
    )


def _arrival(command: Source) -> str:
    """That a command goes over to its frame from another one, '' if it does not."""
    change = frame_change(command)
    reason = "that is not evaluated as a step, because what was commanded before is in another frame"
    return f"{change}; {reason}." if change else ""
