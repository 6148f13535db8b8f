# SPDX-License-Identifier: Apache-2.0
"""kaolin.render.camera: pinhole cameras, and the functions of its DIB-R examples. Cameras look
along -z, x right, y up."""

from __future__ import annotations

import math

import torch

from tilegrad._dense import full_precision
from tilegrad.compat._tensors import check_up
from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.render._camera import (
    Camera, generate_centered_pixel_coords, generate_pinhole_rays)
from tilegrad.compat.kaolin.render._pinhole import CameraExtrinsics, CameraFOV, PinholeIntrinsics

__getattr__ = missing_from(__name__)
__all__ = ["Camera", "CameraExtrinsics", "CameraFOV", "PinholeIntrinsics",
           "generate_centered_pixel_coords", "generate_perspective_projection",
           "generate_pinhole_rays", "generate_rotate_translate_matrices",
           "generate_transformation_matrix", "perspective_camera", "rotate_translate_points"]

_EPS = 1e-10  # Kaolin's, added to lengths


@full_precision
def rotate_translate_points(points: torch.Tensor, camera_rot: torch.Tensor,
                            camera_trans: torch.Tensor) -> torch.Tensor:
    """R (p - t). points: [B,N,3]. camera_rot: [B,3,3], rows are the camera's axes.
    camera_trans: [B,3] (or [B,3,1]), where the camera is. Returns [B,N,3]."""
    return (points - camera_trans.reshape(-1, 1, 3)) @ camera_rot.transpose(1, 2)


@full_precision
def perspective_camera(points: torch.Tensor, camera_proj: torch.Tensor) -> torch.Tensor:
    """(f_x x, f_y y) / (-z), the image in [-1, 1]. points: [B,N,3] in the camera. camera_proj:
    [3,1] or [B,3,1]. Returns [B,N,2]."""
    scaled = points * camera_proj.reshape(-1, 1, 3)
    return scaled[..., :2] / scaled[..., 2:]


def generate_perspective_projection(fovyangle: float, ratio: float = 1.0,
                                    dtype: torch.dtype = torch.float) -> torch.Tensor:
    """[3,1] (1 / (ratio tan(fovy/2)), 1 / tan(fovy/2), -1). fovyangle: full vertical field of view,
    radians. ratio: width / height."""
    tangent = math.tan(fovyangle / 2)
    return torch.tensor([[1 / (ratio * tangent)], [1 / tangent], [-1]], dtype=dtype)


@full_precision
def generate_rotate_translate_matrices(camera_position: torch.Tensor, look_at: torch.Tensor,
                                       camera_up_direction: torch.Tensor
                                       ) -> tuple[torch.Tensor, torch.Tensor]:
    """camera_rot [B,3,3] and camera_trans [B,3] of cameras at camera_position [B,3] that look at
    look_at [B,3], camera_up_direction [B,3] (or [1,3]) up. ValueError: an up along the view."""
    axes = _axes("generate_rotate_translate_matrices", camera_position - look_at,
                 camera_up_direction)
    return torch.stack(axes, dim=1), camera_position


@full_precision
def generate_transformation_matrix(camera_position: torch.Tensor, look_at: torch.Tensor,
                                   camera_up_direction: torch.Tensor) -> torch.Tensor:
    """camera_transform [B,4,3] of the same cameras: (p, 1) times it is p in the camera."""
    rotation = torch.stack(_axes("generate_transformation_matrix", camera_position - look_at,
                                 camera_up_direction), dim=2)
    return torch.cat([rotation, -camera_position.unsqueeze(1) @ rotation], dim=1)


def _axes(function: str, backward: torch.Tensor, up: torch.Tensor) -> list[torch.Tensor]:
    """The camera's x, y, z in the world, [B,3] each."""
    z = _unit(backward)
    up, z = torch.broadcast_tensors(up, z)
    check_up(function, up, z)
    x = _unit(torch.cross(up, z, dim=1))
    return [x, _unit(torch.cross(z, x, dim=1)), z]


def _unit(vectors: torch.Tensor) -> torch.Tensor:
    return vectors / (vectors.norm(dim=1, keepdim=True) + _EPS)
