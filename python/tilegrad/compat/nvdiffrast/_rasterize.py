# SPDX-License-Identifier: Apache-2.0
"""rasterize, and DepthPeeler."""

from __future__ import annotations

import math
import warnings
from typing import Any, NamedTuple, Optional, Sequence

import numpy as np
import torch

from tilegrad import _core
from tilegrad._arrays import as_array, as_flag, MOST_PIXELS, Sizes
from tilegrad._dense import first_derivative_only, full_precision
from tilegrad.compat import _tensors

_WARNING = 1  # nvdiffrast's levels: 0 information, 1 warning, 2 error, 3 fatal
_log_level = _WARNING
_warned: set[str] = set()


def get_log_level() -> int:
    """The level that `set_log_level` has set; 1 at first."""
    return _log_level


def set_log_level(level: int) -> None:
    """0 information, 1 warning, 2 error, 3 fatal. From 2 on, this module does not
    warn."""
    global _log_level
    if level not in (0, 1, 2, 3):
        raise ValueError(f"set_log_level: level is {level!r}, expected 0, 1, 2 or 3")
    _log_level = level


class RasterizeCpuContext:
    """Scratch memory for `rasterize`. Threads may share one context.

    device: None, or the CPU by any of torch's names.
    """

    def __init__(self, device: Any = None) -> None:
        if device is not None and torch.device(device).type != "cpu":
            raise ValueError(f"{type(self).__name__}: device is {device!r}, but tilegrad renders "
                             f"on the CPU: device='cpu', or none")
        self.rasterizer = _core.NvdiffrastRasterizer()


class _RenamedContext(RasterizeCpuContext):
    """Code that requests a GPU context gets a CPU context and one warning."""

    def __init__(self, device: Any = None) -> None:
        name = type(self).__name__
        if name not in _warned and _log_level <= _WARNING:
            _warned.add(name)
            warnings.warn(f"{name} of tilegrad.compat.nvdiffrast renders on the CPU and takes "
                          f"CPU tensors; it is an alias of RasterizeCpuContext.", stacklevel=3)
        super().__init__(None)


class RasterizeCudaContext(_RenamedContext):
    """RasterizeCpuContext by nvdiffrast's name; `device` is ignored."""

    def __init__(self, device: Any = None) -> None:
        super().__init__(device)


class RasterizeGLContext(_RenamedContext):
    """RasterizeCpuContext by nvdiffrast's older name. The other arguments chose how OpenGL works
    and are ignored."""

    def __init__(self, output_db: bool = True, mode: str = "automatic", device: Any = None) -> None:
        super().__init__(device)


Images = tuple  # of two tensors


class _Call(NamedTuple):
    """Everything but `pos`, checked."""
    context: RasterizeCpuContext
    tri: np.ndarray
    ranges: Optional[np.ndarray]
    resolution: tuple[int, int]
    grad_db: bool


class _Rasterize(torch.autograd.Function):
    @staticmethod
    def forward(ctx, pos, call, peeled):
        rast, rast_db = map(torch.from_numpy, call.context.rasterizer.rasterize(
            _tensors.to_numpy(pos), call.tri, call.ranges, *call.resolution, peeled,
            _tensors.threads()))
        ctx.set_materialize_grads(False)
        ctx.save_for_backward(pos, rast)
        ctx.call = call
        return rast, rast_db

    @staticmethod
    @first_derivative_only
    def backward(ctx, d_rast, d_rast_db):
        pos, rast = ctx.saved_tensors
        if not ctx.call.grad_db:
            d_rast_db = None
        if d_rast is None and d_rast_db is None:
            return None, None, None
        d_pos = _core.nvdiffrast_rasterize_backward(
            _tensors.to_numpy(pos), ctx.call.tri, _tensors.to_numpy(rast),
            _tensors.optional_numpy(d_rast), _tensors.optional_numpy(d_rast_db), _tensors.threads())
        return torch.from_numpy(d_pos), None, None


