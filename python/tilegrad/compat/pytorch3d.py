# SPDX-License-Identifier: Apache-2.0
"""PyTorch3D's rasterizer on the CPU, by tilegrad, for torch.

`rasterize_meshes` takes the place of PyTorch3D's function of that name: everything around it
(cameras, MeshRasterizer, shaders) stays PyTorch3D's own, and gradients flow to the vertices:

    import pytorch3d.renderer.mesh.rasterizer
    import tilegrad.compat.pytorch3d
    pytorch3d.renderer.mesh.rasterizer.rasterize_meshes = \\
        tilegrad.compat.pytorch3d.rasterize_meshes

`to_fragments` draws tilegrad's scenes.
"""

from __future__ import annotations

import warnings
from typing import Any, Optional, Sequence, Union

import torch

from tilegrad import _core, fragments
from tilegrad._arrays import as_number, check_finite, check_indices
from tilegrad._dense import first_derivative_only, widened
from tilegrad.compat._tensors import check_floats, check_whole, threads, to_numpy

Fragments = fragments.Fragments


def to_fragments(source: Any, faces_per_pixel: int = 1, **options: Any) -> Fragments:
    """tilegrad.fragments.to_fragments, as torch tensors (without gradients: scenes are arrays)."""
    return Fragments(*map(torch.from_numpy,
                          fragments.to_fragments(source, faces_per_pixel, **options)))


class _Rasterize(torch.autograd.Function):
    """Lists of faces; gradients of their numbers to the corners."""

    @staticmethod
    def forward(ctx: Any, face_vertices: torch.Tensor, ranges: list,
                options: Any) -> tuple[torch.Tensor, ...]:
        out = tuple(map(torch.from_numpy, _core.rasterize_layers(
            to_numpy(face_vertices), ranges, options, threads())))
        ctx.options = options
        ctx.save_for_backward(face_vertices, out[0])
        ctx.mark_non_differentiable(out[0])
        return out

    @staticmethod
    @first_derivative_only
    def backward(ctx: Any, _: Any,
                 *gradients: torch.Tensor) -> tuple[Optional[torch.Tensor], ...]:
        face_vertices, pix_to_face = ctx.saved_tensors
        return torch.from_numpy(_core.rasterize_layers_backward(
            to_numpy(face_vertices), to_numpy(pix_to_face), *map(to_numpy, gradients), ctx.options,
            threads())), None, None


def rasterize_meshes(meshes: Any, image_size: Union[int, Sequence[int]] = 256,
                     blur_radius: float = 0.0, faces_per_pixel: int = 8,
                     bin_size: Optional[int] = None, max_faces_per_bin: Optional[int] = None,
                     perspective_correct: bool = False, clip_barycentric_coords: bool = False,
                     cull_backfaces: bool = False, z_clip_value: Optional[float] = None,
                     cull_to_frustum: bool = False) -> tuple[torch.Tensor, ...]:
    """The faces_per_pixel nearest faces of every pixel, for meshes in PyTorch3D's NDC with depths.

    meshes: what has verts_packed() [V,3], faces_packed() [F,3], mesh_to_faces_packed_first_idx()
        [N] and num_faces_per_mesh() [N], as PyTorch3D's Meshes; float32 or float64.
    image_size: pixels, one number or (H, W).
    blur_radius: NDC^2.
    bin_size, max_faces_per_bin, cull_to_frustum: without meaning here: no face is ever dropped for
        want of room, and those beyond the image cost nothing.
    z_clip_value: faces that reach nearer are dropped, not clipped, with a warning.
    Returns pix_to_face [N,H,W,K] int64, zbuf [N,H,W,K], bary_coords [N,H,W,K,3], dists [N,H,W,K];
    -1 after the last face of a pixel. TypeError, ValueError: as tilegrad.compat.kaolin.
    """
    name = "rasterize_meshes"
    vertices, faces = widened(meshes.verts_packed()), meshes.faces_packed()
    check_floats(name, "meshes.verts_packed()", vertices, ("V", 3))
    check_whole(name, "meshes.faces_packed()", faces, ("F", 3))
    check_indices(name, "meshes.faces_packed()", faces.numpy(), len(vertices))
    size = (image_size, image_size) if isinstance(image_size, int) else image_size
    if not isinstance(size, (tuple, list)) or len(size) != 2:
        raise ValueError(f"{name}: image_size is {image_size!r}, expected pixels or (H, W)")
    height, width = size
    options = fragments.layered_options(name, height, width, faces_per_pixel, blur_radius,
                                        perspective_correct, clip_barycentric_coords,
                                        cull_backfaces)
    corners = vertices.index_select(0, faces.reshape(-1)).reshape(-1, 3, 3)
    if z_clip_value is not None:
        nearest = as_number(name, "z_clip_value", z_clip_value, float)
        check_finite(name, "z_clip_value", nearest)
        corners = _without_cut_faces(corners, nearest)
    ranges = list(zip(meshes.mesh_to_faces_packed_first_idx().tolist(),
                      meshes.num_faces_per_mesh().tolist()))
    return _Rasterize.apply(corners, ranges, options)


def _without_cut_faces(corners: torch.Tensor, z_clip_value: float) -> torch.Tensor:
    """Faces that reach nearer than that have depth -1, which leaves them out."""
    near = corners[..., 2] < z_clip_value
    out = near.any(dim=1)
    if bool((out & ~near.all(dim=1)).any()):
        warnings.warn("tilegrad.compat.pytorch3d: faces that cross z_clip_value are left out "
                      "instead of cut", UserWarning, stacklevel=3)
    return torch.where(out[:, None, None], torch.full_like(corners, -1), corners)
