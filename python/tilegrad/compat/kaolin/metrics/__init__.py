# SPDX-License-Identifier: Apache-2.0
"""kaolin.metrics: pointcloud, render, trianglemesh, voxelgrid."""

from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.metrics import pointcloud, render, trianglemesh, voxelgrid

__all__ = ["pointcloud", "render", "trianglemesh", "voxelgrid"]

__getattr__ = missing_from(__name__)
