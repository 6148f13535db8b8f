# SPDX-License-Identifier: Apache-2.0
"""TriangleMesh of kaolin.rep in Kaolin 0.1."""

from __future__ import annotations

import os
from typing import Optional, Union

import torch

from tilegrad._dense import full_precision
from tilegrad.compat.kaolin import ops
from tilegrad.compat.kaolin.ops._subdivide import adjacency


class TriangleMesh:
    """vertices [V,3], faces [F,3] int64; uvs [T,2] with face_textures [F,3] int64, or None. With
    adjacency: edges [E,2], and ff [F,3], the faces beyond each face's edges, -1 where there is
    none; else both are None. adj: what the caller puts there."""

    def __init__(self, vertices: torch.Tensor, faces: torch.Tensor,
                 uvs: Optional[torch.Tensor] = None, face_textures: Optional[torch.Tensor] = None,
                 textures: Optional[torch.Tensor] = None) -> None:
        self.vertices, self.faces = vertices, faces
        self.uvs, self.face_textures, self.textures = uvs, face_textures, textures
        self.edges: Optional[torch.Tensor] = None
        self.ff: Optional[torch.Tensor] = None
        self.adj: Optional[torch.Tensor] = None

    @classmethod
    def from_tensors(cls, vertices: torch.Tensor, faces: torch.Tensor,
                     uvs: Optional[torch.Tensor] = None,
                     face_textures: Optional[torch.Tensor] = None,
                     textures: Optional[torch.Tensor] = None,
                     enable_adjacency: bool = False) -> TriangleMesh:
        """Of copies of vertices and faces."""
        mesh = cls(vertices.clone(), faces.clone(), uvs, face_textures, textures)
        if enable_adjacency:
            mesh.edges, mesh.ff = adjacency(mesh.faces)
        return mesh

    @classmethod
    def from_obj(cls, filename: Union[str, "os.PathLike[str]"],
                 enable_adjacency: bool = False) -> TriangleMesh:
        """Loads a mesh, of any format that tilegrad.meshes reads. OSError, ValueError: name the
        file and what is wrong with it."""
        from tilegrad.compat.kaolin import io
        mesh = io.obj.import_mesh(filename)
        return cls.from_tensors(mesh.vertices, mesh.faces, mesh.uvs, mesh.face_uvs_idx,
                                enable_adjacency=enable_adjacency)

    from_off = from_obj

    @property
    def device(self) -> torch.device:
        """Of the vertices."""
        return self.vertices.device

    def cuda(self) -> None:
        """Does nothing: tilegrad renders on the CPU."""

    def cpu(self) -> None:
        """Does nothing."""

    def compute_face_normals(self) -> torch.Tensor:
        """[F,3], of length 1."""
        corners = ops.mesh.index_vertices_by_faces(self.vertices[None], self.faces)
        return ops.mesh.face_normals(corners, unit=True)[0]

    def compute_adjacency_matrix_full(self) -> torch.Tensor:
        """[V,V]: 1 where an edge joins two vertices, and on the diagonal."""
        count = len(self.vertices)
        return ops.mesh.adjacency_matrix(count, self.faces, sparse=False) + torch.eye(count)

    def compute_adjacency_matrix_sparse(self) -> torch.Tensor:
        """The same, sparse."""
        return self.compute_adjacency_matrix_full().to_sparse()

    @full_precision
    def compute_laplacian(self) -> torch.Tensor:
        """[V,3], each vertex minus the mean of its neighbours."""
        return -ops.mesh.uniform_laplacian(len(self.vertices), self.faces) @ self.vertices

    @full_precision
    def laplacian_smoothing(self, iterations: int = 1) -> None:
        """Moves each vertex to the mean of its neighbours and itself."""
        adjacency = self.compute_adjacency_matrix_full()
        for _ in range(iterations):
            self.vertices = adjacency @ self.vertices / adjacency.sum(dim=1, keepdim=True)

    def sample(self, num_samples: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Points [num_samples,3] distributed by area, and their faces [num_samples]."""
        points, faces = ops.mesh.sample_points(self.vertices[None], self.faces, num_samples)
        return points[0], faces[0]
