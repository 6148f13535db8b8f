# SPDX-License-Identifier: Apache-2.0
"""tilegrad: a differentiable rasterizer for CPUs, with NumPy arrays in and out."""

from tilegrad._arrays import reset_stats, stats
from tilegrad._camera import Camera
from tilegrad._core import __version__, simd_target
from tilegrad._renderer import Frame, Gradients, Renderer
from tilegrad._scene import Light, Scene, Surface, Texture
from tilegrad._shapes import icosphere

__all__ = ["Camera", "Frame", "Gradients", "Light", "Renderer", "Scene", "Surface", "Texture",
           "__version__", "icosphere", "reset_stats", "simd_target", "stats"]
