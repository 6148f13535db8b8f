# SPDX-License-Identifier: Apache-2.0
"""kaolin.ops: conversions, coords, mesh, pointcloud."""

from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.ops import conversions, coords, mesh, pointcloud

__all__ = ["conversions", "coords", "mesh", "pointcloud"]

__getattr__ = missing_from(__name__)
