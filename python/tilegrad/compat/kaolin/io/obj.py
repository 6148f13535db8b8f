# SPDX-License-Identifier: Apache-2.0
"""kaolin.io.obj."""

from __future__ import annotations

from typing import Any

from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.io._load import Path, load_surface
from tilegrad.compat.kaolin.rep import SurfaceMesh

__getattr__ = missing_from(__name__)


def import_mesh(path: Path, with_materials: bool = False, with_normals: bool = False,
                error_handler: Any = None, heterogeneous_mesh_handler: Any = None,
                triangulate: bool = True, raw_materials: bool = True) -> SurfaceMesh:
    """Loads a mesh, of any format that tilegrad.meshes reads; faces are cut into triangles.

    with_materials: materials sorted by name, dictionaries of material_name, Kd [3] and map_Kd
        [H,W,3] uint8 where there is a texture, with material_assignments [F], -1 for faces without
        one. Those that no face uses are left out. with_normals: normals with
        face_normals_idx. uvs: (0, 0) is the lower left corner of the texture.
    The rest are Kaolin's, and accepted: there is nothing to handle in a file that loads, and
    materials are always as above.
    OSError, ValueError: name the file and what is wrong with it.
    """
    del error_handler, heterogeneous_mesh_handler, triangulate, raw_materials
    return load_surface(path, with_materials, with_normals)
