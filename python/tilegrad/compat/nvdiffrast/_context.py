# SPDX-License-Identifier: Apache-2.0
"""Contexts: the memory that rasterizing reuses from call to call."""

from __future__ import annotations

import warnings
from typing import Any

import torch

from tilegrad import _core

_WARNING = 1  # nvdiffrast's levels: 0 information, 1 warning, 2 error, 3 fatal
_log_level = _WARNING
_warned: set[str] = set()


def get_log_level() -> int:
    """The level that `set_log_level` has set; 1 at first."""
    return _log_level


def set_log_level(level: int) -> None:
    """0 information, 1 warning, 2 error, 3 fatal. From 2 on, the warnings of this module are left
    out."""
    global _log_level
    if level not in (0, 1, 2, 3):
        raise ValueError(f"set_log_level: level is {level!r}, expected 0, 1, 2 or 3")
    _log_level = level


class RasterizeCpuContext:
    """Memory for `rasterize`, which a context reuses. One may serve several threads.

    device: None, or the CPU by any of torch's names.
    """

    def __init__(self, device: Any = None) -> None:
        if device is not None and torch.device(device).type != "cpu":
            raise ValueError(f"{type(self).__name__}: device is {device!r}, but tilegrad renders "
                             f"on the CPU: device='cpu', or none")
        self.rasterizer = _core.NvdiffrastRasterizer()


class _RenamedContext(RasterizeCpuContext):
    """Code that asks for a context on the GPU gets one on the CPU, and is told so once."""

    def __init__(self, device: Any = None) -> None:
        name = type(self).__name__
        if name not in _warned and _log_level <= _WARNING:
            _warned.add(name)
            warnings.warn(f"{name} of tilegrad.compat.nvdiffrast renders on the CPU; tensors must "
                          f"be there too. RasterizeCpuContext is its own name.", stacklevel=3)
        super().__init__(None)


class RasterizeCudaContext(_RenamedContext):
    """RasterizeCpuContext by the name that code for nvdiffrast uses; `device` is not looked at."""

    def __init__(self, device: Any = None) -> None:
        super().__init__(device)


class RasterizeGLContext(_RenamedContext):
    """RasterizeCpuContext by the name that older code for nvdiffrast uses. Its other arguments
    chose how OpenGL works and are not looked at."""

    def __init__(self, output_db: bool = True, mode: str = "automatic", device: Any = None) -> None:
        super().__init__(device)
