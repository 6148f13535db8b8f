# SPDX-License-Identifier: Apache-2.0
"""kaolin.graphics.dib_renderer of Kaolin 0.1."""

from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.graphics.dib_renderer import rasterizer, renderer, utils
from tilegrad.compat.kaolin.graphics.dib_renderer.renderer import Renderer as DIBRenderer

__all__ = ["DIBRenderer", "rasterizer", "renderer", "utils"]

__getattr__ = missing_from(__name__)
