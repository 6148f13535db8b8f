# SPDX-License-Identifier: Apache-2.0
"""antialias."""

from __future__ import annotations

from typing import NamedTuple, Optional

import numpy as np
import torch

from tilegrad import _core
from tilegrad._arrays import Sizes
from tilegrad._dense import first_derivative_only, full_precision
from tilegrad.compat import _tensors


class TopologyHash:
    """Which triangles share an edge: what `antialias_construct_topology_hash` returns."""

    def __init__(self, tri: np.ndarray) -> None:
        self.rings = _core.EdgeRings(tri)


class _Call(NamedTuple):
    tri: np.ndarray
    rings: _core.EdgeRings
    pos_gradient_boost: float


class _Antialias(torch.autograd.Function):
    @staticmethod
    def forward(ctx, color, rast, pos, call):
        ctx.save_for_backward(color, rast, pos)
        ctx.call = call
        return torch.from_numpy(_core.nvdiffrast_antialias(
            _tensors.to_numpy(color), _tensors.to_numpy(rast), _tensors.to_numpy(pos), call.tri,
            call.rings, _tensors.threads()))

    @staticmethod
    @first_derivative_only
    def backward(ctx, d_out):
        color, rast, pos = ctx.saved_tensors
        wanted = [ctx.needs_input_grad[0], ctx.needs_input_grad[2]]
        d_color, d_pos = map(_tensors.optional_tensor, _core.nvdiffrast_antialias_backward(
            _tensors.to_numpy(color), _tensors.to_numpy(rast), _tensors.to_numpy(pos),
            ctx.call.tri, ctx.call.rings, _tensors.to_numpy(d_out), wanted, _tensors.threads()))
        if d_pos is not None and ctx.call.pos_gradient_boost != 1.0:
            d_pos *= ctx.call.pos_gradient_boost
        return d_color, None, d_pos, None


@full_precision
def antialias(color: torch.Tensor, rast: torch.Tensor, pos: torch.Tensor, tri: torch.Tensor,
              topology_hash: Optional[TopologyHash] = None,
              pos_gradient_boost: float = 1.0) -> torch.Tensor:
    """`color` with smooth silhouettes; through them the gradient of what is seen flows to pos.

    color: [N, H, W, C]. rast: [N, H, W, 4] of `rasterize`; pos and tri are what it was given.
    topology_hash: of tri, to reuse it. pos_gradient_boost: factor of the
    gradient of pos.

    Vertices that triangles share must be the same index, or every edge is a silhouette. Returns
    an image like color. Gradients flow to color, and to x, y and w of pos.

    TypeError, ValueError: an argument is not as above, an index is out of range, or pos is not
    finite.
    """
    sizes: Sizes = {}
    _tensors.check_floats("antialias", "color", color, ("N", "H", "W", "C"), sizes)
    _tensors.check_floats("antialias", "rast", rast, ("N", "H", "W", 4), sizes, color)
    _tensors.vertex_rows("antialias", "pos", pos, 4, sizes, color)
    _tensors.check_finite("antialias", "pos", pos, pos.shape)
    triangles = _tensors.triangles("antialias", tri)
    if topology_hash is None:
        topology_hash = TopologyHash(triangles)
    if not isinstance(topology_hash, TopologyHash):
        raise TypeError(f"antialias: topology_hash is {type(topology_hash).__name__}, expected "
                        f"what antialias_construct_topology_hash returns")
    return _Antialias.apply(color, rast, pos,
                            _Call(triangles, topology_hash.rings, float(pos_gradient_boost)))


def antialias_construct_topology_hash(tri: torch.Tensor) -> TopologyHash:
    """For `antialias`: of a tri [F, 3] that stays the same, made once."""
    return TopologyHash(_tensors.triangles("antialias_construct_topology_hash", tri))
