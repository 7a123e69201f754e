"""Where a motion contradicts the configured arm, so that a model identified from it would be a wrong one.

Torques of the configured arm are compared with the recorded ones, as recorded and with each mistake that a recording
may have: the mistake that explains them much better is the likely cause.
"""

from collections.abc import Iterator
from enum import StrEnum
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np

from wam_analysis.identification.fit import Identification, rms
from wam_analysis.identification.motion import MotionSamples
from wam_analysis.identification.regressor import Regressor
from wam_analysis.thresholds import IDENTIFY, SHAFT
from wam_bag.arrays import Mask, Numbers
from wam_description.arm import Shared


class Mistake(StrEnum):
    """What is wrong with a recording, in words."""

    # all torques are larger or smaller than those of the configured arm
    SCALED = (
        "all torques are {size:.2g} times those of the configuration: is the effort in A, its sign wrong, or is there "
        "a load?"
    )
    # those of one motor are, or have the other sign
    SCALED_MOTOR = (
        "the torques of {about} are {size:.2g} times those of the configuration: sign, unit or torque constant?"
    )
    SWAPPED = "the torques fit if the names of the motors {about} are exchanged."
    TURNED = "the torques fit if {about} has the other sign, in angle, velocity and effort."
    PAYLOAD = (
        "the torques fit with {size:.2g} kg at the tool: declare it as arm.payload, unless something touched the arm."
    )
    # the torques of a motor are not those of any arm
    UNEXPLAINED = (
        "{share} of the friction of {about} remains unexplained: did something touch the arm, is its base tilted, "
        "are torques late or cut off, or angles in another unit?"
    )
    WEIGHT = (
        "the links weigh {size:.2g} times as much as configured: a payload that is not in arm.payload, another base, "
        "torques without gravity, or a long contact?"
    )
    NO_FRICTION = "no friction is left at {about}: did something push the arm along its motion?"


class Contradiction(NamedTuple):
    """A mistake, the motors or joints that it is about, and its size."""

    mistake: Mistake
    about: tuple[str, ...]
    size: float

    def __str__(self) -> str:
        """The contradiction and its likely cause in words."""
        share = f"{self.size:.0%}" if self.size <= 1.0 else "more than all"
        return self.mistake.format(about=" and ".join(self.about), size=self.size, share=share)


def contradictions(shared: Shared, motion: MotionSamples, found: Identification) -> list[Contradiction]:
    """What contradicts the configured arm, the likely cause first; empty where the identified model may be used."""
    cause = _cause(shared, motion, found)
    return [*([cause] if cause else []), *_symptoms(shared, motion, found)]


def _symptoms(shared: Shared, motion: MotionSamples, found: Identification) -> Iterator[Contradiction]:
    unknowns, regressor = found.unknowns, Regressor(shared, found.unknowns, motion)
    for name, share in zip(shared.arm.motors.names, found.unexplained.tolist(), strict=True):
        if share > IDENTIFY.contradicted:
            yield Contradiction(Mistake.UNEXPLAINED, (name,), share)
    before, now = (np.sum(regressor.joint_torques(each), axis=(0, 3)) for each in (unknowns.present, found.values))
    heavier = _ratio(before, now, regressor.is_used)
    if not 1.0 / IDENTIFY.heavier < heavier < IDENTIFY.heavier:
        yield Contradiction(Mistake.WEIGHT, (), heavier)
    for i, name in enumerate(unknowns.names):
        is_friction = name.startswith(("motors.coulomb_", "joints.coulomb."))
        if is_friction and found.is_identified[i] and found.values[i] < IDENTIFY.least_share * unknowns.present[i]:
            yield Contradiction(Mistake.NO_FRICTION, (name.rpartition(".")[2],), float(found.values[i]))


def _cause(shared: Shared, motion: MotionSamples, found: Identification) -> Contradiction | None:
    """The one mistake that explains the recorded torques much better than none; None where none does."""
    motors, unknowns = shared.arm.motors.names, found.unknowns
    regressor = Regressor(shared, unknowns, motion, IDENTIFY.least_motion)
    model, torque, used = _torques(regressor, motion)
    as_recorded = _misfit(model, torque, used)
    scale = _ratio(model, torque, used)
    tried = [(_misfit(scale * model, torque, used), Contradiction(Mistake.SCALED, (), scale))]
    for i, name in enumerate(motors):
        one = np.ones(len(motors))
        one[i] = _ratio(model[:, i], torque[:, i], used[:, i])
        mistake = Contradiction(Mistake.SCALED_MOTOR, (name,), float(one[i]))
        tried.append((_misfit(one * model, torque, used), mistake))
    # a factor that a torque constant or a mass may be wrong by is no mistake
    tried = [one for one in tried if not 1.0 / IDENTIFY.heavier < one[1].size < IDENTIFY.heavier]
    of_payload = regressor.payload_torque
    payload = shared.arm.payload + (more := _ratio(of_payload, torque - model, used))
    if payload > 0.0:
        there = Contradiction(Mistake.PAYLOAD, (), payload)
        tried.append((_misfit(model + more * of_payload, torque, used), there))
    for i, j in combinations_with_replacement(range(len(motors)), 2):
        change = np.eye(len(motors))
        change[[i, j]] = change[[j, i]] if i < j else -change[[i, i]]
        changed = motion._replace(**{name: one @ change for name, one in motion._asdict().items() if one.ndim > 1})
        mistake = Contradiction(Mistake.SWAPPED if i < j else Mistake.TURNED, tuple({motors[i]: 1, motors[j]: 1}), 1.0)
        regressor = Regressor(shared, unknowns, changed, IDENTIFY.least_motion)
        tried.append((_misfit(*_torques(regressor, changed)), mistake))
    least, cause = min(tried, key=lambda one: one[0])
    is_clear = as_recorded > IDENTIFY.misfit and least < SHAFT.much_better * as_recorded
    return cause if is_clear else None


def _torques(regressor: Regressor, motion: MotionSamples) -> tuple[Numbers, Numbers, Mask]:
    """Torques of the configured arm and the recorded ones, N m, and where they count, (k, n) each."""
    present = regressor.unknowns.present
    equations = regressor.equations(present)
    return equations.columns @ present + motion.torque - equations.torque, motion.torque, equations.is_used


def _misfit(model: Numbers, torque: Numbers, used: Mask) -> float:
    """Rms difference per rms torque of the model, the mean over motors."""
    left, size = rms(torque - model, used), rms(model, used)
    moved = used.any(0)
    return float(np.mean(left[moved] / np.maximum(size[moved], IDENTIFY.least_friction))) if moved.any() else 0.0


def _ratio(model: Numbers, torque: Numbers, used: Mask) -> float:
    """How many times the torques of the model the recorded ones are; 1 where that is not known."""
    square = float((model**2 * used).sum())
    return float((model * torque * used).sum()) / square if square else 1.0
