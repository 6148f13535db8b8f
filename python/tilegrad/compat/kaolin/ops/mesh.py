# SPDX-License-Identifier: Apache-2.0
"""kaolin.ops.mesh: triangles; gradients flow to vertices and features."""

from __future__ import annotations

from typing import Optional, Union

import torch

from tilegrad.compat._tensors import (check_floats, check_finite, check_tensor, check_whole,
                                      surface_tools, threads, to_numpy)
from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.ops._subdivide import subdivide_trianglemesh

__getattr__ = missing_from(__name__)
__all__ = ["adjacency_matrix", "average_face_vertex_features", "check_sign",
           "compute_vertex_normals", "face_areas", "face_normals", "index_vertices_by_faces",
           "sample_points", "subdivide_trianglemesh", "unindex_vertices_by_faces",
           "uniform_laplacian"]

_EPS = 1e-10  # Kaolin's, added to lengths


def index_vertices_by_faces(vertices_features: torch.Tensor, faces: torch.Tensor) -> torch.Tensor:
    """What vertices have, for the corners of faces. vertices_features: [B,V,C]. faces: [F,3] int64.
    Returns [B,F,3,C]."""
    name = "index_vertices_by_faces"
    check_tensor(name, "vertices_features", vertices_features, ("B", "V", "C"))
    check_whole(name, "faces", faces, ("F", "corners"))
    batch, _, channels = vertices_features.shape
    return vertices_features.index_select(1, faces.reshape(-1)).reshape(batch, *faces.shape,
                                                                       channels)


def unindex_vertices_by_faces(face_vertex_features: torch.Tensor
                              ) -> tuple[torch.Tensor, torch.Tensor]:
    """Separate vertices for the corners of faces. face_vertex_features: [...,F,3,C]. Returns
    [...,3F,C] and faces [F,3] int64."""
    faces, corners = face_vertex_features.shape[-3:-1]
    return (face_vertex_features.flatten(-3, -2),
            torch.arange(faces * corners).reshape(faces, corners))


def face_normals(face_vertices: torch.Tensor, unit: bool = False) -> torch.Tensor:
    """(b - a) x (c - a) of corners [B,F,3,3]; of length 1 if `unit`. Returns [B,F,3]."""
    check_floats("face_normals", "face_vertices", face_vertices, ("B", "F", 3, 3))
    a, b, c = face_vertices.unbind(dim=2)
    normals = torch.cross(b - a, c - a, dim=2)
    return normals / (normals.norm(dim=2, keepdim=True) + _EPS) if unit else normals


def face_areas(vertices: torch.Tensor, faces: torch.Tensor) -> torch.Tensor:
    """vertices: [B,V,3]. faces: [F,3] int64. Returns [B,F]."""
    check_finite("face_areas", "vertices", vertices, ("B", "V", 3))
    check_whole("face_areas", "faces", faces, ("F", 3))
    return face_normals(index_vertices_by_faces(vertices, faces)).norm(dim=2) / 2


def average_face_vertex_features(faces: torch.Tensor, face_features: torch.Tensor,
                                 num_vertices: Optional[int] = None) -> torch.Tensor:
    """The mean over the corners at each vertex; 0 where there is none. faces: [F,3] int64.
    face_features: [B,F,3,C]. num_vertices: the largest index + 1 if None. Returns [B,V,C]."""
    name, sizes = "average_face_vertex_features", {}
    check_whole(name, "faces", faces, ("F", "corners"), sizes)
    check_floats(name, "face_features", face_features, ("B", "F", "corners", "C"), sizes)
    if num_vertices is None and not len(faces):
        raise ValueError(f"{name}: there are no faces to tell how many vertices; give num_vertices")
    count = int(faces.max()) + 1 if num_vertices is None else num_vertices
    corners = faces.reshape(-1)
    features = face_features.flatten(1, 2)
    sums = features.new_zeros(len(features), count, features.shape[2]).index_add(1, corners,
                                                                                 features)
    return sums / torch.bincount(corners, minlength=count).clamp(min=1)[:, None]


def compute_vertex_normals(faces: torch.Tensor, face_normals: torch.Tensor,
                           num_vertices: Optional[int] = None) -> torch.Tensor:
    """The mean, not of length 1, of the normals that faces have at each vertex. face_normals:
    [B,F,3,3]. The rest as in average_face_vertex_features. Returns [B,V,3]."""
    return average_face_vertex_features(faces, face_normals, num_vertices)


