# SPDX-License-Identifier: Apache-2.0
"""A file's mesh as a SurfaceMesh."""

from __future__ import annotations

import os
from typing import Any, Optional, Union

import numpy as np
import torch

from tilegrad.compat.kaolin.rep import SurfaceMesh
from tilegrad.meshes import Mesh, load_mesh

Path = Union[str, "os.PathLike[str]"]


def load_surface(path: Path, with_materials: bool = True, with_normals: bool = True) -> SurfaceMesh:
    """All that the file has. OSError, ValueError: as tilegrad.meshes.load_mesh."""
    mesh = load_mesh(path)
    loaded = SurfaceMesh(torch.from_numpy(mesh.positions), torch.from_numpy(mesh.faces).long())
    loaded.uvs, loaded.face_uvs_idx = _table(mesh, "uvs", mesh.corner_uvs)
    if with_normals:
        loaded.normals, loaded.face_normals_idx = _table(mesh, "normals", mesh.corner_normals)
        if loaded.normals is None and mesh.normals is not None:
            loaded.normals, loaded.face_normals_idx = torch.from_numpy(mesh.normals), loaded.faces
    if with_materials:
        order = _order(mesh, os.fspath(path))
        loaded.materials = _materials(mesh, order)
        loaded.material_assignments = _assignments(mesh, order)
    if mesh.colors is not None:
        loaded.vertex_colors = torch.from_numpy(mesh.colors[:, :3])
    if mesh.corner_colors is not None:
        loaded.face_colors = torch.from_numpy(mesh.corner_colors[..., :3])
    return loaded


def _table(mesh: Mesh, name: str, corners: Optional[np.ndarray]
           ) -> tuple[Optional[torch.Tensor], Optional[torch.Tensor]]:
    """Values and their indices [F,3]: the file's own where the mesh has its tables, else one for
    each corner."""
    values = getattr(mesh.tables, name, None)
    if values is not None:
        indices = getattr(mesh.tables, "face_" + name)
        return torch.from_numpy(values), torch.from_numpy(indices).long()
    if corners is None:
        return None, None
    return (torch.from_numpy(corners.reshape(-1, corners.shape[2])),
            torch.arange(3 * len(corners)).reshape(-1, 3))


def _order(mesh: Mesh, path: str) -> list[int]:
    """The materials as Kaolin lists them: of OBJ by name, without that of faces that name none."""
    order = list(range(len(mesh.materials)))
    if not path.lower().endswith(".obj"):
        return order
    return sorted((i for i in order if mesh.materials[i].name), key=lambda i: mesh.materials[i].name)


def _materials(mesh: Mesh, order: list[int]) -> list[dict[str, Any]]:
    """material_name, Kd [3], and map_Kd [H,W,3] uint8 where there is a texture."""
    materials = []
    for material in (mesh.materials[i] for i in order):
        one = {"material_name": material.name, "Kd": torch.tensor(material.base_color[:3])}
        if material.texture >= 0:
            image = mesh.textures[material.texture].image[..., :3]
            one["map_Kd"] = torch.from_numpy(np.ascontiguousarray(image))
        materials.append(one)
    return materials


def _assignments(mesh: Mesh, order: list[int]) -> torch.Tensor:
    """[F] int16, as in Kaolin: -1 for faces without a material."""
    places = np.full(len(mesh.materials) + 1, -1, np.int16)  # the last one: of a mesh without any
    places[order] = np.arange(len(order))
    faces = mesh.face_materials
    return torch.from_numpy(places[np.zeros(len(mesh.faces), int) if faces is None else faces])
