# SPDX-License-Identifier: Apache-2.0
"""The points of whatever holds a mesh."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from tilegrad import _arrays, _indices
from tilegrad._paths import name_of


def points_of(function: str, mesh: Any) -> np.ndarray:
    """The vertices that faces use of what `tilegrad.meshes.as_mesh` takes, or points (V, 3) as they
    are, float64. ValueError: there are none, or one is not finite."""
    points, faces = _parts(mesh)
    points = _arrays.as_array(function, "mesh", points, np.float64, ("V", 3))
    if faces is not None:
        faces = _indices.as_indices(function, "faces", faces, ("F", 3))
        _arrays.check_indices(function, "faces", faces, len(points))
        points = points[np.unique(faces)]
    if not len(points):
        raise ValueError(f"{function}: mesh has no faces")
    if not np.isfinite(points).all():
        raise ValueError(f"{function}: mesh has positions that are not finite")
    return points


def _parts(mesh: Any) -> tuple[Any, Any]:
    """Vertices, and faces or None."""
    if isinstance(mesh, (str, bytes, os.PathLike)):
        from tilegrad import _tools
        arrays = _tools.load_mesh(name_of(mesh))
        return arrays["positions"], arrays["faces"]
    if isinstance(mesh, (tuple, list)) and len(mesh) == 2:
        return mesh[0], mesh[1]
    if hasattr(mesh, "positions"):  # a tilegrad.meshes.Mesh
        return mesh.positions, mesh.faces
    if hasattr(mesh, "vertices"):
        faces = mesh.faces if hasattr(mesh, "faces") else getattr(mesh, "triangles", None)
        return np.asarray(mesh.vertices), np.asarray(faces)
    return mesh, None
