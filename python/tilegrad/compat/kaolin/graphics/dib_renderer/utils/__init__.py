# SPDX-License-Identifier: Apache-2.0
"""kaolin.graphics.dib_renderer.utils: cameras as NumPy arrays, lengths, sphericalcoord."""

from __future__ import annotations

import math

import numpy as np
import torch

from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.graphics.dib_renderer.utils import sphericalcoord
from tilegrad.compat.kaolin.graphics.dib_renderer.utils.sphericalcoord import (
    get_spherical_coords_x, get_spherical_coords_z)
from tilegrad.compat.kaolin.render.camera import (
    generate_perspective_projection, generate_rotate_translate_matrices)

__all__ = ["datanormalize", "get_spherical_coords_x", "get_spherical_coords_z", "lookatnp",
           "perspectiveprojectionnp", "sphericalcoord"]

__getattr__ = missing_from(__name__)

_EPS = 1e-8


def datanormalize(data: torch.Tensor, axis: int) -> torch.Tensor:
    """Of length 1 along `axis`."""
    return data / (data.norm(dim=axis, keepdim=True) + _EPS)


def perspectiveprojectionnp(fovy: float, ratio: float = 1.0, near: float = 0.01,
                            far: float = 10.0) -> np.ndarray:
    """[3,1] float32, see render.camera.generate_perspective_projection; near and far, which Kaolin
    takes too, are not part of it."""
    del near, far
    return generate_perspective_projection(fovy, ratio).numpy()


def lookatnp(eye_3x1: np.ndarray, center_3x1: np.ndarray,
             up_3x1: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R [3,3], whose rows are the camera's axes, and t [3,1], so that R p + t is p in the camera;
    float32."""
    eye, center, up = (torch.as_tensor(v, dtype=torch.float32).reshape(1, 3)
                       for v in (eye_3x1, center_3x1, up_3x1))
    rotation = generate_rotate_translate_matrices(eye, center, up)[0][0]
    return rotation.numpy(), -(rotation @ eye[0])[:, None].numpy()


def camera_around(azimuth: float, elevation: float,
                  distance: float) -> tuple[torch.Tensor, torch.Tensor]:
    """R [3,3] and the position [3] of a camera that looks at the origin; degrees."""
    across = distance * math.cos(math.radians(elevation))
    position = torch.tensor([across * math.cos(math.radians(azimuth)),
                             distance * math.sin(math.radians(elevation)),
                             across * math.sin(math.radians(azimuth))])
    rotation, _ = generate_rotate_translate_matrices(
        position[None], torch.zeros(1, 3), torch.tensor([[0., 1, 0]]))
    return rotation[0], position
