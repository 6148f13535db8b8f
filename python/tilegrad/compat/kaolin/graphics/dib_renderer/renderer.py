# SPDX-License-Identifier: Apache-2.0
"""kaolin.graphics.dib_renderer.renderer: images [B,H,W,3], soft masks [B,H,W,1] and unit normals of
faces in the camera [B,F,3].

points: [vertices [B,V,3], faces [F,3] int64]. cameras: [rotation [B,3,3], position [B,3],
projection [3,1]]. uv_bxpx2: [B,T,2], repeated beyond [0, 1], with ft_fx3 [F,3] (None: as faces).
texture_bx3xthxtw: row 0 on top.
"""

from __future__ import annotations

from typing import Any, Optional, Sequence

import torch

from tilegrad._arrays import check_choice
from tilegrad._dense import full_precision
from tilegrad.compat.kaolin import ops
from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.graphics.dib_renderer.utils import (
    camera_around, datanormalize, perspectiveprojectionnp)
from tilegrad.compat.kaolin.render.mesh import dibr_rasterization, prepare_vertices

__all__ = ["PhongRender", "Renderer", "SHRender", "TexRender", "VCRender"]

__getattr__ = missing_from(__name__)

_Images = tuple[torch.Tensor, torch.Tensor, torch.Tensor]

# Kaolin 0.1's factors of 1 | y, z, x | xy, yz, z^2, xz, x^2 - y^2, and what is added to z^2.
_SH = [0.2820948, -0.325735, 0.325735, -0.325735, 0.2731371, -0.2731371, 0.1365686, -0.1931371,
       0.1365686]
_SH_OF_Z2 = -0.0788479


class _Render(torch.nn.Module):
    def __init__(self, height: int, width: int) -> None:
        super().__init__()
        self.height, self.width = height, width

    def _draw(self, points: Sequence[torch.Tensor], cameras: Sequence[torch.Tensor],
              features: Sequence[torch.Tensor], with_eye: bool = False
              ) -> tuple[list[torch.Tensor], torch.Tensor, torch.Tensor]:
        """Features [B,F,3,C], then the direction to the camera if with_eye, and the hard mask
        [B,H,W,1], as images."""
        vertices, faces = points
        rotation, position, projection = cameras
        corners, on_image, normals = prepare_vertices(vertices, faces, projection, rotation,
                                                      position)
        drawn = [*features, *([-corners] if with_eye else []), torch.ones_like(corners[..., :1])]
        images, mask, _ = dibr_rasterization(self.height, self.width, corners[..., 2], on_image,
                                             drawn, normals[..., 2])
        return list(images), mask.unsqueeze(-1), normals


class VCRender(_Render):
    """Colours of vertices."""

    def forward(self, points: Sequence[torch.Tensor], cameras: Sequence[torch.Tensor],
                colors_bxpx3: torch.Tensor) -> _Images:
        colors = ops.mesh.index_vertices_by_faces(colors_bxpx3, points[1])
        (image, _), mask, normals = self._draw(points, cameras, [colors])
        return image, mask, normals


class TexRender(_Render):
    """A texture without light. filtering: a mode of torch's grid_sample."""

    def __init__(self, height: int, width: int, filtering: str = "nearest") -> None:
        super().__init__(height, width)
        self.filtering = filtering

    def forward(self, points: Sequence[torch.Tensor], cameras: Sequence[torch.Tensor],
                uv_bxpx2: torch.Tensor, texture_bx3xthxtw: torch.Tensor,
                ft_fx3: Optional[torch.Tensor] = None) -> _Images:
        uvs = _uvs_of_faces(uv_bxpx2, ft_fx3, points)
        (uv, hard), mask, normals = self._draw(points, cameras, [uvs])
        color = _texture(uv, texture_bx3xthxtw, self.filtering)
        return (color * hard).clamp(0, 1), mask, normals


class _SmoothRender(_Render):
    _pfmtx: Optional[torch.Tensor] = None

    def set_smooth(self, pfmtx: Any) -> None:
        """pfmtx: [V,F] or [1,V,F], the weights of faces' normals in those of vertices."""
        self._pfmtx = torch.as_tensor(pfmtx).reshape(-1, *pfmtx.shape[-2:])

    @full_precision
    def _normals(self, points: Sequence[torch.Tensor],
                 cameras: Sequence[torch.Tensor]) -> torch.Tensor:
        """In the camera, for the corners of faces [B,F,3,3]; not of length 1."""
        vertices, faces = points
        corners = ops.mesh.index_vertices_by_faces(
            (vertices - cameras[1].reshape(-1, 1, 3)) @ cameras[0].transpose(1, 2), faces)
        normals = ops.mesh.face_normals(corners)
        if self._pfmtx is None:
            return normals.unsqueeze(2).expand_as(corners)
        return ops.mesh.index_vertices_by_faces(self._pfmtx.to(normals.dtype) @ normals, faces)


