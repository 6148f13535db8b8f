# SPDX-License-Identifier: Apache-2.0
"""Tensors of the caller, checked: on the CPU, of one floating type, of the right shape."""

from __future__ import annotations

from typing import Any, Optional, Sequence

import numpy as np
import torch

from tilegrad._arrays import as_indices, Axis, check_shape, Sizes, thread_count
from tilegrad._dense import check_dense

_FLOATS = (torch.float32, torch.float64)


def check_tensor(function: str, argument: str, value: Any, shape: Sequence[Axis],
                 sizes: Optional[Sizes] = None) -> None:
    """TypeError unless `value` is a dense tensor on the CPU, ValueError unless it is of `shape`:
    see tilegrad._arrays.check_shape."""
    if not isinstance(value, torch.Tensor):
        raise TypeError(f"{function}: {argument} is {type(value).__name__}, expected torch.Tensor")
    check_dense(function, argument, value)
    check_shape(function, argument, tuple(value.shape), shape, sizes)


def check_floats(function: str, argument: str, value: Any, shape: Sequence[Axis],
                 sizes: Optional[Sizes] = None, like: Optional[torch.Tensor] = None) -> None:
    """As check_tensor, and TypeError unless `value` is float32 or float64, and of the dtype of
    `like` where that is given."""
    check_tensor(function, argument, value, shape, sizes)
    if value.dtype not in _FLOATS:
        raise TypeError(f"{function}: {argument} has dtype {value.dtype}, expected torch.float32 "
                        f"or torch.float64 (.float() makes it one)")
    if like is not None and value.dtype != like.dtype:
        raise TypeError(f"{function}: {argument} has dtype {value.dtype}, the tensors before it "
                        f"{like.dtype}")


def check_finite(function: str, argument: str, value: Any, shape: Sequence[Axis],
                 sizes: Optional[Sizes] = None, like: Optional[torch.Tensor] = None) -> None:
    """As check_floats, and ValueError unless all of `value` is finite."""
    check_floats(function, argument, value, shape, sizes, like)
    if not torch.isfinite(value).all():
        raise ValueError(f"{function}: {argument} has numbers that are not finite")


def check_whole(function: str, argument: str, value: Any, shape: Sequence[Axis],
                sizes: Optional[Sizes] = None) -> None:
    """As check_tensor, and TypeError unless `value` is of an integer type."""
    check_tensor(function, argument, value, shape, sizes)
    if value.is_floating_point() or value.dtype == torch.bool:
        raise TypeError(f"{function}: {argument} has dtype {value.dtype}, expected torch.int64")


def check_not_empty(function: str, argument: str, tensor: torch.Tensor, things: str) -> None:
    """ValueError if the second axis of `tensor`, [B,N,...], has length 0: what would be a mean over
    it, or a least one, is NaN."""
    if not tensor.shape[1]:
        raise ValueError(f"{function}: {argument} has no {things}")


def check_up(function: str, up: torch.Tensor, backward: torch.Tensor) -> None:
    """ValueError where `up` [C,3] tells no direction across the view, whose unit vectors are
    `backward` [C,3]: such a camera would show nothing."""
    across = torch.cross(up.detach(), backward.detach(), dim=-1).norm(dim=-1)
    lost = (across <= 1e-6 * up.detach().norm(dim=-1)).nonzero()
    if len(lost):
        raise ValueError(f"{function}: camera {int(lost[0])}: up is 0 or along the view, or the "
                         "camera coincides with its target; give another up")


def to_numpy(tensor: torch.Tensor) -> np.ndarray:
    """The tensor's memory as an array; of a copy if it is not contiguous."""
    return tensor.detach().resolve_neg().contiguous().numpy()


def surface_tools() -> Any:
    """The module with the engine's metrics of surfaces. ImportError in builds without files and
    training."""
    from tilegrad import _tools
    return _tools


def threads() -> int:
    """As many as TILEGRAD_THREADS says; where it is not set as torch uses, which is one in a
    worker of a DataLoader."""
    return thread_count("tilegrad.compat", 0) or torch.get_num_threads()


# What operations of nvdiffrast share.

def triangles(function: str, tri: Any) -> np.ndarray:
    """`tri` as an array [F, 3] of int32; ValueError if it is another shape or out of range."""
    check_tensor(function, "tri", tri, ("F", 3))
    return as_indices(function, "tri", tri, ("F", 3))


def vertex_rows(function: str, argument: str, value: Any, channels: Any, sizes: Sizes,
                like: Optional[torch.Tensor] = None) -> None:
    """`value` is [N, V, channels], or [V, channels] for all images; N is looked up in `sizes`."""
    shared = isinstance(value, torch.Tensor) and value.dim() == 2
    shape = ("V", channels) if shared else ("N", "V", channels)
    check_floats(function, argument, value, shape, sizes, like)


def optional_numpy(tensor: Optional[torch.Tensor]) -> Optional[np.ndarray]:
    """The memory of a tensor that may be absent."""
    return None if tensor is None else to_numpy(tensor)


def optional_tensor(array: Optional[np.ndarray]) -> Optional[torch.Tensor]:
    """A tensor over an array that may be absent."""
    return None if array is None else torch.from_numpy(array)
