# SPDX-License-Identifier: Apache-2.0
"""Checks that several operations share."""

from __future__ import annotations

from typing import Any, Optional

import numpy as np
import torch

from tilegrad._arrays import Sizes
from tilegrad._indices import as_indices
from tilegrad.compat import _tensors


def triangles(function: str, tri: Any) -> np.ndarray:
    """`tri` as an array [F, 3] of int32; ValueError if it is another shape or out of range."""
    _tensors.check_tensor(function, "tri", tri, ("F", 3))
    return as_indices(function, "tri", tri, ("F", 3))


def vertex_rows(function: str, argument: str, value: Any, channels: Any, sizes: Sizes,
                like: Optional[torch.Tensor] = None) -> None:
    """`value` is [N, V, channels], or [V, channels] for all images; N is looked up in `sizes`."""
    shared = isinstance(value, torch.Tensor) and value.dim() == 2
    shape = ("V", channels) if shared else ("N", "V", channels)
    _tensors.check_floats(function, argument, value, shape, sizes, like)


def optional_numpy(tensor: Optional[torch.Tensor]) -> Optional[np.ndarray]:
    """The memory of a tensor that may be absent."""
    return None if tensor is None else _tensors.to_numpy(tensor)


def optional_tensor(array: Optional[np.ndarray]) -> Optional[torch.Tensor]:
    """A tensor over an array that may be absent."""
    return None if array is None else torch.from_numpy(array)
