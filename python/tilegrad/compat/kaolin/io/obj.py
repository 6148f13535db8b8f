# SPDX-License-Identifier: Apache-2.0
"""kaolin.io.obj."""

from __future__ import annotations

import os
from typing import Any, NamedTuple, Optional, Union

import torch

from tilegrad.meshes import load_mesh
from tilegrad.compat.kaolin._missing import missing_from

__getattr__ = missing_from(__name__)


class ObjMesh(NamedTuple):
    """vertices [V,3], faces [F,3] int64; uvs [3F,2] and face_uvs_idx [F,3] int64, one for each
    corner of a face, (0, 0) the lower left corner of the texture; None where the file has none."""

    vertices: torch.Tensor
    faces: torch.Tensor
    uvs: Optional[torch.Tensor]
    face_uvs_idx: Optional[torch.Tensor]


def import_mesh(path: Union[str, "os.PathLike[str]"], with_materials: bool = False,
                with_normals: bool = False, **_: Any) -> ObjMesh:
    """Loads a mesh, of any format that tilegrad.meshes reads; faces are cut into triangles.

    with_materials, with_normals, and Kaolin's further options are accepted; materials and normals
    are not part of what is returned: tilegrad.meshes.load_mesh has them.
    OSError, ValueError: name the file and what is wrong with it.
    """
    mesh = load_mesh(path)
    uvs = mesh.corner_uvs
    return ObjMesh(
        torch.from_numpy(mesh.positions), torch.from_numpy(mesh.faces).long(),
        None if uvs is None else torch.from_numpy(uvs.reshape(-1, 2)),
        None if uvs is None else torch.arange(3 * len(uvs)).reshape(-1, 3))
