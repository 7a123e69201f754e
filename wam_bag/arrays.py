"""Types of arrays."""

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
Numbers = NDArray[np.float64]
Rows = NDArray[np.int64]
Texts = NDArray[np.object_]
Times = NDArray[np.int64]  # ns
