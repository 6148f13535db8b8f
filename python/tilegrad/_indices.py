# SPDX-License-Identifier: Apache-2.0
"""Arrays of indices, which rarely change and often have another integer type than int32."""

from __future__ import annotations

import weakref
from typing import Any, Optional, Sequence

import numpy as np

from tilegrad import _arrays

_copies: dict[int, tuple[Any, Any]] = {}  # by id of an array: a weak reference to it, and its copy


def as_indices(function: str, argument: str, value: Any, shape: Sequence[_arrays.Axis],
               sizes: Optional[_arrays.Sizes] = None) -> np.ndarray:
    """As `as_array` of int32. An array that must be copied is copied once; the copy is reused while
    the array keeps its values."""
    if isinstance(value, _arrays.NUMBERS):
        return _arrays.as_array(function, argument, value, np.int32, shape, sizes)
    array = value if type(value) is np.ndarray else _arrays.foreign(function, argument, value)
    owner, copy = _copies.get(id(value), (None, None))
    if owner is not None and owner() is value and np.array_equal(copy, array):
        _arrays.count_array()
    else:
        copy = _arrays.contiguous(function, argument, array, np.int32)
        if copy is not array:
            _keep_copy(value, copy)
    _arrays.check_shape(function, argument, copy.shape, shape, sizes)
    return copy


def _keep_copy(value: Any, copy: np.ndarray) -> None:
    """As long as `value` lives."""
    key = id(value)

    def forget(reference: Any) -> None:
        if _copies.get(key, (None, None))[0] is reference:
            del _copies[key]

    copy.flags.writeable = False  # others may share it
    try:
        _copies[key] = (weakref.ref(value, forget), copy)
    except TypeError:  # without a weak reference
        pass
