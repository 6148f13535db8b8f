# SPDX-License-Identifier: Apache-2.0
"""tilegrad: a differentiable rasterizer for CPUs, with NumPy arrays in and out."""

from tilegrad._arrays import reset_stats, stats
from tilegrad._core import __version__, simd_target

__all__ = ["__version__", "reset_stats", "simd_target", "stats"]
