# SPDX-License-Identifier: Apache-2.0
"""Rotations of numbers that optimisers may move freely."""

from __future__ import annotations

import torch

from tilegrad._dense import check_dense, full_precision


@full_precision
def rotation_6d(numbers: torch.Tensor) -> torch.Tensor:
    """Rotations (..., 3, 3) of six free numbers (..., 6): their first two rows, made orthonormal
    (Y. Zhou et al.: On the continuity of rotation representations in neural networks, 2019).

    TypeError if they are not real numbers, ValueError if they are not six, or where the first three
    are 0 or the last three parallel to them.
    """
    if not isinstance(numbers, torch.Tensor) or numbers.dtype not in (torch.float32, torch.float64):
        kind = getattr(numbers, "dtype", type(numbers).__name__)
        raise TypeError(f"rotation_6d: numbers have dtype {kind}, expected torch.float32 or "
                        f"torch.float64")
    check_dense("rotation_6d", "numbers", numbers)
    if numbers.ndim < 1 or numbers.shape[-1] != 6:
        raise ValueError(f"rotation_6d: numbers have shape {tuple(numbers.shape)}, expected "
                         f"(..., 6)")
    first, second = numbers[..., :3], numbers[..., 3:]
    x = torch.nn.functional.normalize(first, dim=-1)
    across = second - (x * second).sum(-1, keepdim=True) * x
    y = torch.nn.functional.normalize(across, dim=-1)
    z = torch.cross(x, y, dim=-1)
    with torch.no_grad():
        rounding = 8 * torch.finfo(numbers.dtype).eps * second.norm(dim=-1)
        if not ((z.norm(dim=-1) > 0.5) & (across.norm(dim=-1) > rounding)).all():
            raise ValueError("rotation_6d: of six numbers the first three are 0, or the last "
                             "three parallel to them")
    return torch.stack([x, y, z], dim=-2)
