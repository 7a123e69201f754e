"""What torques cannot show: the inference alone, with exact torques and with torques of known errors.

No dynamics and no observer: drawn poses and contacts, their joint torques by the Jacobian, errors added, the position
inferred with a covariance that is just that of the errors.  Friction of the contact is not observable: four torques
cannot distinguish it from position and force.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.contact.contact_estimator import ContactEstimatorParameters
from wam_control.contact.contact_inference import ContactInference
from wam_description.configuration import Configuration
from wam_description.rigid_body import RigidBody
from wam_description.transmission_map import TransmissionMap
from wam_studies.contact.moves import MoveGenerator
from wam_studies.contact.rows import STATED
from wam_studies.contact.touches import LEVEL_KINDS, TOUCHES, axis_of, touches
from wam_studies.scores import quantile

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BoundErrors:
    """What the inference alone is given."""

    count: int = 1200  # contacts
    seed: int = 1
    exact: float = 2e-3  # N m, sd that stands for none
    constant: float = 0.02  # largest error of a torque constant, as in the realistic mix


ERRORS = BoundErrors()
BOUNDS = (
    "errors of the torques", "median 5/10/20 N, cm", "95 %", "sd < 2 cm, %", "90 % set contains the truth, %",
    "inner link, 10 N, %",
)  # fmt: skip


class BoundRow(NamedTuple):
    """Errors of the torques: name, sd of each joint, (n,), N m, and the largest of a torque constant."""

    name: str
    sd: Array
    constant: float

    def cells(self, configuration: Configuration) -> list[str]:
        """The row as text: errors of the position at each force, share of small sd, share that the set holds."""
        arm = configuration.shared.arm
        own = configuration.node("contact_estimator", ContactEstimatorParameters)
        body, inference = RigidBody(arm), ContactInference(arm, RigidBody(arm), own.inference)
        random, moves = np.random.default_rng((ERRORS.seed, 4)), MoveGenerator(arm)
        matrix = np.array(TransmissionMap.of(arm).joint_from_motor)
        to_joints = np.linalg.inv(matrix).T
        errors: dict[float, list[float]] = {force: [] for force in TOUCHES.levels}
        small, held, count, detected = 0, 0, 0, []
        for touch in touches(arm, random, [float(i) for i in range(ERRORS.count)], LEVEL_KINDS):
            q, wrong = np.array(moves.pose(random)), self.constant * random.uniform(-1.0, 1.0, len(matrix))
            wrench = np.concatenate(touch.wrench(touch.begin + 0.1, axis_of(arm, touch.cover, touch.position)))
            true = wrench @ body.cover_jacobian(q, touch.cover)
            at_motors = matrix.T @ true
            torques = to_joints @ (at_motors * (1.0 + wrong)) + self.sd * random.standard_normal(len(matrix))
            scaled = to_joints * (self.constant / np.sqrt(3.0) * at_motors)
            precision = np.linalg.inv(np.diag(self.sd**2) + scaled @ scaled.T)
            force = float(np.linalg.norm(touch.force))
            level = next((level for level in TOUCHES.levels if abs(force - level) <= STATED.near * level), None)
            if touch.kind == "inner":
                if level == TOUCHES.levels[1]:
                    detected.append(float(torques @ (torques / self.sd**2)) > own.detect)
                continue
            found = inference.infer(q.tolist(), torques.tolist(), precision)
            best, right = found[0], [each for each in found if each.cover == touch.cover]
            known = best.cover == touch.cover and not np.isnan(best.position)
            count, small = count + 1, small + (known and best.position_sd < STATED.small_sd)
            held += any(each.low <= touch.position <= each.high for each in right)
            if level is not None:
                errors[level].append(abs(best.position - touch.position) if known else np.inf)
        middle, most = (
            " / ".join(f"{100.0 * quantile(own, part).value:.1f}" for own in errors.values()) for part in (0.5, 0.95)
        )
        shares = [f"{100.0 * part / whole:.0f}" for part, whole in ((small, count), (held, count))]
        return [self.name, middle, most, *shares, f"{100.0 * np.mean(detected):.0f}"]


def bounds(configuration: Configuration, errors: Array) -> list[list[str]]:
    """Rows of `BOUNDS` as text; `errors` (2, n), N m, rms with all motors sliding, and of all."""
    exact = np.full(errors.shape[1], ERRORS.exact)
    sliding, every = errors
    constant = ERRORS.constant
    rows = [
        BoundRow("none", exact, 0.0),
        BoundRow("torque constants within 2 %", exact, constant),
        BoundRow("and those in free motion, all motors sliding, mean of four moments", sliding / 2.0, constant),
        BoundRow("the same, of one moment", sliding, constant),
        BoundRow("the same, some motors at rest", every, constant),
    ]
    return [row.cells(configuration) for row in rows]
