# SPDX-License-Identifier: Apache-2.0
"""kaolin.render.mesh.rasterize."""

from __future__ import annotations

from typing import Any, Optional, Sequence, Union

import torch

from tilegrad import _core
from tilegrad._arrays import as_pixels, check_choice
from tilegrad._dense import first_derivative_only, full_precision
from tilegrad.compat._tensors import check_floats, check_tensor, threads, to_numpy

Features = Union[torch.Tensor, Sequence[torch.Tensor]]

DEFAULT_MULTIPLIER = 1000.
_DEFAULT_EPS = 1e-8
_BACKENDS = ("cuda", "nvdiffrast", "nvdiffrast_fwd")


class _Rasterize(torch.autograd.Function):
    """Visibility and interpolation; gradients to the corners in the image and to features."""

    @staticmethod
    def forward(ctx: Any, face_vertices_image: torch.Tensor, face_features: torch.Tensor,
                face_vertices_z: torch.Tensor, valid_faces: Optional[torch.Tensor],
                size: tuple[int, int], eps: float) -> tuple[torch.Tensor, torch.Tensor]:
        valid = None if valid_faces is None else to_numpy(valid_faces.bool().byte())
        image, face_idx = map(torch.from_numpy, _core.rasterize_projected(
            to_numpy(face_vertices_image), to_numpy(face_vertices_z), to_numpy(face_features),
            valid, *size, eps, threads()))
        ctx.eps = eps
        ctx.save_for_backward(face_vertices_image, face_features, face_idx)
        long_idx = face_idx.to(torch.int64)
        ctx.mark_non_differentiable(long_idx)
        return image, long_idx

    @staticmethod
    @first_derivative_only
    def backward(ctx: Any, gradient: torch.Tensor, _: Any) -> tuple[Optional[torch.Tensor], ...]:
        face_vertices_image, face_features, face_idx = ctx.saved_tensors
        wanted = ctx.needs_input_grad[:2]
        gradients = _core.rasterize_projected_backward(
            to_numpy(face_vertices_image), to_numpy(face_features), to_numpy(face_idx),
            to_numpy(gradient), ctx.eps, *wanted, threads())
        return (*(torch.from_numpy(g) if want else None for g, want in zip(gradients, wanted)),
                None, None, None, None)


@full_precision
def rasterize(height: int, width: int, face_vertices_z: torch.Tensor,
              face_vertices_image: torch.Tensor, face_features: Features,
              valid_faces: Optional[torch.Tensor] = None, multiplier: Optional[float] = None,
              eps: Optional[float] = None,
              backend: str = "cuda") -> tuple[Union[torch.Tensor, tuple], torch.Tensor]:
    """Draws faces that come projected, and interpolates their features linearly on the screen.

    height, width: pixels, 1..16384.
    face_vertices_z: [B,F,3] camera z; the largest is nearest, of equal ones the first face's
        (faces with the same corners in any order, or whose corners have one z). It has no gradient.
    face_vertices_image: [B,F,3,2] NDC, y up.
    face_features: [B,F,3,C], or a list of such tensors.
    valid_faces: [B,F] bool, or numbers, of which 0 is False; the others are not drawn.
    multiplier, eps: weights are W_k / (S + sign(S) eps), W_k and S areas in coordinates times
        multiplier; None is 1000 and 1e-8.
    backend: Kaolin's names are accepted and mean the same thing here.
    Returns features [B,H,W,C] (a tuple if face_features is a list), 0 at background pixels, and
    face_idx [B,H,W] int64, -1 at background pixels.
    TypeError, ValueError: a tensor of another kind, dtype or shape; numbers that are not finite.
    """
    name = "rasterize"
    sizes: dict = {}
    size = as_pixels(name, "height", height), as_pixels(name, "width", width)
    check_choice(name, "backend", backend, _BACKENDS)
    check_floats(name, "face_vertices_image", face_vertices_image, ("B", "F", 3, 2), sizes)
    check_floats(name, "face_vertices_z", face_vertices_z, ("B", "F", 3), sizes,
                 face_vertices_image)
    several = isinstance(face_features, (list, tuple))
    features = list(face_features) if several else [face_features]
    if not features:
        raise ValueError(f"{name}: face_features is empty, expected at least one tensor")
    for i, feature in enumerate(features):
        argument = f"face_features[{i}]" if several else "face_features"
        check_floats(name, argument, feature, ("B", "F", 3, f"C{i}"), sizes, face_vertices_image)
    if valid_faces is not None:
        check_tensor(name, "valid_faces", valid_faces, ("B", "F"), sizes)
    scale = DEFAULT_MULTIPLIER if multiplier is None else multiplier
    check_multiplier(name, scale)
    image, face_idx = _Rasterize.apply(
        face_vertices_image, torch.cat(features, dim=-1) if several else features[0],
        face_vertices_z, valid_faces, size,
        (_DEFAULT_EPS if eps is None else eps) / scale**2)
    if not several:
        return image, face_idx
    parts = torch.split(image, [feature.shape[-1] for feature in features], dim=-1)
    return tuple(part.clone() for part in parts), face_idx  # callers write into them


def check_multiplier(function: str, multiplier: float) -> None:
    """ValueError unless it is > 0."""
    if not multiplier > 0:
        raise ValueError(f"{function}: multiplier is {multiplier}, expected a number > 0")
