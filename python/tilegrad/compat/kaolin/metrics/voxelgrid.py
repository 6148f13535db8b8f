# SPDX-License-Identifier: Apache-2.0
"""kaolin.metrics.voxelgrid."""

import torch

from tilegrad.compat._tensors import check_tensor, surface_tools, to_numpy
from tilegrad.compat.kaolin._missing import missing_from

__getattr__ = missing_from(__name__)


def iou(pred: torch.Tensor, gt: torch.Tensor) -> torch.Tensor:
    """Voxels in both over voxels in either, those that are not 0: [B] float32; 1 where both are
    empty. pred, gt: [B,X,Y,Z]."""
    sizes: dict = {}
    check_tensor("iou", "pred", pred, ("B", "X", "Y", "Z"), sizes)
    check_tensor("iou", "gt", gt, ("B", "X", "Y", "Z"), sizes)
    grids = ((to_numpy((grid != 0).to(torch.uint8)).reshape(-1) for grid in pair)
             for pair in zip(pred, gt))
    return torch.tensor([surface_tools().voxel_iou(*pair) for pair in grids])
