# SPDX-License-Identifier: Apache-2.0
"""Arguments of camera constructors: arrays with or without a leading axis, sizes of images."""

from __future__ import annotations

import math
from typing import Any, Iterable, Optional

import numpy as np

from tilegrad import _arrays

Size = tuple[int, int]  # width, height of an image, pixels


class Rows:
    """Arguments of a constructor as rows for C++: broadcasts their leading axes, and restores them
    in the result."""

    def __init__(self, function: str, **arguments: tuple[Any, tuple[int, ...]]) -> None:
        arrays = {}
        self.lead: tuple[int, ...] = ()
        for name, (value, shape) in arguments.items():
            array = _arrays.contiguous(function, name, value, np.float64)
            split = array.ndim - len(shape)
            if split not in (0, 1) or array.shape[split:] != shape:
                raise ValueError(f"{function}: {name} has shape {array.shape}, expected "
                                 f"{_arrays.shape_text(shape)} or "
                                 f"{_arrays.shape_text(('N', *shape))}")
            try:
                self.lead = np.broadcast_shapes(self.lead, array.shape[:split])
            except ValueError:
                raise ValueError(f"{function}: {name} has {array.shape[0]} cameras, expected "
                                 f"{self.lead[0]}") from None
            arrays[name] = (array, shape)
        self.arrays: Any = [self._rows(array, shape) for array, shape in arrays.values()]

    def _rows(self, array: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
        rows = np.broadcast_to(array, self.lead + shape)
        return np.ascontiguousarray(rows).reshape(-1, max(1, math.prod(shape)))

    def shaped(self, numbers: np.ndarray) -> np.ndarray:
        """(..., 17), with the leading axes of the arguments."""
        return numbers.reshape(self.lead + numbers.shape[-1:])


def size_of(function: str, width: int, height: int) -> Size:
    return (_arrays.as_number(function, "width", width, int),
            _arrays.as_number(function, "height", height, int))


def known_size(function: str, size: Any) -> Optional[Size]:
    """`size` as a pair of pixel counts; None (unknown) stays None."""
    if size is None:
        return None
    if not isinstance(size, (tuple, list)) or len(size) != 2:
        raise TypeError(f"{function}: size is {size!r}, expected (width, height) or None")
    width, height = size
    return (_arrays.as_pixels(function, "width", width),
            _arrays.as_pixels(function, "height", height))


def common_size(function: str, sizes: Iterable[Optional[Size]]) -> Optional[Size]:
    """The only known size; None if none is known. ValueError, naming `function`: several are."""
    known = sorted({size for size in sizes if size is not None})
    if len(known) > 1:
        several = " and ".join("{} x {}".format(*size) for size in known)
        raise ValueError(f"{function}: the scenes' cameras are for images of {several} pixels; "
                         f"make them one size, with camera.resize")
    return known[0] if known else None


def checked_size(function: str, own: Optional[Size], size: Size) -> Size:
    """`size`; ValueError, naming `function`, if `own`, a camera's, is known and different."""
    if own in (None, size):
        return size
    for name, pixels in zip(("width", "height"), size):
        _arrays.as_pixels(function, name, pixels)
    here, there = ("{} x {}".format(*numbers) for numbers in (own, size))
    call = ", ".join(map(str, (*own, *size)))
    raise ValueError(f"{function}: the camera is for images of {here} pixels, not {there}: give "
                     f"camera.resize({call})")


def filled_size(width: Any, height: Any, own: tuple[Any, Any]) -> tuple[Any, Any]:
    """Width and height of an image, those of `own` where one is None."""
    return own[0] if width is None else width, own[1] if height is None else height


def is_half(function: str, pixel_centre: str) -> bool:
    return _arrays.check_choice(function, "pixel_centre", pixel_centre, ("integer", "half")) == 1