class SHRender(_SmoothRender):
    """A texture in light of nine coefficients of spherical harmonics, lightparam [B,9]."""

    def forward(self, points: Sequence[torch.Tensor], cameras: Sequence[torch.Tensor],
                uv_bxpx2: torch.Tensor, texture_bx3xthxtw: torch.Tensor, lightparam: torch.Tensor,
                ft_fx3: Optional[torch.Tensor] = None) -> _Images:
        features = [self._normals(points, cameras), _uvs_of_faces(uv_bxpx2, ft_fx3, points)]
        (normal, uv, hard), mask, normals = self._draw(points, cameras, features)
        x, y, z = datanormalize(normal, axis=3).unbind(dim=-1)
        bands = torch.stack([torch.ones_like(x), y, z, x, x * y, y * z, z * z, x * z,
                             x * x - y * y], dim=-1) * normal.new_tensor(_SH)
        bands = bands + normal.new_tensor(6 * [0] + [_SH_OF_Z2, 0, 0])
        light = (bands * lightparam.reshape(-1, 1, 1, 9)).sum(dim=-1, keepdim=True)
        color = light * _texture(uv, texture_bx3xthxtw)
        return (color * hard).clamp(0, 1), mask, normals


class PhongRender(_SmoothRender):
    """A texture in light from lightdirect_bx3; material_bx3x3: ambient, diffuse and specular
    colours; shininess_bx1: the exponent."""

    def forward(self, points: Sequence[torch.Tensor], cameras: Sequence[torch.Tensor],
                uv_bxpx2: torch.Tensor, texture_bx3xthxtw: torch.Tensor,
                lightdirect_bx3: torch.Tensor, material_bx3x3: torch.Tensor,
                shininess_bx1: torch.Tensor, ft_fx3: Optional[torch.Tensor] = None) -> _Images:
        features = [self._normals(points, cameras), _uvs_of_faces(uv_bxpx2, ft_fx3, points)]
        (normal, uv, eye, hard), mask, normals = self._draw(points, cameras, features, True)
        normal, eye = datanormalize(normal, axis=3), datanormalize(eye, axis=3)
        light = datanormalize(lightdirect_bx3, axis=1).reshape(-1, 1, 1, 3)
        ambient, diffuse, specular = material_bx3x3[:, :, None, None].unbind(dim=1)
        facing = (normal * light).sum(dim=-1, keepdim=True).clamp(0, 1)
        mirrored = 2 * facing * normal - light
        shine = (mirrored * eye).sum(dim=-1, keepdim=True).clamp(1e-5, 1)
        shine = shine ** shininess_bx1.reshape(-1, 1, 1, 1)
        color = (ambient + diffuse * facing) * _texture(uv, texture_bx3xthxtw) + specular * shine
        return (color * hard).clamp(0, 1), mask, normals


_MODES = {"VertexColor": VCRender, "Lambertian": TexRender, "SphericalHarmonics": SHRender,
          "Phong": PhongRender}


class Renderer(torch.nn.Module):
    """One of the above with cameras. mode: VertexColor, Lambertian (a texture without light),
    SphericalHarmonics or Phong. camera_fov_y: radians, None is 49.13 degrees."""

    def __init__(self, height: int, width: int, mode: str = "VertexColor",
                 camera_fov_y: Optional[float] = None) -> None:
        super().__init__()
        check_choice("Renderer", "mode", mode, tuple(_MODES))
        self.mode = mode
        self.renderer = _MODES[mode](height, width)
        self.camera_fov_y = 0.8575560548920328 if camera_fov_y is None else camera_fov_y
        self.camera_params: Optional[Sequence[torch.Tensor]] = None

    def forward(self, points: Sequence[torch.Tensor], *args: Any, **kwargs: Any) -> _Images:
        """As of the mode, without cameras. ValueError: other numbers of cameras and of meshes."""
        if self.camera_params is None:
            self.set_look_at_parameters([0], [30], [1])
        if len(self.camera_params[0]) != len(points[0]):
            raise ValueError(f"Renderer: {len(self.camera_params[0])} cameras, but points for "
                             f"{len(points[0])} images")
        return self.renderer(points, self.camera_params, *args, **kwargs)

    def set_look_at_parameters(self, azimuth: Sequence[float], elevation: Sequence[float],
                               distance: Sequence[float]) -> None:
        """Cameras that look at the origin, y up; degrees, azimuth from x towards z. Without them:
        0, 30, 1."""
        rotations, positions = zip(*map(camera_around, azimuth, elevation, distance))
        self.camera_params = [torch.stack(rotations), torch.stack(positions),
                              torch.from_numpy(perspectiveprojectionnp(self.camera_fov_y))]

    def set_camera_parameters(self, parameters: Sequence[torch.Tensor]) -> None:
        """cameras, as above."""
        self.camera_params = parameters


def _uvs_of_faces(uv: torch.Tensor, of_faces: Optional[torch.Tensor],
                  points: Sequence[torch.Tensor]) -> torch.Tensor:
    return ops.mesh.index_vertices_by_faces(uv, points[1] if of_faces is None else of_faces)


def _texture(uv: torch.Tensor, texture: torch.Tensor, filtering: str = "nearest") -> torch.Tensor:
    u, v = torch.remainder(uv, 1.).unbind(dim=-1)
    grid = torch.stack([2 * u - 1, 1 - 2 * v], dim=-1)  # torch's v runs down
    return torch.nn.functional.grid_sample(texture, grid, mode=filtering,
                                           align_corners=False).permute(0, 2, 3, 1)