@full_precision
def rasterize(glctx: RasterizeCpuContext, pos: torch.Tensor, tri: torch.Tensor,
              resolution: Sequence[int], ranges: Optional[torch.Tensor] = None,
              grad_db: bool = True) -> Images:
    """The nearest triangle in every pixel, and where on it.

    pos: [N, V, 4], or [V, 4] with ranges: vertices in clip space. tri: [F, 3] int32.
    resolution: (height, width), each 1 to 16384. ranges: [N, 2] int32, for each image the first
    triangle and how many; only with pos [V, 4]. grad_db: whether gradients of the second result
    flow to pos.

    Returns two images [N, height, width, 4], the bottom row first: (u, v, z/w, triangle id + 1),
    zeros at background pixels, and (du/dX, du/dY, dv/dX, dv/dY) per pixel. u and v are the weights
    of the first and the second vertex. Gradients flow from u, v and the second image to x, y and w
    of pos.

    TypeError, ValueError: an argument is not as above, an index is out of range, or pos is not
    finite.
    """
    return _Rasterize.apply(pos, _checked("rasterize", glctx, pos, tri, resolution, ranges,
                                          grad_db), None)


class DepthPeeler:
    """Layers of a scene, one behind the other: the arguments are those of `rasterize`.

        with DepthPeeler(glctx, pos, tri, resolution) as peeler:
            for i in range(layers):
                rast, rast_db = peeler.rasterize_next_layer()

    Of several triangles at one depth in a pixel only one is ever seen.
    """

    def __init__(self, glctx: RasterizeCpuContext, pos: torch.Tensor, tri: torch.Tensor,
                 resolution: Sequence[int], ranges: Optional[torch.Tensor] = None,
                 grad_db: bool = True) -> None:
        self._pos = pos
        self._call = _checked("DepthPeeler", glctx, pos, tri, resolution, ranges, grad_db)
        self._peeled: Optional[np.ndarray] = None

    def __enter__(self) -> DepthPeeler:
        images = len(self._pos if self._call.ranges is None else self._call.ranges)
        self._peeled = np.full((images, *self._call.resolution), math.inf, np.float32)
        return self

    def __exit__(self, *exception: Any) -> None:
        self._peeled = None

    def rasterize_next_layer(self) -> Images:
        """As `rasterize`; triangles not farther than those of the layers before are left out."""
        if self._peeled is None:
            raise RuntimeError("DepthPeeler: rasterize_next_layer outside of its with block")
        return _Rasterize.apply(self._pos, self._call, self._peeled)


def _checked(function: str, glctx: Any, pos: Any, tri: Any, resolution: Any, ranges: Any,
             grad_db: bool) -> _Call:
    if not isinstance(glctx, RasterizeCpuContext):
        raise TypeError(f"{function}: glctx is {type(glctx).__name__}, expected "
                        f"RasterizeCpuContext")
    sizes: Sizes = {}
    _tensors.vertex_rows(function, "pos", pos, 4, sizes)
    if pos.dim() == 2:
        if ranges is None:
            raise ValueError(f"{function}: pos is (V, 4), which needs ranges (N, 2); without them "
                             f"it must be (N, V, 4)")
        _tensors.check_tensor(function, "ranges", ranges, ("N", 2), sizes)
        ranges = as_array(function, "ranges", ranges.detach().contiguous().numpy(), np.int32,
                          ("N", 2))
    else:
        ranges = None  # ignored in instanced mode, as nvdiffrast does
    height, width = _resolution(function, resolution)
    return _Call(glctx, _tensors.triangles(function, tri), ranges, (height, width),
                 as_flag(function, "grad_db", grad_db))


def _resolution(function: str, resolution: Any) -> tuple[int, int]:
    numbers = tuple(resolution) if isinstance(resolution, (tuple, list, torch.Size)) else ()
    try:
        if len(numbers) == 2 and all(int(n) == n and 1 <= n <= MOST_PIXELS for n in numbers):
            return int(numbers[0]), int(numbers[1])
    except (TypeError, ValueError, OverflowError):
        pass  # no number, NaN, infinity
    raise ValueError(f"{function}: resolution is {resolution!r}, expected (height, width), each 1 "
                     f"to {MOST_PIXELS}")
