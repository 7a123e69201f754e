"""The picture of the battery: errors over force, calibration, latency, torque errors, links mixed up."""

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from wam_analysis.contact_battery.scenes import KINDS
from wam_analysis.contact_battery.score import IN_MOTION, TORQUE_MUST, SceneScore, outer, touched
from wam_analysis.contact_battery.touches import Touch
from wam_description.arm import Arm

COLOURS = ("#0b6fb8", "#d55e00", "#009e73", "#cc79a7")
NO_ANSWER = 60.0  # cm, where contacts without a place are drawn
BINS = 6


def figure(scores: Sequence[SceneScore], arm: Arm, file: Path) -> None:
    """Draw the picture into a file, whose folder is made where it does not exist."""
    file.parent.mkdir(parents=True, exist_ok=True)
    found = outer(scores, arm)
    with plt.rc_context({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "axes.titlesize": 9}):
        picture, axes = plt.subplots(2, 3, figsize=(13.0, 7.4), layout="constrained")
        flat = axes.ravel()
        _errors(flat[0], found)
        _spreads(flat[1], found)
        _reliability(flat[2], touched(scores), found)
        _torques(flat[3], scores, arm)
        _latency(flat[4], outer(scores, arm, force=5.0))
        _links(flat[5], touched(scores), arm)
        picture.savefig(file, dpi=110)
        plt.close(picture)


def _errors(axes: Axes, found: Sequence[Touch]) -> None:
    for kind, colour in zip(KINDS, COLOURS, strict=True):
        own = [touch for touch in found if touch.kind == kind]
        error = [min(100.0 * abs(touch.error), NO_ANSWER) for touch in own]
        axes.plot([touch.force for touch in own], error, "o", color=colour, ms=3, alpha=0.5, label=kind)
    for force, limit in ((5.0, 3.0), (10.0, 2.0), (20.0, 1.3)):
        axes.plot([0.8 * force, 1.2 * force], [limit, limit], color="black", lw=2)
    axes.set(
        title="place on the outer link, in motion; bars: allowed medians",
        xlabel="force [N]",
        ylabel=f"error [cm]; at {NO_ANSWER:.0f}: no place given",
        yscale="log",
        ylim=(0.02, 1.3 * NO_ANSWER),
    )
    axes.legend(frameon=False, fontsize=8)


def _spreads(axes: Axes, found: Sequence[Touch]) -> None:
    given = [touch for touch in found if touch.right_link and math.isfinite(touch.error) and touch.place_sd > 0.0]
    sd = 100.0 * np.array([touch.place_sd for touch in given])
    error = 100.0 * np.abs([touch.error for touch in given])
    axes.loglog(sd, np.maximum(error, 0.02), "o", color=COLOURS[0], ms=2.5, alpha=0.35)
    ends = (0.3, 15.0)
    axes.loglog(ends, ends, color="black", lw=1, label="one stated sd")
    groups = np.array_split(np.argsort(sd), BINS) if len(sd) >= BINS else []
    middle = [float(np.median(sd[group])) for group in groups]
    inner = [float(np.quantile(error[group], 0.683)) for group in groups]
    axes.loglog(middle, inner, "s-", color=COLOURS[1], label="68 % of the errors are below")
    axes.set(title="stated spread against error", xlabel="stated sd of the place [cm]", ylabel="error [cm]")
    axes.legend(frameon=False, fontsize=8)


def _reliability(axes: Axes, every: Sequence[Touch], found: Sequence[Touch]) -> None:
    felt = [touch for touch in every if touch.felt]
    order = np.argsort([touch.link_probability for touch in felt])
    groups = np.array_split(order, BINS) if len(felt) >= BINS else []
    said = [float(np.mean([felt[i].link_probability for i in group])) for group in groups]
    right = [float(np.mean([felt[i].right_link for i in group])) for group in groups]
    levels = np.linspace(0.0, 1.0, 51)
    place = [touch for touch in found if touch.felt]
    held = [float(np.mean([touch.credibility <= level for touch in place])) if place else math.nan for level in levels]
    axes.plot((0, 1), (0, 1), color="black", lw=1)
    axes.plot(levels, held, color=COLOURS[0], label="sets of that probability hold the outer link's truth")
    axes.plot(said, right, "s", color=COLOURS[1], label="link named with that probability is right")
    axes.set(title="calibration", xlabel="stated probability", ylabel="share", xlim=(0, 1), ylim=(0, 1.02))
    axes.legend(frameon=False, fontsize=8, loc="lower right")


def _torques(axes: Axes, scores: Sequence[SceneScore], arm: Arm) -> None:
    parts = [scene.residual for scene in scores]
    states = (("moving", IN_MOTION), ("sliding", IN_MOTION), ("still", ("rest",)), ("still", ("dither",)))
    labels = ("in motion", "every motor slides", "at rest", "at rest, dithered")
    names = arm.joints.names
    for k, ((state, groups), label) in enumerate(zip(states, labels, strict=True)):
        own = [part for part in parts if part.group in groups]
        count = sum(getattr(part, f"{state}_count") for part in own)
        if count:
            squares = np.sum([getattr(part, state) for part in own], axis=0)
            axes.bar(
                np.arange(len(names)) + 0.2 * (k - 1.5), np.sqrt(squares / count), 0.18, color=COLOURS[k], label=label
            )
    for i, limit in enumerate(TORQUE_MUST):
        axes.plot([i - 0.4, i + 0.4], [limit, limit], color="black", lw=2)
    axes.set(title="external torque, rms error; bars: allowed in motion or dithered", ylabel="[N m]")
    axes.set_xticks(range(len(names)), names)
    axes.legend(frameon=False, fontsize=8)


def _latency(axes: Axes, found: Sequence[Touch]) -> None:
    times = sorted(1e3 * touch.latency for touch in found if not math.isnan(touch.latency))
    axes.step(times, (np.arange(len(times)) + 1.0) / max(len(times), 1), color=COLOURS[0], where="post")
    axes.plot(60.0, 0.95, "_", color="black", ms=14, mew=2)
    axes.set(
        title="5 N on the outer link, felt within; mark: must",
        xlabel="time [ms]",
        ylabel="share",
        xlim=(0, 120),
        ylim=(0, 1.02),
    )


def _links(axes: Axes, every: Sequence[Touch], arm: Arm) -> None:
    names = arm.covers.names
    counts = np.zeros((len(names), len(names) + 1))
    for touch in every:
        true = names.index(touch.cover)
        named = len(names) if not touch.felt else true if touch.right_link else 1 - true
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
    axes.set_xticks(range(len(names) + 1), [*names, "nothing"])
    axes.set_yticks(range(len(names)), names)
    axes.set(title="links: true (down) and felt (across)", xlabel="felt", ylabel="true")
