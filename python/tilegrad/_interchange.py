# SPDX-License-Identifier: Apache-2.0
"""Meshes of whatever holds one: objects of trimesh and Open3D, told by their members."""

from __future__ import annotations

from typing import Any, Optional

import numpy as np

from tilegrad import _arrays
from tilegrad._mesh import Material, Mesh, MeshTexture


def as_mesh(mesh: Any) -> Mesh:
    """`tilegrad.meshes.as_mesh`, of what is no file."""
    if isinstance(mesh, Mesh):
        return mesh
    if isinstance(mesh, (tuple, list)) and len(mesh) == 2:
        return Mesh(*_positions_faces(*mesh))
    if not hasattr(mesh, "vertices"):
        raise TypeError(f"as_mesh: got {type(mesh).__name__}, expected a Mesh, a path, (positions, "
                        f"faces), or an object with vertices and faces or triangles")
    faces = mesh.faces if hasattr(mesh, "faces") else getattr(mesh, "triangles", None)
    out = Mesh(*_positions_faces(mesh.vertices, faces))
    visual = getattr(mesh, "visual", None)  # of trimesh
    out.colors = _vertex_rows(out, getattr(mesh, "vertex_colors", getattr(visual, "vertex_colors", None)),
                              (3, 4))
    normals = getattr(mesh, "vertex_normals", None)
    out.normals = _vertex_rows(out, normals, (3,))
    if getattr(visual, "uv", None) is not None:
        _take_texture(out, visual)
    return out


def _positions_faces(positions: Any, faces: Any) -> tuple[np.ndarray, np.ndarray]:
    indices = np.asarray(faces)
    if indices.ndim != 2 or indices.shape[-1] != 3 or indices.dtype.kind not in "iu":
        raise ValueError(f"as_mesh: faces have shape {indices.shape} and dtype {indices.dtype}, "
                         f"expected (F, 3) whole numbers: triangles")
    array = _arrays.as_array("as_mesh", "positions", np.asarray(positions, np.float32), np.float32,
                             ("V", 3))
    return array, np.ascontiguousarray(indices, np.int32)


def _vertex_rows(mesh: Mesh, values: Any, widths: tuple[int, ...]) -> Optional[np.ndarray]:
    """(V, width) float32, 0 to 1 of bytes; None where the object has none."""
    array = np.asarray(values) if values is not None else np.empty(0)
    if array.ndim != 2 or len(array) != len(mesh.positions) or array.shape[1] not in widths:
        return None
    scale = 255 if array.dtype == np.uint8 else 1
    return np.ascontiguousarray(array / np.float32(scale), np.float32)


def _take_texture(mesh: Mesh, visual: Any) -> None:
    """trimesh's TextureVisuals: uv of vertices, and the image of the material."""
    material = getattr(visual, "material", None)
    image = getattr(material, "image", None)
    if image is None:
        image = getattr(material, "baseColorTexture", None)
    if image is None:
        return
    uv = _vertex_rows(mesh, visual.uv, (2,))
    pixels = np.asarray(image.convert("RGBA") if hasattr(image, "convert") else image)
    if uv is None or pixels.dtype != np.uint8:
        return
    mesh.colors = None
    mesh.corner_uvs = uv[mesh.faces]
    mesh.textures = [MeshTexture("texture", np.ascontiguousarray(pixels))]
    mesh.materials = [Material("texture", (1.0, 1.0, 1.0, 1.0), 0)]
