# SPDX-License-Identifier: Apache-2.0
"""kaolin.render: camera, lighting, mesh."""

from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.render import camera, lighting, mesh

__all__ = ["camera", "lighting", "mesh"]

__getattr__ = missing_from(__name__)
