# SPDX-License-Identifier: Apache-2.0
"""The functions of nvdiffrast.torch, on the CPU. Signatures, shapes and conventions are
nvdiffrast's: the clip space of OpenGL, images with their bottom row first, triangle ids from 1 on.

Tensors are torch's, on the CPU, float32 or (not in nvdiffrast) float64; all of a call have the same
dtype. Gradients are the same bits for any number of threads.
"""

from tilegrad.compat.nvdiffrast._antialias import antialias, antialias_construct_topology_hash
from tilegrad.compat.nvdiffrast._interpolate import interpolate
from tilegrad.compat.nvdiffrast._rasterize import (
    DepthPeeler, RasterizeCpuContext, RasterizeCudaContext, RasterizeGLContext, get_log_level,
    rasterize, set_log_level)
from tilegrad.compat.nvdiffrast._texture import texture, texture_construct_mip

__all__ = ["DepthPeeler", "RasterizeCpuContext", "RasterizeCudaContext", "RasterizeGLContext",
           "antialias", "antialias_construct_topology_hash", "get_log_level", "interpolate",
           "rasterize", "set_log_level", "texture", "texture_construct_mip"]
