# SPDX-License-Identifier: Apache-2.0
"""tilegrad: a differentiable rasterizer for CPUs, with NumPy arrays in and out."""

from importlib import import_module as _import_module
from typing import Any as _Any

from tilegrad._arrays import reset_stats, stats
from tilegrad._camera import Camera
from tilegrad._core import __version__, simd_target
from tilegrad._renderer import Frame, Gradients, Renderer
from tilegrad._scene import Light, Scene, Surface, Texture
from tilegrad._shapes import icosphere

_MODULES = ("cameras", "compat", "dataset", "files", "fragments", "images", "meshes", "predict",
            "losses", "runs", "selftest", "torch", "weights")  # imported at first use: `tilegrad.files.load_mesh(...)`

_FUNCTIONS = {"fit": "runs", "render": "_show", "train": "runs"}  # likewise


def __getattr__(name: str) -> _Any:
    if name in _FUNCTIONS:
        return getattr(_import_module(f"tilegrad.{_FUNCTIONS[name]}"), name)
    if name not in _MODULES:
        raise AttributeError(f"module 'tilegrad' has no attribute {name!r}")
    return _import_module(f"tilegrad.{name}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES, *_FUNCTIONS})


__all__ = ["Camera", "Frame", "Gradients", "Light", "Renderer", "Scene", "Surface", "Texture",
           "__version__", "icosphere", "reset_stats", "simd_target", "stats"]
