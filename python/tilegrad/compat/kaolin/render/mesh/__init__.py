# SPDX-License-Identifier: Apache-2.0
"""kaolin.render.mesh: projected faces to images."""

from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.render.mesh.dibr import dibr_rasterization, dibr_soft_mask
from tilegrad.compat.kaolin.render.mesh.rasterization import rasterize
from tilegrad.compat.kaolin.render.mesh.utils import (
    prepare_vertices, spherical_harmonic_lighting, texture_mapping)

__all__ = ["dibr_rasterization", "dibr_soft_mask", "prepare_vertices", "rasterize",
           "spherical_harmonic_lighting", "texture_mapping"]

__getattr__ = missing_from(__name__)
