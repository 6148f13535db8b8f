# SPDX-License-Identifier: Apache-2.0
"""kaolin.graphics of Kaolin 0.1: DIBRenderer."""

from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.graphics import dib_renderer
from tilegrad.compat.kaolin.graphics.dib_renderer import DIBRenderer

__all__ = ["DIBRenderer", "dib_renderer"]

__getattr__ = missing_from(__name__)
