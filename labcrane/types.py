"""Arrays of numbers.

Apart from what makes no arrays itself, so that a protocol is checked without loading numpy.
"""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
"""Numbers in float64; who gives or takes them says their shape and unit."""
