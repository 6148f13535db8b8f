# SPDX-License-Identifier: Apache-2.0
"""kaolin.metrics.render."""

import torch

from tilegrad._dense import full_precision
from tilegrad.compat._tensors import check_finite, check_tensor
from tilegrad.compat.kaolin._missing import missing_from

__getattr__ = missing_from(__name__)

_EPS = 1e-10


@full_precision
def mask_iou(lhs_mask: torch.Tensor, rhs_mask: torch.Tensor) -> torch.Tensor:
    """1 - the mean over images of sum(ab) / sum(a + b - ab): the paper's silhouette loss. Masks:
    [B,H,W], in [0, 1]; bool, integers, and a dtype each are fine. Returns a scalar of the wider
    dtype, float32 at least. ValueError: a number that is not finite."""
    sizes: dict = {}
    check_tensor("mask_iou", "lhs_mask", lhs_mask, ("B", "H", "W"), sizes)
    check_tensor("mask_iou", "rhs_mask", rhs_mask, ("B", "H", "W"), sizes)
    if not len(lhs_mask):
        raise ValueError("mask_iou: the masks have no images, which have no mean")
    dtype = torch.promote_types(torch.promote_types(lhs_mask.dtype, rhs_mask.dtype), torch.float32)
    lhs_mask, rhs_mask = lhs_mask.to(dtype), rhs_mask.to(dtype)
    for argument, mask in (("lhs_mask", lhs_mask), ("rhs_mask", rhs_mask)):
        check_finite("mask_iou", argument, mask, mask.shape)
    both = lhs_mask * rhs_mask
    union = (lhs_mask + rhs_mask - both).sum(dim=(1, 2)) + _EPS
    return 1 - (both.sum(dim=(1, 2)) / union).mean()
