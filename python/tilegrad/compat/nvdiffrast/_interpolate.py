# SPDX-License-Identifier: Apache-2.0
"""interpolate."""

from __future__ import annotations

from typing import Any, NamedTuple, Optional, Sequence, Union

import numpy as np
import torch

from tilegrad import _core
from tilegrad._arrays import as_array, check_indices, Sizes
from tilegrad._dense import first_derivative_only, full_precision
from tilegrad.compat import _tensors


class _Call(NamedTuple):
    tri: np.ndarray
    diff_attrs: np.ndarray

    def record(self, rast: torch.Tensor, rast_db: Optional[torch.Tensor]) -> _core.InterpolateCall:
        return _core.InterpolateCall(
            tri=self.tri, rast=_tensors.to_numpy(rast), rast_db=_tensors.optional_numpy(rast_db),
            diff_attrs=self.diff_attrs, threads=_tensors.threads())


class _Interpolate(torch.autograd.Function):
    @staticmethod
    def forward(ctx, attr, rast, rast_db, call):
        out, out_da = map(torch.from_numpy, _core.nvdiffrast_interpolate(
            _tensors.to_numpy(attr), call.record(rast, rast_db)))
        ctx.save_for_backward(attr, rast, rast_db)
        ctx.call = call
        return out, out_da

    @staticmethod
    @first_derivative_only
    def backward(ctx, d_out, d_out_da):
        attr, rast, rast_db = ctx.saved_tensors
        gradients = _core.nvdiffrast_interpolate_backward(
            _tensors.to_numpy(attr), ctx.call.record(rast, rast_db), _tensors.to_numpy(d_out),
            _tensors.to_numpy(d_out_da), list(ctx.needs_input_grad[:3]))
        return (*map(_tensors.optional_tensor, gradients), None)


@full_precision
def interpolate(attr: torch.Tensor, rast: torch.Tensor, tri: torch.Tensor,
                rast_db: Optional[torch.Tensor] = None,
                diff_attrs: Union[None, str, Sequence[int]] = None) -> tuple:
    """Attributes of vertices over the pixels.

    attr: [N, V, A], [1, V, A] for all images, or [V, A] (range mode). rast: [N, H, W, 4] of
    `rasterize`, rast_db its second result. tri: [F, 3] int32. diff_attrs: the attributes whose
    derivatives by X and Y are computed, a list of numbers or 'all'; needs rast_db.

    Returns [N, H, W, A], zeros at background pixels, and [N, H, W, 2 D]: (dA/dX, dA/dY) of each
    of the D attributes of diff_attrs, D = 0 without it. Gradients flow to attr, to u and v of rast,
    and to rast_db.

    TypeError, ValueError: an argument is not as above, or an index is out of range.
    """
    sizes: Sizes = {}
    _tensors.check_floats("interpolate", "rast", rast, ("N", "H", "W", 4), sizes)
    everywhere = isinstance(attr, torch.Tensor) and attr.dim() == 3 and attr.shape[0] == 1
    _tensors.vertex_rows("interpolate", "attr", attr, "A", {} if everywhere else sizes, rast)
    if attr.shape[-1] == 0:
        raise ValueError("interpolate: attr has no attributes, its last axis is 0")
    numbers = _diff_attrs(diff_attrs, rast_db, attr.shape[-1])
    if len(numbers):
        _tensors.check_floats("interpolate", "rast_db", rast_db, ("N", "H", "W", 4), sizes, rast)
    return _Interpolate.apply(attr[0] if everywhere else attr, rast,
                              rast_db if len(numbers) else None,
                              _Call(_tensors.triangles("interpolate", tri), numbers))


def _diff_attrs(diff_attrs: Any, rast_db: Any, attributes: int) -> np.ndarray:
    """The numbers of attributes; none without rast_db."""
    if diff_attrs is None or rast_db is None:
        return np.zeros(0, np.int32)
    if isinstance(diff_attrs, str):
        if diff_attrs != "all":
            raise ValueError(f"interpolate: diff_attrs is {diff_attrs!r}, expected 'all' or a list "
                             f"of numbers")
        return np.arange(attributes, dtype=np.int32)
    numbers = as_array("interpolate", "diff_attrs", diff_attrs, np.int32, ("D",))
    check_indices("interpolate", "diff_attrs", numbers, attributes)
    return numbers
