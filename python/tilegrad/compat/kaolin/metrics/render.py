# SPDX-License-Identifier: Apache-2.0
"""kaolin.metrics.render."""

import torch

from tilegrad.compat._tensors import check_floats

_EPS = 1e-10


def mask_iou(lhs_mask: torch.Tensor, rhs_mask: torch.Tensor) -> torch.Tensor:
    """1 - the mean over images of sum(ab) / sum(a + b - ab): the paper's silhouette loss. Masks:
    [B,H,W], in [0, 1]. Returns a scalar."""
    sizes: dict = {}
    check_floats("mask_iou", "lhs_mask", lhs_mask, ("B", "H", "W"), sizes)
    check_floats("mask_iou", "rhs_mask", rhs_mask, ("B", "H", "W"), sizes, lhs_mask)
    both = lhs_mask * rhs_mask
    union = (lhs_mask + rhs_mask - both).sum(dim=(1, 2)) + _EPS
    return 1 - (both.sum(dim=(1, 2)) / union).mean()
