# SPDX-License-Identifier: Apache-2.0
"""kaolin.render.mesh: prepare_vertices, texture_mapping, spherical_harmonic_lighting."""

from __future__ import annotations

from typing import Optional

import torch

from tilegrad._arrays import check_choice
from tilegrad._dense import full_precision
from tilegrad.compat.kaolin import ops
from tilegrad.compat._tensors import check_floats, check_finite
from tilegrad.compat.kaolin.render import camera

_MODES = ("nearest", "bilinear", "bicubic")


@full_precision
def prepare_vertices(vertices: torch.Tensor, faces: torch.Tensor, camera_proj: torch.Tensor,
                     camera_rot: Optional[torch.Tensor] = None,
                     camera_trans: Optional[torch.Tensor] = None,
                     camera_transform: Optional[torch.Tensor] = None
                     ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Vertices into a camera, onto its image plane, and to the corners of faces.

    vertices: [B,V,3], or [V,3] for all cameras. faces: [F,3] int64. camera_proj: [3,1] (or
        [B,3,1]), see camera.generate_perspective_projection.
    camera_rot [B,3,3] with camera_trans [B,3], or camera_transform [B,4,3]: see camera.
    Returns corners in the camera [B,F,3,3], on the image plane [B,F,3,2], and the faces' unit
    normals in the camera [B,F,3].
    """
    name = "prepare_vertices"
    if isinstance(vertices, torch.Tensor) and vertices.ndim == 2:
        vertices = vertices[None]
    check_finite(name, "vertices", vertices, ("B", "V", 3))
    if camera_transform is None:
        if camera_rot is None or camera_trans is None:
            raise ValueError(f"{name}: expected camera_transform, or camera_rot and camera_trans")
        in_camera = camera.rotate_translate_points(vertices, camera_rot, camera_trans)
    else:
        if camera_rot is not None or camera_trans is not None:
            raise ValueError(f"{name}: expected either camera_transform, or camera_rot and "
                             f"camera_trans, got both")
        in_camera = vertices @ camera_transform[..., :3, :] + camera_transform[..., 3:, :]
    corners = ops.mesh.index_vertices_by_faces(in_camera, faces)
    on_image = ops.mesh.index_vertices_by_faces(
        camera.perspective_camera(in_camera, camera_proj), faces)
    return corners, on_image, ops.mesh.face_normals(corners, unit=True)


@full_precision
def texture_mapping(texture_coordinates: torch.Tensor, texture_maps: torch.Tensor,
                    mode: str = "nearest") -> torch.Tensor:
    """Looks textures up: (0, 0) is the lower left corner of the texture, (1, 1) the upper right
    one, texel centres are at (i + 0.5) / size, and coordinates beyond are moved to the border.

    texture_coordinates: [B,H,W,2] or [B,P,2]. texture_maps: [B,C,Ht,Wt], row 0 on top.
    mode: 'nearest' (no gradient to coordinates), 'bilinear', 'bicubic'.
    Returns [B,H,W,C] or [B,P,C].
    """
    name = "texture_mapping"
    sizes: dict = {}
    sparse = isinstance(texture_coordinates, torch.Tensor) and texture_coordinates.ndim == 3
    check_floats(name, "texture_coordinates", texture_coordinates,
                 ("B", "P", 2) if sparse else ("B", "H", "W", 2), sizes)
    check_floats(name, "texture_maps", texture_maps, ("B", "C", "Ht", "Wt"), sizes,
                 texture_coordinates)
    check_choice(name, "mode", mode, _MODES)
    if 0 in texture_maps.shape[2:]:
        raise ValueError(f"{name}: texture_maps has no texels")
    inside = texture_coordinates.clamp(0., 1.)
    u, v = (inside.unsqueeze(1) if sparse else inside).unbind(dim=-1)
    # torch's v runs down. NaN is -1, as torch says; but its own backward pass reads out of bounds.
    grid = torch.stack([2 * u - 1, 1 - 2 * v], dim=-1).nan_to_num(nan=-1.0)
    texels = torch.nn.functional.grid_sample(texture_maps, grid, mode=mode, align_corners=False,
                                             padding_mode="border").permute(0, 2, 3, 1)
    return texels.squeeze(1) if sparse else texels


@full_precision
def spherical_harmonic_lighting(imnormal: torch.Tensor, lights: torch.Tensor) -> torch.Tensor:
    """Light from 9 coefficients, as Kaolin's deprecated function has it: the order of its first
    band is (x, z, y), all signs are +, and its last two constants are too small by sqrt(2).
    lighting.sh9_irradiance has the correct basis, whose coefficients are others.

    imnormal: [B,H,W,3], unit. lights: [B,9]. Returns [B,H,W].
    """
    name = "spherical_harmonic_lighting"
    sizes: dict = {}
    check_floats(name, "imnormal", imnormal, ("B", "H", "W", 3), sizes)
    check_floats(name, "lights", lights, ("B", 9), sizes, imnormal)
    x, y, z = imnormal.unbind(dim=-1)
    basis = torch.stack([
        torch.full_like(x, 0.28209479177), 0.4886025119 * x, 0.4886025119 * z, 0.4886025119 * y,
        1.09254843059 * x * y, 1.09254843059 * y * z, 0.94617469575 * z * z - 0.31539156525,
        0.77254840404 * x * z, 0.38627420202 * (x * x - y * y)], dim=-1)
    return (basis * lights[:, None, None, :]).sum(dim=-1)
