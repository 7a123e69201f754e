"""How certain an estimate is, and its covariance in the errors of the model that the contact estimator tracks.

It tracks friction of each direction, friction by load, and weight and inertia at each joint, per torque.  The
error of any other parameter has torques, too: viscous friction that is too low is in part Coulomb friction.  Each is
counted as those tracked errors whose torques are nearest to its own in the motion; what no tracked error explains is
small, and `left`.
"""

from collections.abc import Sequence
from itertools import compress
from typing import NamedTuple

import numpy as np

from wam_analysis.identification.regressor import Regressor
from wam_analysis.thresholds import IDENTIFY
from wam_bag.arrays import Numbers

THEMSELVES = ("motors.coulomb_", "motors.load_", "joints.coulomb.", "joints.load.")  # identified and tracked
CONSTANTS = "motors.torque_"  # the estimator has errors of the torque constants that are not identified


class Uncertainty(NamedTuple):
    """What the errors of p estimated parameters are known by.

    Standard deviations are those of the jackknife, which 20 parts give well; correlations, which they do not, those of
    white residuals.  Both are taken of the combinations in question: a motion shows these, not the single parameters.

    Attributes
    ----------
    without : (parts, p), estimates without each part of the motion.
    white : (p, p), covariance if residuals were white.
    law : (p, p), covariance by what the model leaves out, which each part of the motion has alike.
    """

    without: Numbers
    white: Numbers
    law: Numbers

    def variances(self, combinations: Numbers) -> Numbers:
        """Those of linear combinations, (t, p), of the parameters, (t,)."""
        white, law = (((combinations @ each) * combinations).sum(1) for each in (self.white, self.law))
        return white * self._times(combinations, white) + law

    def covariance(self, combinations: Numbers) -> Numbers:
        """That of linear combinations, (t, p), of the parameters, (t, t)."""
        white = combinations @ self.white @ combinations.T
        unit = np.sqrt(self._times(combinations, white.diagonal()))
        return white * np.outer(unit, unit) + combinations @ self.law @ combinations.T

    def _times(self, combinations: Numbers, white: Numbers) -> Numbers:
        """How many times the white variances, (t,), those of the combinations are."""
        apart = (self.without - self.without.mean(0)) @ combinations.T
        parts = len(apart)
        return np.maximum((parts - 1) / parts * (apart**2).sum(0) / np.maximum(white, IDENTIFY.least_variance), 1.0)


class TrackedErrors(NamedTuple):
    """Covariance of the tracked errors.

    Attributes
    ----------
    names : t, those that the motion shows; links.inertia.J is of links, pulleys and rotors at a joint.
    covariance : (t, t), of friction in N m, load friction, weights and inertias per torque.
    left : (n,), standard deviation of each motor's torque by errors that are no tracked ones, N m.
    """

    names: tuple[str, ...]
    covariance: Numbers
    left: Numbers


def tracked_errors(
    regressor: Regressor, joints: Sequence[str], still: Sequence[int], values: Numbers, uncertainty: Uncertainty
) -> TrackedErrors:
    """Express the covariance of what was identified in tracked errors.

    What the motion does not show has no row: the estimator keeps what it knows of it.

    Parameters
    ----------
    regressor : of the motion.
    joints : names of all joints.
    still : those, by index, whose torques the motion does not show.
    values : (p,), of all parameters.
    uncertainty : of them.
    """
    equations, names = regressor.equations(values), regressor.unknowns.names
    shown = np.abs(equations.columns[equations.is_used]).max(axis=0) > IDENTIFY.least_column
    own = [i for i, name in enumerate(names) if name.startswith(THEMSELVES) and shown[i]]
    moved = [j for j in range(len(joints)) if j not in still]
    torques = np.concatenate([each[:, :, moved] for each in regressor.joint_torques(values)], axis=2)
    called = [f"links.{what}.{joints[j]}" for what in ("weight", "inertia") for j in moved]
    # a joint about the vertical carries no weight
    has_torque = np.abs(torques).max(axis=(0, 1)) > IDENTIFY.least_column
    every = np.concatenate((equations.columns[:, :, own], torques[:, :, has_torque]), axis=2)
    tracked, columns = every[equations.is_used], equations.columns[equations.is_used]
    columns[:, [i for i, name in enumerate(names) if name.startswith(CONSTANTS)]] = 0.0
    size = np.maximum(np.linalg.norm(tracked, axis=0), IDENTIFY.least_column)
    nearest = np.linalg.lstsq(tracked / size, columns, rcond=None)[0] / size[:, None]
    left = np.where(nearest.any(axis=0), equations.columns, 0.0) - every @ nearest
    rms = [
        np.sqrt(uncertainty.variances(left[used, i]).mean()) if used.any() else 0.0
        for i, used in enumerate(equations.is_used.T)
    ]
    return TrackedErrors(
        (*(names[i] for i in own), *compress(called, has_torque)),
        uncertainty.covariance(nearest),
        np.array(rms),
    )
