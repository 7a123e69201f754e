"""How the torques of the motors are measured wrong, late or not at all."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class MeasuredSignals(NamedTuple):
    """Errors of the measured torques.

    Attributes
    ----------
    scale : measured over true torque, of each motor or one for all.
    noise : sd of the measured torque, per torque.
    delay : samples by which measured torques are late.
    dropped : fraction of samples that do not arrive.
    """

    scale: tuple[float, ...] = (1.0,)
    noise: float = 0.0
    delay: int = 0
    dropped: float = 0.0

    def of(self, torque: Array, random: np.random.Generator) -> tuple[Array, NDArray[np.bool_]]:
        """Measured torques, (k, n), N m, of true ones, and which samples arrive, (k,)."""
        noise = 1.0 + self.noise * random.standard_normal(torque.shape)
        late = np.concatenate((np.zeros((self.delay, torque.shape[1])), torque))[: len(torque)]
        measured: Array = late * np.array(self.scale) * noise
        return measured, random.random(len(torque)) >= self.dropped


EXACT: Final = MeasuredSignals()
