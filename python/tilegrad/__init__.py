# SPDX-License-Identifier: Apache-2.0
"""tilegrad: a differentiable rasterizer for CPUs, with NumPy arrays in and out."""

from importlib import import_module as _import_module
from importlib.util import find_spec as _find_spec
from typing import Any as _Any

from tilegrad._arrays import reset_stats, stats
from tilegrad._camera import Camera
from tilegrad._core import __version__, simd_target
from tilegrad._renderer import Frame, Gradients, Renderer
from tilegrad._scene import Light, Scene, Surface, Texture
from tilegrad._shapes import icosphere

# Imported at first use: `tilegrad.files.load_mesh(...)`.
_MODULES = ("compat", "fragments", "torch")
# Those of `_tools`, which builds with TILEGRAD_PROGRAM=OFF lack; and functions of such modules.
_TOOL_MODULES = ("cameras", "dataset", "files", "images", "losses", "meshes", "predict", "runs",
                 "weights")
_FUNCTIONS = {"fit": "runs", "render": "_show", "train": "runs"}
_HAS_TOOLS = _find_spec("tilegrad._tools") is not None
_WITHOUT_TOOLS = "this build of tilegrad has the renderer only (TILEGRAD_PROGRAM=OFF)"


def __getattr__(name: str) -> _Any:
    if name == "_tools":
        if not _HAS_TOOLS:
            raise ImportError(_WITHOUT_TOOLS)
        return _import_module("tilegrad._tools")
    if name not in _MODULES and name not in _TOOL_MODULES and name not in _FUNCTIONS:
        raise AttributeError(f"module 'tilegrad' has no attribute {name!r}")
    if name not in _MODULES and not _HAS_TOOLS:
        raise AttributeError(f"module 'tilegrad' has no attribute {name!r}: {_WITHOUT_TOOLS}")
    if name in _FUNCTIONS:
        return getattr(_import_module(f"tilegrad.{_FUNCTIONS[name]}"), name)
    return _import_module(f"tilegrad.{name}")


def __dir__() -> list[str]:
    names = {*globals(), *_MODULES, *(_HAS_TOOLS * (*_TOOL_MODULES, *_FUNCTIONS))}
    return sorted(names if _find_spec("torch") else names - {"torch"})  # help() imports them all


__all__ = ["Camera", "Frame", "Gradients", "Light", "Renderer", "Scene", "Surface", "Texture",
           "__version__", "icosphere", "reset_stats", "simd_target", "stats"]
