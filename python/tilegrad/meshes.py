# SPDX-License-Identifier: Apache-2.0
"""Reads and writes mesh files as arrays for a `tilegrad.Scene`.

    mesh = load_mesh("chair.glb")
    frame = tilegrad.Renderer().render(mesh.scene(camera), width=256, height=256)
"""

from __future__ import annotations

import os
from typing import Any, Optional

import numpy as np

from tilegrad import _arrays, _tools
from tilegrad._arrays import name_of, Path
from tilegrad._mesh import Material, Mesh, mesh_of_dict, MeshCamera, MeshTables, MeshTexture

__all__ = ["Material", "Mesh", "MeshCamera", "MeshTables", "MeshTexture", "as_mesh", "load_mesh",
           "mesh_endings", "mesh_of_dict", "save_mesh"]

_FAR = 256  # times the size of a mesh, as in files


def load_mesh(path: Path, *, max_bytes: Optional[int] = None) -> Mesh:
    """Reads a mesh: glTF and GLB with materials and textures, OBJ with MTL, PLY, OFF, STL, AC3D,
    3DS, Collada, FBX and others (`mesh_endings`). Merges all parts and splits polygons into
    triangles.

    max_bytes: memory limit of the file and all files that it references; None: TILEGRAD_READ_LIMIT
    of the environment, or else 4 GiB.
    OSError, ValueError: name the file, the place in it and what to do. A missing texture is a
    warning of the mesh.
    """
    return mesh_of_dict(_tools.load_mesh(name_of(path), _arrays.as_limit("load_mesh", max_bytes)))


def save_mesh(path: Path, mesh: Mesh) -> None:
    """`Mesh.save`."""
    if not isinstance(mesh, Mesh):
        raise TypeError(f"save_mesh: mesh is {type(mesh).__name__}, expected a Mesh (as_mesh makes "
                        f"one)")
    mesh.save(path)


def mesh_endings() -> list[str]:
    """The endings of file names that `load_mesh` reads."""
    return _tools.mesh_endings().split(", ")


def as_mesh(mesh: Any) -> Mesh:
    """A Mesh from any of: a Mesh; a file's path; (positions, faces); an object of trimesh
    (vertices, faces) or Open3D (vertices, triangles), with its colours and normals per vertex and,
    for trimesh, its texture. Neither library is imported.

    TypeError: it is none of them. ValueError: polygons other than triangles, or float64 positions
        farther from the origin than 256 times their size.
    """
    if isinstance(mesh, (str, bytes, os.PathLike)):
        return load_mesh(mesh)
    return _of_object(mesh)


def _of_object(mesh: Any) -> Mesh:
    """From an object that is not a file."""
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
    dtype = _arrays.float_dtype("as_mesh", "positions", positions)
    array = _arrays.as_array("as_mesh", "positions", positions, dtype, ("V", 3))
    if dtype == np.float64 and len(array):
        _refuse_far(array)
    return (array.astype(np.float32, copy=False),
            _arrays.as_array("as_mesh", "faces", faces, np.int32, ("F", 3)))


def _refuse_far(positions: np.ndarray) -> None:
    """ValueError where float32 would lose the shape. Files are moved to the origin then; arrays
    are not, since cameras of the caller would look past them."""
    size = np.ptp(positions, axis=0).max()
    farthest = np.abs(positions).max()
    if np.isfinite(farthest) and size > 0 and farthest > _FAR * size:
        raise ValueError(f"as_mesh: positions are up to {farthest:g} from the origin, too far for "
                         f"a size of {size:g} in float32: subtract their middle")


def _vertex_rows(mesh: Mesh, values: Any, widths: tuple[int, ...]) -> Optional[np.ndarray]:
    """(V, width) float32, bytes scaled to 0 to 1; None where the object has none."""
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
