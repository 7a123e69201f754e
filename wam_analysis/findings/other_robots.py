"""Joints and forces of another robot's bag, and the friction of its joints."""

import math

import numpy as np

from wam_analysis.findings.finding import Finding, Section, shown
from wam_analysis.measures.friction import identify_friction
from wam_analysis.measures.runs import noise
from wam_bag.bag import Bag, JointColumns, WrenchColumns

REST = 0.002  # rad/s; a slower joint is at rest, unless the noise is larger
NOISY = 4.0  # standard deviations of the noise of a velocity: likewise
WINDOW = 0.03  # s over which friction is averaged
FEWEST_SAMPLES = 6  # in that window
SURE = 0.25  # of a number; with a larger standard error it is not identifiable


def signals_of_others(bag: Bag) -> dict[str, JointColumns | WrenchColumns]:
    """Topics of JointState and WrenchStamped by name whose stamps rise; velocities from positions if need be."""
    found: dict[str, JointColumns | WrenchColumns] = {}
    for name, columns in sorted(bag.topics.items()):
        if not isinstance(columns, (JointColumns, WrenchColumns)) or len(columns.stamp_ns) < 20:
            continue
        if np.any(np.diff(columns.stamp_ns) <= 0):
            continue
        if isinstance(columns, JointColumns) and columns.position.shape[1] and not columns.velocity.shape[1]:
            speed = np.gradient(columns.position, columns.stamp_ns / 1e9, axis=0)
            found[name] = columns._replace(velocity=speed)
        else:
            found[name] = columns
    return found


def friction_of_others(topics: dict[str, JointColumns | WrenchColumns]) -> Section:
    """Friction and inertia of joints that are loaded by nothing else."""
    sentences, findings = [], []
    for columns in topics.values():
        if not isinstance(columns, JointColumns) or not columns.effort.shape[1] or not columns.velocity.shape[1]:
            continue
        time = columns.stamp_ns / 1e9
        window = max(WINDOW, FEWEST_SAMPLES * float(np.median(np.diff(time))))
        for i, name in enumerate(columns.names):
            velocity = columns.velocity[:, i]
            rest = max(REST, NOISY * noise(velocity[np.isfinite(velocity)]))
            found = identify_friction(time, velocity, columns.effort[:, i], rest, window)
            numbers = (
                ("dry friction", "N m", found.dynamic, found.dynamic_error),
                ("viscous friction", "N m s/rad", found.viscous, found.viscous_error),
                ("inertia", "kg m2", found.inertia, found.inertia_error),
            )
            if not all(value > 0.0 and error < SURE * value for _, _, value, error in numbers):
                continue
            findings += [Finding(f"{name}: {what}", unit, value, math.nan, "", e) for what, unit, value, e in numbers]
            told = ", ".join(f"{what} {shown(value)} +- {shown(e, unit)}" for what, unit, value, e in numbers)
            sentences.append(f"{name}: {told}.")
    if sentences:
        assumed = "Of the recorded effort, taken as loaded by friction and inertia alone:"
        return Section("friction", "Friction", (assumed, *sentences), tuple(findings), (), tuple(sentences))
    why = "The friction of the joints cannot be identified: no effort in this bag that friction and inertia explain."
    return Section("friction", "Friction", (why,), ())