def adjacency_matrix(num_vertices: int, faces: torch.Tensor, sparse: bool = True) -> torch.Tensor:
    """[V,V] float32: 1 where an edge joins two vertices. faces: [F,3] int64."""
    check_whole("adjacency_matrix", "faces", faces, ("F", "corners"))
    following = faces.roll(-1, dims=1)
    ends = torch.stack([torch.stack([faces, following]), torch.stack([following, faces])])
    indices = ends.transpose(0, 1).reshape(2, -1).unique(dim=1)
    matrix = torch.sparse_coo_tensor(indices, torch.ones(indices.shape[1]),
                                     (num_vertices, num_vertices)).coalesce()
    return matrix if sparse else matrix.to_dense()


def uniform_laplacian(num_vertices: int, faces: torch.Tensor) -> torch.Tensor:
    """[V,V]: row v is 1 / degree at the neighbours of v and -1 at v; 0 if v has no neighbour.
    faces: [F,3] int64."""
    check_whole("uniform_laplacian", "faces", faces, ("F", "corners"))
    adjacency = adjacency_matrix(num_vertices, faces, sparse=False)
    degree = adjacency.sum(dim=1, keepdim=True)
    return adjacency / degree.clamp(min=1) - torch.diag((degree > 0).float().squeeze(1))


def sample_points(vertices: torch.Tensor, faces: torch.Tensor, num_samples: int,
                  areas: Optional[torch.Tensor] = None,
                  face_features: Optional[torch.Tensor] = None
                  ) -> Union[tuple[torch.Tensor, torch.Tensor],
                             tuple[torch.Tensor, torch.Tensor, torch.Tensor]]:
    """Points distributed by area; torch.manual_seed makes them the same again.

    vertices: [B,V,3]. faces: [F,3] int64. areas: [B,F], computed if None. face_features:
        [B,F,3,C], interpolated.
    Returns points [B,num_samples,3], their faces [B,num_samples] int64, and the features
        [B,num_samples,C] if given. ValueError: a mesh has no area.
    """
    name = "sample_points"
    check_finite(name, "vertices", vertices, ("B", "V", 3))
    check_whole(name, "faces", faces, ("F", 3))
    areas = face_areas(vertices, faces) if areas is None else areas
    check_floats(name, "areas", areas, (len(vertices), len(faces)))
    corners = index_vertices_by_faces(vertices, faces)
    if face_features is not None:
        check_floats(name, "face_features", face_features, (*corners.shape[:3], "C"))
    chosen, weights = _choose(areas, num_samples)
    weights = weights.to(vertices.dtype).unsqueeze(-1)
    images = torch.arange(len(vertices))[:, None]
    points = (weights * corners[images, chosen]).sum(dim=2)
    if face_features is None:
        return points, chosen
    return points, chosen, (weights * face_features[images, chosen]).sum(dim=2)


def _choose(areas: torch.Tensor, count: int) -> tuple[torch.Tensor, torch.Tensor]:
    """For [B,F] faces [B,count] and weights of their corners [B,count,3], from torch's seed."""
    batch, length = len(areas), max(count, 0)
    chosen = torch.empty(batch, length, dtype=torch.int64)
    weights = torch.empty(batch, length, 3, dtype=torch.float64)
    for i, seed in enumerate(torch.randint(2**62, (batch,)).tolist()):
        faces, of_corners = surface_tools().sample_faces(to_numpy(areas[i].double()), count, seed)
        chosen[i], weights[i] = torch.from_numpy(faces), torch.from_numpy(of_corners)
    return chosen, weights


def check_sign(verts: torch.Tensor, faces: torch.Tensor, points: torch.Tensor,
               hash_resolution: int = 512) -> torch.Tensor:
    """Whether a closed mesh has points inside. verts: [B,V,3]. faces: [F,3] int64. points: [B,P,3].
    hash_resolution: of Kaolin's search; accepted, and without meaning here. Returns [B,P] bool."""
    del hash_resolution
    sizes: dict = {}
    check_finite("check_sign", "verts", verts, ("B", "V", 3), sizes)
    check_finite("check_sign", "points", points, ("B", "P", 3), sizes, verts)
    corners = index_vertices_by_faces(verts, faces)
    return torch.from_numpy(surface_tools().enclosed(to_numpy(points), to_numpy(corners),
                                                     threads()))
