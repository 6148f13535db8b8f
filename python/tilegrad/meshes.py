# SPDX-License-Identifier: Apache-2.0
"""Meshes from files and to files, as arrays that go into a `tilegrad.Scene`.

    mesh = load_mesh("chair.glb")
    frame = tilegrad.Renderer().render(mesh.scene(camera), width=256, height=256)
"""

from __future__ import annotations

import os
from typing import Any, Optional

from tilegrad import _arrays, _interchange, _tools
from tilegrad._mesh import Material, Mesh, MeshCamera, MeshTables, MeshTexture, mesh_of_dict
from tilegrad._paths import Path, name_of

__all__ = ["Material", "Mesh", "MeshCamera", "MeshTables", "MeshTexture", "as_mesh", "load_mesh",
           "mesh_endings", "mesh_of_dict", "save_mesh"]


def load_mesh(path: Path, *, max_bytes: Optional[int] = None) -> Mesh:
    """Reads a mesh: glTF and GLB with materials and textures, OBJ with MTL, PLY, OFF, STL, AC3D,
    3DS, Collada, FBX and others (`mesh_endings`). All parts are merged, polygons split.

    max_bytes: the most that it may take in memory with all files that it names; None: what the
    environment's TILEGRAD_READ_LIMIT says, or else 4 GiB.
    OSError, ValueError: name the file, the place in it and what to do. A missing texture is a
    warning of the mesh.
    """
    return mesh_of_dict(_tools.load_mesh(name_of(path), _arrays.as_limit("load_mesh", max_bytes)))


def save_mesh(path: Path, mesh: Mesh) -> None:
    """`Mesh.save`."""
    mesh.save(path)


def mesh_endings() -> list[str]:
    """The endings of file names that `load_mesh` reads."""
    return _tools.mesh_endings().split(", ")


def as_mesh(mesh: Any) -> Mesh:
    """A Mesh of whatever holds one: a Mesh; a file's path; (positions, faces); an object of trimesh
    (vertices, faces) or Open3D (vertices, triangles), with its colours and normals per vertex and,
    of trimesh, its texture. Neither library is imported.

    TypeError: it is none of them. ValueError: polygons that are no triangles.
    """
    if isinstance(mesh, (str, bytes, os.PathLike)):
        return load_mesh(mesh)
    return _interchange.as_mesh(mesh)
