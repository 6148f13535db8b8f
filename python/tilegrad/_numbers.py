# SPDX-License-Identifier: Apache-2.0
"""Detects colours in bytes where 0 to 1 is expected."""

from __future__ import annotations

import warnings
from typing import Any, Sequence

import numpy as np

from tilegrad import _arrays


def refuse_bytes(function: str, argument: str, value: Any, dtype: Any) -> None:
    """TypeError if `value` is of bytes where 0 to 1 is expected: the result would silently be 255
    times too bright."""
    array = value if type(value) is np.ndarray else _arrays.foreign(function, argument, value)
    if array.dtype == np.uint8:
        raise TypeError(f"{function}: {argument} has dtype uint8, expected {dtype} from 0 to 1: "
                        f"divide by 255")


def warn_of_bytes(function: str, argument: str, array: np.ndarray) -> None:
    """Warns if floating-point colours look like bytes, 0 to 255, where 0 to 1 is expected: most
    of those that are not black exceed 1. Highlights may. Checks about 4096 numbers."""
    sample = np.ravel(array)[::max(1, array.size // 4096)]
    colored = sample[sample > 0]
    if colored.size == 0 or not 2 < colored.max() <= 255 or np.mean(colored > 1) <= 0.5:
        return
    warnings.warn(f"{function}: {argument} has numbers up to {colored.max():g}, expected 0 "
                  f"to 1: divide by 255 if they are bytes", RuntimeWarning, stacklevel=5)


def as_colors(function: str, argument: str, value: Any, dtype: Any, shape: Sequence[_arrays.Axis],
              sizes: _arrays.Sizes) -> np.ndarray:
    """As `as_batched`; refuses bytes, and warns of numbers that look like them."""
    refuse_bytes(function, argument, value, dtype)
    array = _arrays.as_batched(function, argument, value, dtype, shape, sizes)
    warn_of_bytes(function, argument, array)
    return array
