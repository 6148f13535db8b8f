# SPDX-License-Identifier: Apache-2.0
"""kaolin.graphics.dib_renderer.utils.sphericalcoord: texture coordinates of points, -1 to 1."""

import numpy as np

from tilegrad.compat.kaolin._missing import missing_from

__getattr__ = missing_from(__name__)


def get_spherical_coords_x(points: np.ndarray) -> np.ndarray:
    """(angle from x, angle around it from y) of [V,3]. Returns [V,2]."""
    x, y, z = np.transpose(points)
    return np.stack([2 * np.arccos(x / np.linalg.norm(points, axis=1)) / np.pi - 1,
                     np.arctan2(z, y) / np.pi], axis=1)


def get_spherical_coords_z(points: np.ndarray) -> np.ndarray:
    """(angle around z from x, angle from z) of [V,3]. Returns [V,2]."""
    x, y, z = np.transpose(points)
    return np.stack([np.arctan2(y, x) / np.pi,
                     2 * np.arccos(z / np.linalg.norm(points, axis=1)) / np.pi - 1], axis=1)
