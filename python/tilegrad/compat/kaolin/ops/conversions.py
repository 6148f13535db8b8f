# SPDX-License-Identifier: Apache-2.0
"""kaolin.ops.conversions: voxel grids. Voxel i of R along an axis is the cube around i / (R - 1) of
the grid's side; grids have no gradient."""

from __future__ import annotations

from typing import Optional

import torch

from tilegrad.compat._tensors import (check_floats, check_not_empty, check_tensor, surface_tools,
                                      to_numpy)
from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.ops.mesh import index_vertices_by_faces

__getattr__ = missing_from(__name__)

# The corners of a voxel's sides, counter-clockwise from outside; of the axis x, the others by
# rotation.
_SIDES = torch.tensor([[[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]],
                       [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]]])


def trianglemeshes_to_voxelgrids(vertices: torch.Tensor, faces: torch.Tensor, resolution: int,
                                 origin: Optional[torch.Tensor] = None,
                                 scale: Optional[torch.Tensor] = None,
                                 return_sparse: bool = False) -> torch.Tensor:
    """The voxels that a surface passes through; Kaolin samples it, so that it misses some that are
    touched at a corner.

    vertices: [B,V,3]. faces: [F,3] int64. resolution: 1..512. origin: [B,3] and scale: [B], the
        grid's corner and side; None: those of the mesh's box.
    Returns [B,R,R,R] of 0 and 1; sparse if return_sparse.
    """
    name = "trianglemeshes_to_voxelgrids"
    check_floats(name, "vertices", vertices, ("B", "V", 3))
    points = _in_grid(name, vertices.detach(), resolution, origin, scale).double() + 0.5
    corners = index_vertices_by_faces(points, faces)
    grid = torch.zeros(len(vertices), resolution, resolution, resolution, dtype=vertices.dtype)
    for image, triangles in zip(grid, corners):
        image.copy_(torch.from_numpy(surface_tools().surface_voxels(to_numpy(triangles),
                                                                    resolution)))
    return grid.to_sparse() if return_sparse else grid


def pointclouds_to_voxelgrids(pointclouds: torch.Tensor, resolution: int,
                              origin: Optional[torch.Tensor] = None,
                              scale: Optional[torch.Tensor] = None,
                              return_sparse: bool = False) -> torch.Tensor:
    """The voxels with points. pointclouds: [B,P,3]; the rest as in trianglemeshes_to_voxelgrids."""
    name = "pointclouds_to_voxelgrids"
    check_floats(name, "pointclouds", pointclouds, ("B", "P", 3))
    points = _in_grid(name, pointclouds.detach(), resolution, origin, scale).round()
    image, point = ((points >= 0) & (points < resolution)).all(dim=-1).nonzero(as_tuple=True)
    grid = torch.zeros(len(points), resolution, resolution, resolution, dtype=pointclouds.dtype)
    grid[(image, *points[image, point].long().unbind(dim=-1))] = 1
    return grid.to_sparse() if return_sparse else grid


def _in_grid(name: str, points: torch.Tensor, resolution: int, origin: Optional[torch.Tensor],
             scale: Optional[torch.Tensor]) -> torch.Tensor:
    """Points with the centre of voxel i at i."""
    if not isinstance(resolution, int):
        raise TypeError(f"{name}: resolution is {type(resolution).__name__}, expected int")
    if not 1 <= resolution <= 512:
        raise ValueError(f"{name}: resolution is {resolution}, expected 1..512")
    batch = len(points)
    if origin is None or scale is None:
        check_not_empty(name, "the mesh or cloud", points, "points")
    origin = points.amin(dim=1) if origin is None else origin
    check_tensor(name, "origin", origin, (batch, 3))
    scale = (points.amax(dim=1) - origin).amax(dim=1) if scale is None else scale
    check_tensor(name, "scale", scale, (batch,))
    placed = (points - origin[:, None]) / scale[:, None, None] * (resolution - 1)
    if not torch.isfinite(placed).all():
        raise ValueError(f"{name}: points, origin or scale are not finite, or the scale is 0")
    return placed


def voxelgrids_to_cubic_meshes(voxelgrids: torch.Tensor, is_trimesh: bool = True
                               ) -> tuple[list[torch.Tensor], list[torch.Tensor]]:
    """The sides of voxels that are not 0 which border on voxels that are 0; voxel (i, j, k) is the
    cube from there to (i + 1, j + 1, k + 1). voxelgrids: [B,X,Y,Z]. Returns for each vertices
    [V,3], each once, and faces [F,3] int64, [F,4] if not is_trimesh; counter-clockwise from
    outside."""
    check_tensor("voxelgrids_to_cubic_meshes", "voxelgrids", voxelgrids, ("B", "X", "Y", "Z"))
    meshes = [_cubes(grid != 0) for grid in voxelgrids]
    vertices = [v.to(torch.float32) for v, _ in meshes]
    if not is_trimesh:
        return vertices, [quads for _, quads in meshes]
    return vertices, [quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3) for _, quads in meshes]


def _cubes(solid: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Vertices [V,3] and quads [Q,4] of the border of [X,Y,Z]."""
    padded = torch.nn.functional.pad(solid, (1,) * 6)
    quads = []
    for axis in range(3):
        for side, step in enumerate((1, -1)):
            beside = padded.roll(step, dims=axis)[1:-1, 1:-1, 1:-1]
            at = (solid & ~beside).nonzero()
            quads.append(at[:, None] + _SIDES[side].roll(axis, dims=1))
    vertices, index = torch.cat(quads).reshape(-1, 3).unique(dim=0, return_inverse=True)
    return vertices, index.reshape(-1, 4)
