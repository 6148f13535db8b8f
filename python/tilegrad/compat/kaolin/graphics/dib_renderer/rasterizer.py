# SPDX-License-Identifier: Apache-2.0
"""kaolin.graphics.dib_renderer.rasterizer."""

from __future__ import annotations

from typing import Optional

import torch

from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.render.mesh import dibr_rasterization

__getattr__ = missing_from(__name__)


def linear_rasterizer(height: int, width: int, points3d_bxfx9: torch.Tensor,
                      points2d_bxfx6: torch.Tensor, normalz_bxfx1: torch.Tensor,
                      vertex_attr_bxfx3d: torch.Tensor, expand: Optional[float] = None,
                      knum: Optional[int] = None, multiplier: Optional[float] = None,
                      delta: Optional[float] = None) -> tuple[torch.Tensor, torch.Tensor]:
    """render.mesh.dibr_rasterization, with a face's three corners side by side: in the camera
    [B,F,9], on the image plane [B,F,6], attributes [B,F,3D]; normals' z [B,F,1].

    expand, knum, delta: boxlen, knum and sigmainv there; None is 0.02, 30, 7000.
    Returns attributes [B,H,W,D] and the soft mask [B,H,W,1].
    """
    batch, faces = points3d_bxfx9.shape[:2]
    corners, on_image, features = (t.reshape(batch, faces, 3, -1) for t in (
        points3d_bxfx9, points2d_bxfx6, vertex_attr_bxfx3d))
    image, mask, _ = dibr_rasterization(
        height, width, corners[..., 2], on_image, features, normalz_bxfx1,
        7000 if delta is None else delta, 0.02 if expand is None else expand,
        30 if knum is None else knum, multiplier)
    return image, mask.unsqueeze(-1)
