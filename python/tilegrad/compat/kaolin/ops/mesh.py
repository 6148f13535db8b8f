# SPDX-License-Identifier: Apache-2.0
"""kaolin.ops.mesh: the functions of its DIB-R examples."""

from __future__ import annotations

import torch

from tilegrad.compat._tensors import check_floats, check_tensor
from tilegrad.compat.kaolin._missing import missing_from

__getattr__ = missing_from(__name__)

_EPS = 1e-10  # Kaolin's, added to lengths


def index_vertices_by_faces(vertices_features: torch.Tensor, faces: torch.Tensor) -> torch.Tensor:
    """What vertices have, for the corners of faces. vertices_features: [B,V,C]. faces: [F,3] int64.
    Returns [B,F,3,C]."""
    name = "index_vertices_by_faces"
    check_tensor(name, "vertices_features", vertices_features, ("B", "V", "C"))
    check_tensor(name, "faces", faces, ("F", "corners"))
    batch, _, channels = vertices_features.shape
    return vertices_features.index_select(1, faces.reshape(-1)).reshape(batch, *faces.shape,
                                                                       channels)


def face_normals(face_vertices: torch.Tensor, unit: bool = False) -> torch.Tensor:
    """(b - a) x (c - a) of corners [B,F,3,3]; of length 1 if `unit`. Returns [B,F,3]."""
    check_floats("face_normals", "face_vertices", face_vertices, ("B", "F", 3, 3))
    a, b, c = face_vertices.unbind(dim=2)
    normals = torch.cross(b - a, c - a, dim=2)
    return normals / (normals.norm(dim=2, keepdim=True) + _EPS) if unit else normals


def uniform_laplacian(num_vertices: int, faces: torch.Tensor) -> torch.Tensor:
    """[V,V]: row v is 1 / degree at the neighbours of v and -1 at v; 0 if v has no neighbour.
    faces: [F,3] int64."""
    check_tensor("uniform_laplacian", "faces", faces, ("F", "corners"))
    adjacency = torch.zeros(num_vertices, num_vertices)
    following = faces.roll(-1, dims=1)
    adjacency[faces, following] = 1
    adjacency[following, faces] = 1
    degree = adjacency.sum(dim=1, keepdim=True)
    return adjacency / degree.clamp(min=1) - torch.diag((degree > 0).float().squeeze(1))
