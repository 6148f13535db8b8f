# SPDX-License-Identifier: Apache-2.0
"""kaolin.ops.coords: z up, azimuth from x towards y, radians."""

from __future__ import annotations

from typing import Optional, Union

import torch

from tilegrad.compat.kaolin._missing import missing_from

__getattr__ = missing_from(__name__)

_Three = tuple[torch.Tensor, torch.Tensor, torch.Tensor]


def spherical2cartesian(azimuth: torch.Tensor, elevation: torch.Tensor,
                        distance: Optional[Union[torch.Tensor, float]] = None) -> _Three:
    """x, y, z. distance: None is 1."""
    distance = 1 if distance is None else distance
    across = torch.cos(elevation) * distance
    return torch.cos(azimuth) * across, torch.sin(azimuth) * across, torch.sin(elevation) * distance


def cartesian2spherical(x: torch.Tensor, y: torch.Tensor, z: torch.Tensor) -> _Three:
    """azimuth, elevation, distance."""
    across = torch.hypot(x, y)
    return torch.atan2(y, x), torch.atan2(z, across), torch.hypot(across, z)
