# SPDX-License-Identifier: Apache-2.0
"""kaolin.ops.pointcloud: what its DIB-R examples use."""

from __future__ import annotations

import torch

from tilegrad.compat._tensors import check_floats, check_not_empty
from tilegrad.compat.kaolin._missing import missing_from

__getattr__ = missing_from(__name__)


def center_points(points: torch.Tensor, normalize: bool = False,
                  eps: float = 1e-6) -> torch.Tensor:
    """Moves the middle of each cloud's bounding box to the origin. points: [B,N,3].
    normalize: the longest side becomes 1, unless all sides are shorter than eps. Returns [B,N,3].
    """
    check_floats("center_points", "points", points, ("B", "N", 3))
    check_not_empty("center_points", "points", points, "points")
    low, high = points.min(dim=1, keepdim=True)[0], points.max(dim=1, keepdim=True)[0]
    centred = points - (low + high) / 2
    if not normalize:
        return centred
    side = (high - low).max(dim=-1, keepdim=True)[0]
    return centred / torch.where(side < eps, torch.ones_like(side), side)
