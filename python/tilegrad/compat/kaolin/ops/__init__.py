# SPDX-License-Identifier: Apache-2.0
"""kaolin.ops: mesh, pointcloud."""

from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.ops import mesh, pointcloud

__all__ = ["mesh", "pointcloud"]

__getattr__ = missing_from(__name__)
