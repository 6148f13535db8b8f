# SPDX-License-Identifier: Apache-2.0
"""kaolin.render.mesh.dibr_soft_mask and dibr_rasterization.

Kaolin counts a face only for pixels in its box grown by `boxlen`, and of these only the first
`knum` in the order of faces, so its mask may be far from the paper's equation 6 and depends on that
order. Here the mask is equation 6 over all faces within `max_alpha_error`, unless exact_kaolin asks
for Kaolin's rule.
"""

from __future__ import annotations

import warnings
from typing import Any, Optional, Union

import torch

from tilegrad import _core
from tilegrad._arrays import as_number
from tilegrad._dense import first_derivative_only, full_precision
from tilegrad.compat._tensors import check_floats, check_tensor, check_whole, threads, to_numpy
from tilegrad.compat.kaolin.render.mesh.rasterization import (
    DEFAULT_MULTIPLIER, Features, check_multiplier, rasterize)

_MAX_ALPHA_ERROR = {torch.float32: 1e-6, torch.float64: 1e-12}
_KAOLIN_EDGE_EPS = 1e-7  # added to squared lengths in coordinates times multiplier
_warned = False
_exact_kaolin = False


def use_exact_kaolin(on: bool = True) -> None:
    """Sets what exact_kaolin=None, the default, means in the whole program; initially False. For
    code that does not pass the argument."""
    global _exact_kaolin
    _exact_kaolin = bool(on)


class _SoftMask(torch.autograd.Function):
    """The mask, and its gradient to the corners in the image."""

    @staticmethod
    def forward(ctx: Any, face_vertices_image: torch.Tensor, face_idx: torch.Tensor,
                options: Any) -> torch.Tensor:
        mask, _ = _core.projected_soft_mask(to_numpy(face_vertices_image), to_numpy(face_idx),
                                            options, threads())
        mask = torch.from_numpy(mask)
        ctx.options = options
        ctx.save_for_backward(face_vertices_image, face_idx, mask)
        return mask

    @staticmethod
    @first_derivative_only
    def backward(ctx: Any, gradient: torch.Tensor) -> tuple[Optional[torch.Tensor], ...]:
        face_vertices_image, face_idx, mask = ctx.saved_tensors
        return torch.from_numpy(_core.projected_soft_mask_backward(
            to_numpy(face_vertices_image), to_numpy(face_idx), to_numpy(mask), to_numpy(gradient),
            ctx.options, threads())), None, None


@full_precision
def dibr_soft_mask(face_vertices_image: torch.Tensor, selected_face_idx: torch.Tensor,
                   sigmainv: float = 7000, boxlen: float = 0.02, knum: int = 30,
                   multiplier: float = 1000., *, exact_kaolin: Optional[bool] = None,
                   max_alpha_error: Optional[float] = None) -> torch.Tensor:
    """The soft silhouette: 1 where there is a face, 1 - prod(1 - exp(-sigmainv d^2)) elsewhere, d
    the distance to each face in NDC.

    face_vertices_image: [B,F,3,2] NDC. All faces count.
    selected_face_idx: [B,H,W] integers, as `rasterize` returns them; -1 is background.
    sigmainv: > 0; larger is sharper.
    boxlen, knum: ignored, with one warning, unless exact_kaolin is True: then Kaolin's
        truncation is reproduced, with multiplier in its eps. None: as use_exact_kaolin says.
    max_alpha_error: how far the mask may be from the formula over all faces, in [0, 1]; None is
        1e-6 for float32 (plus rounding) and 1e-12 for float64. 0 leaves nothing out.
    Returns [B,H,W]. TypeError, ValueError: as `rasterize`.
    """
    paper = _kaolins_numbers(boxlen, knum, exact_kaolin)
    return _soft_mask(face_vertices_image, selected_face_idx, sigmainv, multiplier, paper,
                      max_alpha_error)


