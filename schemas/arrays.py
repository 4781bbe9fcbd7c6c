"""The numpy array type of numeric code."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Double precision of any shape; docstrings give the shape. Fields of messages use ``base.Array`` instead."""
