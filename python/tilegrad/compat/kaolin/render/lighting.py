# SPDX-License-Identifier: Apache-2.0
"""kaolin.render.lighting: spherical Gaussians, and spherical harmonics of degree up to 2,
orthonormal, with the Condon-Shortley sign, in the order 1 | y, z, x | xy, yz, 3z^2-1, xz, x^2-y^2.
"""

from __future__ import annotations

import math
from typing import Sequence, Union

import torch

from tilegrad._dense import full_precision
from tilegrad.compat._tensors import check_floats
from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.render._spherical_gaussians import (
    SgLightingParameters, approximate_sg_integral, cosine_lobe_sg, fresnel, sg_diffuse_fitted,
    sg_diffuse_inner_product, sg_direction_from_azimuth_elevation, sg_distribution_term,
    sg_from_sun, sg_irradiance_fitted, sg_irradiance_inner_product, sg_warp_distribution,
    sg_warp_specular_term)

__getattr__ = missing_from(__name__)
__all__ = ["project_onto_sh9", "sh9_diffuse", "sh9_irradiance", "SgLightingParameters",
           "approximate_sg_integral", "cosine_lobe_sg", "fresnel", "sg_diffuse_fitted",
           "sg_diffuse_inner_product", "sg_direction_from_azimuth_elevation",
           "sg_distribution_term", "sg_from_sun", "sg_irradiance_fitted",
           "sg_irradiance_inner_product", "sg_warp_distribution", "sg_warp_specular_term"]

# Clamped cosine, as factors of bands 0, 1, 2.
_COSINE = [math.pi] + 3 * [2 * math.pi / 3] + 5 * [math.pi / 4]


def project_onto_sh9(directions: Union[torch.Tensor, Sequence[float]]) -> torch.Tensor:
    """The nine basis functions. directions: [...,3], unit; or a list of 3 numbers. Returns [...,9].
    """
    if not isinstance(directions, torch.Tensor):
        directions = torch.tensor(directions, dtype=torch.get_default_dtype())
    check_floats("project_onto_sh9", "directions", directions,
                 (*directions.shape[:-1], 3))
    x, y, z = directions.unbind(dim=-1)
    return torch.stack([
        torch.full_like(x, 0.28209479177), -0.4886025119 * y, 0.4886025119 * z,
        -0.4886025119 * x, 1.0925484305920792 * x * y, -1.0925484305920792 * y * z,
        0.94617469575 * z * z - 0.31539156525, -1.0925484305920792 * x * z,
        0.5462742152960396 * (x * x - y * y)], dim=-1)


@full_precision
def sh9_irradiance(lights: torch.Tensor, normals: torch.Tensor) -> torch.Tensor:
    """Irradiance from radiance with the coefficients lights [9], at points with normals [N,3].
    Returns [N]."""
    name = "sh9_irradiance"
    check_floats(name, "lights", lights, (9,))
    check_floats(name, "normals", normals, ("N", 3), like=lights)
    return project_onto_sh9(normals) @ (lights * lights.new_tensor(_COSINE))


@full_precision
def sh9_diffuse(directions: torch.Tensor, normals: torch.Tensor,
                albedo: torch.Tensor) -> torch.Tensor:
    """Light from directions [3] that a diffuse surface with normals [N,3] and albedo [N,3]
    reflects. Returns [N,3]."""
    check_floats("sh9_diffuse", "directions", directions, (3,))
    sizes: dict = {}
    check_floats("sh9_diffuse", "normals", normals, ("N", 3), sizes, directions)
    check_floats("sh9_diffuse", "albedo", albedo, ("N", 3), sizes, directions)
    return albedo * sh9_irradiance(project_onto_sh9(directions), normals).unsqueeze(-1)
