"""The figure of the benchmark: position errors, calibration, torque errors, latency, link identification."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from wam_analysis.drawing import SHAFTS
from wam_description.arm import Arm
from wam_studies.contact.contacts import EvaluatedContact
from wam_studies.contact.rows import (
    IN_MOTION,
    STATED,
    TORQUES,
    EstimatedContact,
    ScenarioScore,
    contacts_of,
    near,
    on_outer_link,
    outer_links,
)
from wam_studies.contact.scenarios import KINDS
from wam_studies.figures.style import panels

NO_POSITION = 60.0  # cm, at which contacts without a position are drawn
BINS = 6


def figure(scores: Sequence[ScenarioScore], arm: Arm, file: Path) -> None:
    """Draw the figure into a file, and create its folder."""
    file.parent.mkdir(parents=True, exist_ok=True)
    found = on_outer_link(scores, arm)
    with panels(file, 3, 2, 8.8, 10.4) as (_, flat):
        _errors(flat[0], found)
        _standard_deviations(flat[1], found)
        _reliability(flat[2], contacts_of(scores), found)
        _torques(flat[3], scores, arm)
        _latency(flat[4], near(found, 5.0), outer_links(arm))
        _links(flat[5], contacts_of(scores), arm)


def _errors(axes: Axes, found: Sequence[EvaluatedContact]) -> None:
    for kind, colour in zip(KINDS, SHAFTS, strict=False):
        own = [contact for contact in found if contact.kind == kind]
        error = [min(100.0 * abs(contact.error), NO_POSITION) for contact in own]
        axes.plot([contact.force for contact in own], error, "o", color=colour, ms=3, alpha=0.5, label=kind)
    for force, allowed in STATED.median.items():
        limit = 100.0 * allowed[0][1]
        axes.plot([0.8 * force, 1.2 * force], [limit, limit], color="black", lw=2)
    axes.set(
        title="position in motion; bars: required medians",
        xlabel="force [N]",
        ylabel=f"error [cm]; at {NO_POSITION:.0f}: no position",
        yscale="log",
        ylim=(0.02, 1.3 * NO_POSITION),
    )
    axes.legend(frameon=False, fontsize=8)


def _standard_deviations(axes: Axes, found: Sequence[EvaluatedContact]) -> None:
    given = [
        contact
        for contact in found
        if contact.right_link and math.isfinite(contact.error) and contact.position_sd > 0.0
    ]
    sd = 100.0 * np.array([contact.position_sd for contact in given])
    error = 100.0 * np.abs([contact.error for contact in given])
    axes.loglog(sd, np.maximum(error, 0.02), "o", color=SHAFTS[0], ms=2.5, alpha=0.35)
    ends = (0.3, 15.0)
    axes.loglog(ends, ends, color="black", lw=1, label="one reported sd")
    groups = np.array_split(np.argsort(sd), BINS) if len(sd) >= BINS else []
    middle = [float(np.median(sd[group])) for group in groups]
    inner = [float(np.quantile(error[group], 0.683)) for group in groups]
    axes.loglog(middle, inner, "s-", color=SHAFTS[1], label="68 % quantile of the error")
    axes.set(
        title="reported standard deviation and error", xlabel="reported sd of the position [cm]", ylabel="error [cm]"
    )
    axes.legend(frameon=False, fontsize=8)


def _reliability(axes: Axes, every: Sequence[EvaluatedContact], found: Sequence[EvaluatedContact]) -> None:
    detected = [contact for contact in every if contact.detected]
    order = np.argsort([contact.probability for contact in detected])
    groups = np.array_split(order, BINS) if len(detected) >= BINS else []
    reported = [float(np.mean([detected[i].probability for i in group])) for group in groups]
    right = [float(np.mean([detected[i].right_link for i in group])) for group in groups]
    levels = np.linspace(0.0, 1.0, 51)
    outer = [contact for contact in found if contact.detected]
    held = [
        float(np.mean([contact.credibility <= level for contact in outer])) if outer else math.nan for level in levels
    ]
    axes.plot((0, 1), (0, 1), color="black", lw=1)
    axes.plot(levels, held, color=SHAFTS[0], label="credible sets that contain the position")
    axes.plot(reported, right, "s", color=SHAFTS[1], label="links identified correctly")
    axes.set(
        title="calibration", xlabel="reported probability", ylabel="share of contacts", xlim=(0, 1), ylim=(0, 1.02)
    )
    axes.legend(frameon=False, fontsize=8, loc="lower right")


def _torques(axes: Axes, scores: Sequence[ScenarioScore], arm: Arm) -> None:
    parts = [scenario.torque_errors for scenario in scores]
    states = (("moving", IN_MOTION), ("sliding", IN_MOTION), ("still", ("rest",)), ("still", ("dither",)))
    labels = ("in motion", "every motor slides", "at rest", "at rest, dithered")
    names = arm.joints.names
    for k, ((state, groups), label) in enumerate(zip(states, labels, strict=True)):
        own = [part for part in parts if part.group in groups]
        count = sum(getattr(part, f"{state}_count") for part in own)
        if count:
            squares = np.sum([getattr(part, state) for part in own], axis=0)
            axes.bar(
                np.arange(len(names)) + 0.2 * (k - 1.5), np.sqrt(squares / count), 0.18, color=SHAFTS[k], label=label
            )
    required, _ = TORQUES.get(arm.name, ((), ()))
    for i, limit in enumerate(required):
        axes.plot([i - 0.4, i + 0.4], [limit, limit], color="black", lw=2)
    axes.set(title="external torque, rms error; bars: required", ylabel="[N m]")
    axes.set_xticks(range(len(names)), names)
    axes.legend(frameon=False, fontsize=8)


def _latency(axes: Axes, found: Sequence[EstimatedContact], links: str) -> None:
    times = sorted(1e3 * contact.latency for contact in found if not math.isnan(contact.latency))
    axes.step(times, (np.arange(len(times)) + 1.0) / max(len(times), 1), color=SHAFTS[0], where="post")
    axes.plot(60.0, 0.95, "_", color="black", ms=14, mew=2)
    axes.set(
        title=f"detection latency, 5 N on the {links}; mark: required",
        xlabel="time [ms]",
        ylabel="share of contacts",
        xlim=(0, 120),
        ylim=(0, 1.02),
    )


def _links(axes: Axes, every: Sequence[EvaluatedContact], arm: Arm) -> None:
    names = arm.covers.names
    counts = np.zeros((len(names), len(names) + 1))
    for contact in every:
        true = names.index(contact.cover)
        named = names.index(contact.link) if contact.link else len(names)
        counts[true, named] += 1
    axes.imshow(counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0), cmap="Blues", vmin=0.0, vmax=1.0)
    for (i, j), count in np.ndenumerate(counts):
        whole = max(counts[i].sum(), 1.0)
        axes.text(
            j,
            i,
            f"{count:.0f}\n{count / whole:.1%}",
            ha="center",
            va="center",
            color="white" if count > 0.5 * whole else "black",
        )
    axes.set_xticks(range(len(names) + 1), [*names, "missed"])
    axes.set_yticks(range(len(names)), names)
    axes.set(title="link identification", xlabel="estimated link", ylabel="true link")
