"""Array aliases; shapes stand in the docstrings."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["ArrayLike", "BoolArray", "ComplexArray", "FloatArray", "IntArray", "NDArray"]

FloatArray: TypeAlias = NDArray[np.float64]
ComplexArray: TypeAlias = NDArray[np.complex128]
BoolArray: TypeAlias = NDArray[np.bool_]
# Integer arrays come as uint8, uint32 or int64; the docstring names the width.
IntArray: TypeAlias = NDArray[Any]
