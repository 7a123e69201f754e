"""How certain an estimate is, of its parameters and of what they give together."""

from typing import NamedTuple

import numpy as np

from wam_analysis.thresholds import IDENTIFY
from wam_bag.arrays import Numbers


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
        return np.asarray(white * self._times(combinations, white) + law, np.float64)

    def covariance(self, combinations: Numbers) -> Numbers:
        """That of linear combinations, (t, p), of the parameters, (t, t)."""
        white = combinations @ self.white @ combinations.T
        unit = np.sqrt(self._times(combinations, white.diagonal()))
        return np.asarray(white * np.outer(unit, unit) + combinations @ self.law @ combinations.T, np.float64)

    def _times(self, combinations: Numbers, white: Numbers) -> Numbers:
        """How many times the white variances, (t,), those of the combinations are."""
        apart = (self.without - self.without.mean(0)) @ combinations.T
        parts = len(apart)
        return np.maximum((parts - 1) / parts * (apart**2).sum(0) / np.maximum(white, IDENTIFY.least_variance), 1.0)
