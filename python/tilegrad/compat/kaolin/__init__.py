# SPDX-License-Identifier: Apache-2.0
"""Kaolin's DIB-R functions on the CPU, by tilegrad:

    import tilegrad.compat.kaolin as kaolin

Signatures, shapes and conventions are Kaolin's: the camera looks along -z and the largest z is
nearest; the image plane spans [-1, 1] with y up, row 0 on top; faces are interpolated linearly on
the screen. Tensors are torch's, on the CPU, float32 or float64, and gradients flow wherever
Kaolin's do. docs/porting.md says what is the same and what differs.
"""

from __future__ import annotations

import importlib
from types import ModuleType

from tilegrad.compat.kaolin import metrics, ops, render
from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.render.mesh.dibr import use_exact_kaolin

__all__ = ["graphics", "io", "metrics", "ops", "rep", "render", "use_exact_kaolin"]

_LATER = ("graphics", "io", "rep")  # loaded where they are used first: io brings readers of files


def __getattr__(name: str) -> ModuleType:
    if name in _LATER:
        return importlib.import_module(f"{__name__}.{name}")
    return missing_from(__name__)(name)
