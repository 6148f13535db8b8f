# SPDX-License-Identifier: Apache-2.0
"""kaolin.metrics.trianglemesh."""

from __future__ import annotations

from typing import Any, Optional

import torch

from tilegrad._dense import first_derivative_only, full_precision
from tilegrad.compat._tensors import (check_floats, check_not_empty, check_finite, check_whole,
                                      surface_tools, threads, to_numpy)
from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.ops.mesh import index_vertices_by_faces, uniform_laplacian

__getattr__ = missing_from(__name__)

# By which weights of corners are positive, bit k that of corner k: Kaolin's 1..3 are corners, 4..6
# the edges 0-1, 1-2, 2-0, and 0 is inside.
_TYPES = torch.tensor([0, 1, 2, 4, 3, 6, 5, 0], dtype=torch.int32)


@full_precision
def point_to_mesh_distance(pointclouds: torch.Tensor, face_vertices: torch.Tensor
                           ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Squared distances of points [B,P,3] to the nearest face of corners [B,F,3,3].

    Returns distances [B,P], with gradients to both; faces [B,P] int64, of equally near ones the
    first; and where on the face, [B,P] int32: 0 inside, 1 to 3 at corners 0 to 2, 4 to 6 on the
    edges 0-1, 1-2, 2-0.
    """
    name, sizes = "point_to_mesh_distance", {}
    check_floats(name, "pointclouds", pointclouds, ("B", "P", 3), sizes)
    check_floats(name, "face_vertices", face_vertices, ("B", "F", 3, 3), sizes, pointclouds)
    if pointclouds.shape[1]:
        check_not_empty(name, "face_vertices", face_vertices, "faces")
    face, weights = map(torch.from_numpy, surface_tools().nearest_faces(
        to_numpy(pointclouds), to_numpy(face_vertices), threads()))
    corners = face_vertices.gather(1, face[..., None, None].expand(-1, -1, 3, 3))
    pattern = ((weights > 0) * torch.tensor([1, 2, 4])).sum(dim=-1)
    return _SquaredDistance.apply(pointclouds, corners, weights), face, _TYPES[pattern]


class _SquaredDistance(torch.autograd.Function):
    """Of points [B,P,3] to the places on triangles [B,P,3,3] that weights [B,P,3] of corners name.
    They are where the distance is least, so their change does not change it; but the gradient."""

    @staticmethod
    def forward(ctx: Any, points: torch.Tensor, corners: torch.Tensor,
                weights: torch.Tensor) -> torch.Tensor:
        ctx.save_for_backward(points, corners, weights)
        return (_gap(points, corners, weights)**2).sum(dim=-1)

    @staticmethod
    @first_derivative_only
    def backward(ctx: Any, gradient: torch.Tensor) -> tuple[Optional[torch.Tensor], ...]:
        weights = ctx.saved_tensors[2]
        d_points = 2 * gradient.unsqueeze(-1) * _gap(*ctx.saved_tensors)
        return d_points, -weights.unsqueeze(-1) * d_points.unsqueeze(-2), None


def _gap(points: torch.Tensor, corners: torch.Tensor, weights: torch.Tensor) -> torch.Tensor:
    return points - (weights.unsqueeze(-1) * corners).sum(dim=2)


@full_precision
def average_edge_length(vertices: torch.Tensor, faces: torch.Tensor) -> torch.Tensor:
    """The mean length of each face's three edges. vertices: [B,V,3]. faces: [F,3] int64. Returns
    [B,F]."""
    check_finite("average_edge_length", "vertices", vertices, ("B", "V", 3))
    check_whole("average_edge_length", "faces", faces, ("F", 3))
    corners = index_vertices_by_faces(vertices, faces)
    return (corners - corners.roll(-1, dims=2)).norm(dim=-1).mean(dim=-1)


@full_precision
def uniform_laplacian_smoothing(vertices: torch.Tensor, faces: torch.Tensor) -> torch.Tensor:
    """Each vertex moved to the mean of its neighbours. vertices: [B,V,3]. faces: [F,3] int64."""
    check_finite("uniform_laplacian_smoothing", "vertices", vertices, ("B", "V", 3))
    return uniform_laplacian(vertices.shape[1], faces).to(vertices.dtype) @ vertices + vertices
