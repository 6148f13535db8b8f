# SPDX-License-Identifier: Apache-2.0
"""Edges of faces, and Loop's subdivision, as in kaolin.ops.mesh.subdivide_trianglemesh."""

from __future__ import annotations

import math
from typing import NamedTuple, Optional

import torch

from tilegrad.compat._tensors import check_floats, check_tensor


class _Edges(NamedTuple):
    """ends [E,2], sorted; of_faces [F,3], edge k from corner k to corner k + 1; inner [E,1]: two
    faces meet there."""

    ends: torch.Tensor
    of_faces: torch.Tensor
    inner: torch.Tensor


def subdivide_trianglemesh(vertices: torch.Tensor, faces: torch.Tensor, iterations: int,
                           alpha: Optional[torch.Tensor] = None
                           ) -> tuple[torch.Tensor, torch.Tensor]:
    """Each face becomes four, `iterations` times; a vertex moves by its alpha towards the mean of
    its neighbours, those of the border, too, as in Kaolin.

    vertices: [B,V,3]. faces: [F,3] int64. alpha: [B,V], 0 keeps a vertex where it is, and new
        vertices get theirs as they get their place; None: Loop's (Charles Loop: Smooth subdivision
        surfaces based on triangles, 1987).
    Returns [B,V',3], the old vertices first, and [4^iterations F,3]. Gradients flow to vertices and
    alpha.
    """
    name, sizes = "subdivide_trianglemesh", {}
    check_floats(name, "vertices", vertices, ("B", "V", 3), sizes)
    check_tensor(name, "faces", faces, ("F", 3))
    if alpha is not None:
        check_floats(name, "alpha", alpha, ("B", "V"), sizes, vertices)
        alpha = alpha.unsqueeze(-1)
    for _ in range(iterations):
        edges = _edges_of(faces)
        count = vertices.shape[1]
        neighbours, degree = _neighbours(vertices, edges.ends)
        weight = _loops_alpha(degree) if alpha is None else alpha * (degree > 0)
        moved = (1 - weight) * vertices + weight * neighbours / degree.clamp(min=1)
        if alpha is not None:
            alpha = torch.cat([alpha, _on_edges(alpha, faces, edges)], dim=1)
        vertices = torch.cat([moved, _on_edges(vertices, faces, edges)], dim=1)
        faces = _split(faces, edges.of_faces + count)
    return vertices, faces


def adjacency(faces: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Edges [E,2] of faces [F,3], and the faces [F,3] beyond their edges, -1 where there is no face
    or more than one."""
    edges = _edges_of(faces)
    own = torch.arange(len(faces))[:, None].expand(-1, 3)
    sums = torch.zeros(len(edges.ends), dtype=torch.int64).index_add(
        0, edges.of_faces.reshape(-1), own.reshape(-1))
    inner = edges.inner.squeeze(1)[edges.of_faces]
    return edges.ends, torch.where(inner, sums[edges.of_faces] - own, -1)


def _edges_of(faces: torch.Tensor) -> _Edges:
    pairs = torch.stack([faces, faces.roll(-1, dims=1)], dim=-1).sort(dim=-1)[0]
    ends, of_faces, counts = pairs.reshape(-1, 2).unique(dim=0, return_inverse=True,
                                                         return_counts=True)
    return _Edges(ends, of_faces.reshape(-1, 3), (counts == 2)[:, None])


def _neighbours(values: torch.Tensor, ends: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """The sum over each vertex's neighbours [B,V,C], and their number [V,1]."""
    to, at = ends.reshape(-1), ends.flip(1).reshape(-1)
    degree = torch.bincount(to, minlength=values.shape[1]).to(values.dtype)
    return torch.zeros_like(values).index_add(1, to, values[:, at]), degree[:, None]


def _loops_alpha(degree: torch.Tensor) -> torch.Tensor:
    turn = torch.cos(2 * math.pi / degree.clamp(min=1))
    return (5 / 8 - (3 / 8 + turn / 4)**2) * (degree > 0)


def _on_edges(values: torch.Tensor, faces: torch.Tensor, edges: _Edges) -> torch.Tensor:
    """[B,E,C]: 3/8 of both ends and 1/8 of both corners opposite; halfway on the border."""
    ends = values[:, edges.ends].sum(dim=2)
    opposite = torch.zeros_like(ends).index_add(
        1, edges.of_faces.reshape(-1), values[:, faces.roll(1, dims=1).reshape(-1)])
    return torch.where(edges.inner, 3 / 8 * ends + opposite / 8, ends / 2)


def _split(faces: torch.Tensor, middles: torch.Tensor) -> torch.Tensor:
    """Faces [F,3] with vertices [F,3] on their edges: one at each corner, and the middle."""
    (a, b, c), (ab, bc, ca) = faces.unbind(dim=1), middles.unbind(dim=1)
    parts = [(b, bc, ab), (a, ab, ca), (c, ca, bc), (ca, ab, bc)]
    return torch.stack([torch.stack(part, dim=-1) for part in parts], dim=1).reshape(-1, 3)
