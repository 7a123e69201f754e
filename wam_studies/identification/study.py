"""Identified against true friction, over kinds of plants and seeds."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from wam_description.rigid_body import Array
from wam_studies.harness import Study, option
from wam_studies.identification.plants import KINDS
from wam_studies.identification.trial import IdentificationResult, IdentificationTrial, run_trial
from wam_studies.scores import Row, Scores, ScoreTable, exact


@dataclass(frozen=True)
class IdentificationLimits:
    """What is required of the errors of a motor's friction."""

    required: float = 0.04
    target: float = 0.02
    factor: float = 2.0  # between errors and stated standard errors


LIMITS = IdentificationLimits()


@dataclass(frozen=True)
class IdentificationStudy(Study[IdentificationTrial, IdentificationResult]):
    """Every kind of plant with every seed."""

    title: ClassVar[str] = "identified and true friction of many plants"
    page: ClassVar[str] = "docs/identify.md"

    seconds: float = option(60.0, "length of each motion", 20.0)

    def cases(self, seed: int) -> list[IdentificationTrial]:
        """Each kind of plant."""
        return [IdentificationTrial(self.configuration, kind, seed, self.seconds) for kind in KINDS]

    run = staticmethod(run_trial)

    def score(self, records: Sequence[IdentificationResult]) -> Scores:
        """Largest errors, errors by stated ones of each kind, and all of them as a table."""
        return Scores(list(_rows(records)), [_errors(records)])

    def failure(self, record: IdentificationResult) -> str:
        """Why the motion ended early."""
        return record.failure


def _rows(records: Sequence[IdentificationResult]) -> Iterator[Row]:
    level = (lambda r: r.level, lambda r: r.level_sd)
    coulomb = (lambda r: r.coulomb, lambda r: r.coulomb_sd)
    for name, (error, sd) in (("friction", level), ("Coulomb friction alone", coulomb)):
        errors = _joined(records, error)
        largest = exact(float(np.abs(errors).max(initial=0.0)), len(errors))
        yield Row(f"{name}, largest error", largest, "%", 100.0, (0.0, LIMITS.required), (0.0, LIMITS.target))
        for kind in dict.fromkeys(result.kind for result in records):
            some = [result for result in records if result.kind == kind]
            scores = _joined(some, error) / _joined(some, sd)
            allowed = 1.0 / LIMITS.factor, LIMITS.factor
            yield Row(
                f"{name}, {kind}, error / standard error, rms", exact(_rms(scores), len(scores)), required=allowed
            )


def _errors(records: Sequence[IdentificationResult]) -> ScoreTable:
    """Errors by kind of plant, and of all."""
    head = (
        "plant", "runs", "friction before, rms", "friction, rms", "largest", "error / standard error, rms",
        "beyond 2 of it", "Coulomb alone, rms", "largest", "its error / standard error, rms",
        "gravity before, N m", "gravity, N m",
    )  # fmt: skip
    kinds = [(kind, [r for r in records if r.kind == kind]) for kind in dict.fromkeys(r.kind for r in records)]
    return ScoreTable("By kind of plant", head, [_cells(*each) for each in [*kinds, ("every plant", list(records))]])


def _cells(name: str, some: Sequence[IdentificationResult]) -> list[str]:
    level, coulomb = _joined(some, lambda r: r.level), _joined(some, lambda r: r.coulomb)
    scores = level / _joined(some, lambda r: r.level_sd)
    return [
        name,
        str(len(some)),
        f"{_rms(_joined(some, lambda r: r.before)):.1%}",
        f"{_rms(level):.2%}",
        f"{np.abs(level).max():.2%}",
        f"{_rms(scores):.2f}",
        f"{np.mean(np.abs(scores) > LIMITS.factor):.0%}",
        f"{_rms(coulomb):.2%}",
        f"{np.abs(coulomb).max():.2%}",
        f"{_rms(coulomb / _joined(some, lambda r: r.coulomb_sd)):.2f}",
        f"{_rms(np.array([r.gravity_before for r in some])):.3f}",
        f"{_rms(np.array([r.gravity for r in some])):.3f}",
    ]


def _joined(some: Sequence[IdentificationResult], get: Callable[[IdentificationResult], Array]) -> Array:
    return np.concatenate([get(result) for result in some]) if some else np.empty(0)


def _rms(values: Array) -> float:
    return math.sqrt(float(np.mean(np.square(values)))) if len(values) else math.nan
