"""Response of a measured force to the steps of its command."""

from typing import NamedTuple

import numpy as np

from wam_analysis.foreign.sources import Source, pieces
from wam_analysis.held_messages import row_at
from wam_analysis.measures.response import StepResponse, step_response
from wam_analysis.thresholds import HOLD

FORCE = ("force.x", "force.y", "force.z")


class ForceStep(NamedTuple):
    """A step of a command and its response, N along the change of the command.

    Attributes
    ----------
    label : of the measured wrench.
    begin : s.
    before, commanded : forces before and from the step on.
    response : of the measured force.
    """

    label: str
    begin: float
    before: float
    commanded: float
    response: StepResponse


def force_steps(measured: Source, command: Source) -> list[ForceStep]:
    """The steps of a command of a force, and how the measured force followed; its sign may be that of the reaction.

    A step ends where the sender of either goes over to another frame; one from another frame is none.  Axes that are
    not known of both are left out.
    """
    axes = [axis for axis in FORCE if axis in command.values and axis in measured.values]
    measured, command = measured.only(*axes), command.only(*axes)
    known = ~command.is_away(measured.time)
    if not axes or not np.any(known):
        return []
    desired = np.column_stack([command.values[axis] for axis in axes])
    changed = np.flatnonzero(np.any(np.abs(np.diff(desired, axis=0)) > HOLD.equal_force, axis=1)) + 1
    begins = [0, *changed.tolist()]
    ends = [*command.time[changed].tolist(), float(measured.time[-1])]
    stretches = pieces(measured)
    rows = row_at(command.time, measured.time[known])
    got = np.column_stack([measured.values[axis][known] for axis in axes])
    sign = np.sign(float(np.sum((got - got.mean(axis=0)) * (desired[rows] - desired[rows].mean(axis=0))))) or 1.0
    found, arrives = [], command.arrives
    for last, row, until in zip([0, *begins[:-1]], begins, ends, strict=True):
        begin = float(command.time[row])
        end = min(until, command.leaves(begin), measured.leaves(begin))
        change = desired[row] - desired[last]
        size = float(np.linalg.norm(change))
        if size <= HOLD.equal_force or arrives[row] or end - begin < HOLD.shortest:
            continue
        way = change / size
        for piece in stretches:
            value = sign * sum(way[i] * piece.values[axis] for i, axis in enumerate(axes))
            before = (piece.time < begin) & (piece.time >= begin - HOLD.before)
            after = (piece.time >= begin) & (piece.time < end)
            if not np.any(before) or int(np.sum(after)) < 8 or float(piece.time[after][-1]) < end - HOLD.before:
                continue
            try:
                response = step_response(
                    piece.time[after] - begin,
                    value[after],
                    float(np.mean(value[before])),
                    HOLD.steady * (end - begin),
                    HOLD.band,
                )
            except ValueError:
                continue
            found.append(
                ForceStep(measured.label, begin, float(desired[last] @ way), float(desired[row] @ way), response)
            )
    return found