@full_precision
def dibr_rasterization(height: int, width: int, face_vertices_z: torch.Tensor,
                       face_vertices_image: torch.Tensor, face_features: Features,
                       face_normals_z: torch.Tensor, sigmainv: float = 7000,
                       boxlen: float = 0.02, knum: int = 30,
                       multiplier: Optional[float] = None, eps: Optional[float] = None,
                       rast_backend: str = "cuda", *, exact_kaolin: Optional[bool] = None,
                       max_alpha_error: Optional[float] = None
                       ) -> tuple[Union[torch.Tensor, tuple], torch.Tensor, torch.Tensor]:
    """`rasterize`, for faces with face_normals_z [B,F] (or [B,F,1]) >= 0, and `dibr_soft_mask`,
    over all faces.

    Arguments as in those two. Returns features [B,H,W,C] (a tuple if face_features is a list),
    soft_mask [B,H,W], face_idx [B,H,W] int64.
    """
    check_floats("dibr_rasterization", "face_vertices_image", face_vertices_image,
                 ("B", "F", 3, 2))
    batch_and_faces = tuple(face_vertices_image.shape[:2])
    if isinstance(face_normals_z, torch.Tensor) and face_normals_z.ndim == 3:
        check_tensor("dibr_rasterization", "face_normals_z", face_normals_z, (*batch_and_faces, 1))
        face_normals_z = face_normals_z.squeeze(2)
    check_tensor("dibr_rasterization", "face_normals_z", face_normals_z, batch_and_faces)
    features, face_idx = rasterize(height, width, face_vertices_z, face_vertices_image,
                                   face_features, face_normals_z >= 0, multiplier, eps,
                                   rast_backend)
    paper = _kaolins_numbers(boxlen, knum, exact_kaolin)
    mask = _soft_mask(face_vertices_image, face_idx, sigmainv,
                      DEFAULT_MULTIPLIER if multiplier is None else multiplier, paper,
                      max_alpha_error)
    return features, mask, face_idx


def _soft_mask(face_vertices_image: torch.Tensor, face_idx: torch.Tensor, sigmainv: float,
               multiplier: float, paper: Optional[dict],
               max_alpha_error: Optional[float]) -> torch.Tensor:
    """dibr_soft_mask by Kaolin's rule with the numbers of `paper`, by our own if that is None."""
    _check_mask_input(face_vertices_image, face_idx, sigmainv, multiplier)
    if paper is not None:
        options = _core.ProjectedMaskOptions.paper(
            delta=1 / sigmainv, edge_eps=_KAOLIN_EDGE_EPS / multiplier**2, **paper)
    else:
        if max_alpha_error is None:
            max_alpha_error = _MAX_ALPHA_ERROR[face_vertices_image.dtype]
        options = _core.ProjectedMaskOptions(delta=1 / sigmainv, max_alpha_error=max_alpha_error)
    return _SoftMask.apply(face_vertices_image, _as_int32(face_idx), options)


def _check_mask_input(face_vertices_image: torch.Tensor, face_idx: torch.Tensor, sigmainv: float,
                      multiplier: float) -> None:
    name = "dibr_soft_mask"
    sizes: dict = {}
    check_floats(name, "face_vertices_image", face_vertices_image, ("B", "F", 3, 2), sizes)
    check_whole(name, "selected_face_idx", face_idx, ("B", "H", "W"), sizes)
    if not sigmainv > 0:
        raise ValueError(f"{name}: sigmainv is {sigmainv}, expected a number > 0")
    check_multiplier(name, multiplier)


def _as_int32(face_idx: torch.Tensor) -> torch.Tensor:
    """Face ids as the engine has them; those of rasterize are in range, others are checked."""
    limits = torch.iinfo(torch.int32)
    if face_idx.numel() and not limits.min <= int(face_idx.min()) <= int(
            face_idx.max()) <= limits.max:
        raise ValueError("dibr_soft_mask: selected_face_idx has values out of int32's range")
    return face_idx.to(torch.int32)


def _kaolins_numbers(boxlen: float, knum: int, exact_kaolin: Optional[bool]) -> Optional[dict]:
    """What Kaolin's rule needs; None for our own rule."""
    if _exact_kaolin if exact_kaolin is None else exact_kaolin:
        return {"boxlen": as_number("dibr_soft_mask", "boxlen", boxlen, float),
                "knum": as_number("dibr_soft_mask", "knum", knum, int)}
    _say_once_what_is_ignored()
    return None


def _say_once_what_is_ignored() -> None:
    global _warned
    if not _warned:
        _warned = True
        warnings.warn("tilegrad.compat.kaolin: boxlen and knum are ignored: the soft mask covers "
                      "all faces, within max_alpha_error. exact_kaolin=True, or "
                      "use_exact_kaolin() for the whole program, gives Kaolin's truncated mask.",
                      UserWarning, stacklevel=5)
