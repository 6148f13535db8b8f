# SPDX-License-Identifier: Apache-2.0
"""texture."""

from __future__ import annotations

from typing import Any, NamedTuple, Optional, Sequence, Union

import torch

from tilegrad import _core
from tilegrad._arrays import Sizes, check_choice
from tilegrad._dense import first_derivative_only, full_precision
from tilegrad.compat import _tensors

_FILTERS = ("auto", *_core.TEXTURE_FILTERS)
_BOUNDARIES = _core.TEXTURE_BOUNDARIES
_MOST_LEVELS = 32  # more than any texture has
_MIPMAPPED = ("linear-mipmap-nearest", "linear-mipmap-linear")


class TextureMip:
    """The levels below a texture: what `texture_construct_mip` returns."""

    def __init__(self, levels: Sequence[torch.Tensor], base: torch.Size) -> None:
        self.levels = tuple(levels)
        self.base = base


class _Call(NamedTuple):
    filter: int
    boundary: int
    own_levels: bool  # levels that were made of the texture: their gradient goes to it

    def record(self, uv: torch.Tensor, uv_da: Optional[torch.Tensor],
               bias: Optional[torch.Tensor]) -> _core.TextureCall:
        return _core.TextureCall(
            uv=_tensors.to_numpy(uv), uv_da=_tensors.optional_numpy(uv_da),
            mip_level_bias=_tensors.optional_numpy(bias), filter=self.filter,
            boundary=self.boundary, threads=_tensors.threads())


class _Texture(torch.autograd.Function):
    @staticmethod
    def forward(ctx, call, uv, uv_da, bias, *levels):
        ctx.save_for_backward(uv, uv_da, bias, *levels)
        ctx.call = call
        return torch.from_numpy(_core.nvdiffrast_texture(
            [_tensors.to_numpy(level) for level in levels], call.record(uv, uv_da, bias)))

    @staticmethod
    @first_derivative_only
    def backward(ctx, d_out):
        uv, uv_da, bias, *levels = ctx.saved_tensors
        wants_levels = any(ctx.needs_input_grad[4:])
        d_levels, *d_others = _core.nvdiffrast_texture_backward(
            [_tensors.to_numpy(level) for level in levels], ctx.call.record(uv, uv_da, bias),
            _tensors.to_numpy(d_out), [wants_levels, *ctx.needs_input_grad[1:4]])
        if not wants_levels:
            d_levels = [None] * len(levels)
        elif ctx.call.own_levels:
            base = _core.nvdiffrast_mip_backward(d_levels, _tensors.threads())
            d_levels = [base] + [None] * (len(levels) - 1)
        return (None, *map(_tensors.optional_tensor, d_others),
                *map(_tensors.optional_tensor, d_levels))


@full_precision
def texture(tex: torch.Tensor, uv: torch.Tensor, uv_da: Optional[torch.Tensor] = None,
            mip_level_bias: Optional[torch.Tensor] = None,
            mip: Union[None, TextureMip, Sequence[torch.Tensor]] = None, filter_mode: str = "auto",
            boundary_mode: str = "wrap", max_mip_level: Optional[int] = None) -> torch.Tensor:
    """Lookups in a texture or a cube map.

    tex: [N, H, W, C], or of a cube map (boundary_mode 'cube') [N, 6, S, S, C]; [1, ...] for all
    images. uv: [N, h, w, 2], of a cube map directions [N, h, w, 3]. uv_da: derivatives of uv by X
    and Y, [N, h, w, 4 or 6]. mip_level_bias: [N, h, w], added to the level that follows from
    uv_da, or the level itself without uv_da. mip: the levels below tex, of texture_construct_mip or
    a list of tensors, which then have separate gradients; made from tex if not given.

    filter_mode: 'nearest', 'linear', 'linear-mipmap-nearest', 'linear-mipmap-linear', or 'auto':
    the last if uv_da or mip_level_bias is given, else 'linear'. boundary_mode: 'wrap', 'clamp',
    'zero' or 'cube'. max_mip_level: the last level that is used, 0 is tex.

    Returns [N, h, w, C]. Gradients flow to tex, uv, uv_da and mip_level_bias. Coordinates that are
    not finite, and the zero vector in a cube map, give zeros and no gradient.

    TypeError, ValueError: an argument is not as above, or a side that has to be halved is odd.
    """
    boundary = check_choice("texture", "boundary_mode", boundary_mode, _BOUNDARIES)
    filter_mode = _filter(filter_mode, uv_da is not None or mip_level_bias is not None)
    cube = boundary_mode == "cube"
    sizes: Sizes = {}
    _tensors.check_floats("texture", "uv", uv, ("N", "h", "w", 3 if cube else 2), sizes)
    _check_texture("texture", tex, cube, sizes["N"], uv)
    mipmapped = filter_mode in _MIPMAPPED
    if mipmapped:
        _check_footprint(uv, uv_da, mip_level_bias, sizes)
    levels, own = _levels(tex, mip, max_mip_level, cube) if mipmapped else ((), False)
    call = _Call(_core.TEXTURE_FILTERS.index(filter_mode), boundary, own)
    return _Texture.apply(call, uv, uv_da if mipmapped else None,
                          mip_level_bias if mipmapped else None, tex, *levels)


@full_precision
def texture_construct_mip(tex: torch.Tensor, max_mip_level: Optional[int] = None,
                          cube_mode: bool = False) -> TextureMip:
    """The levels below `tex` for `texture`, of a tex that stays the same: each the mean of 2 x 2 of
    the one before, down to 1 x 1 or to `max_mip_level`.

    ValueError: a side that has to be halved is odd.
    """
    _check_texture("texture_construct_mip", tex, bool(cube_mode), None, None)
    most = _most("texture_construct_mip", max_mip_level)
    levels = _core.nvdiffrast_mip(_tensors.to_numpy(tex), most, _tensors.threads())
    return TextureMip([torch.from_numpy(level) for level in levels], tex.shape)


def _filter(filter_mode: Any, footprint: bool) -> str:
    check_choice("texture", "filter_mode", filter_mode, _FILTERS)
    if filter_mode == "auto":
        return "linear-mipmap-linear" if footprint else "linear"
    if filter_mode in _MIPMAPPED and not footprint:
        raise ValueError(f"texture: filter_mode {filter_mode!r} needs uv_da or mip_level_bias")
    return filter_mode


def _check_texture(function: str, tex: Any, cube: bool, images: Optional[int],
                   like: Optional[torch.Tensor]) -> None:
    shape = ("Nt", 6, "S", "S", "C") if cube else ("Nt", "H", "W", "C")
    sizes: Sizes = {}
    _tensors.check_floats(function, "tex", tex, shape, sizes, like)
    if tex.numel() == 0:
        raise ValueError(f"{function}: tex has shape {tuple(tex.shape)}, which is empty")
    if images is not None and sizes["Nt"] not in (1, images):
        raise ValueError(f"{function}: tex has {sizes['Nt']} textures, expected 1, or {images} as "
                         f"uv has images")


def _check_footprint(uv: torch.Tensor, uv_da: Any, mip_level_bias: Any, sizes: Sizes) -> None:
    if uv_da is not None:
        _tensors.check_floats("texture", "uv_da", uv_da, ("N", "h", "w", 2 * uv.shape[3]), sizes,
                              uv)
    if mip_level_bias is not None:
        _tensors.check_floats("texture", "mip_level_bias", mip_level_bias, ("N", "h", "w"), sizes,
                              uv)


def _most(function: str, max_mip_level: Any) -> int:
    """The last level, -1 for all there are."""
    if max_mip_level is None:
        return -1
    try:
        most = int(max_mip_level)
    except (TypeError, ValueError, OverflowError):
        most = -1
    if most != max_mip_level or most < 0:
        raise ValueError(f"{function}: max_mip_level is {max_mip_level!r}, must be a whole number, "
                         f"0 or more")
    return min(most, _MOST_LEVELS)


def _levels(tex: torch.Tensor, mip: Any, max_mip_level: Any, cube: bool) -> tuple:
    """The levels below `tex`, and whether they are its own."""
    most = _most("texture", max_mip_level)
    if mip is None:
        mip = texture_construct_mip(tex.detach(), max_mip_level, cube)
    if isinstance(mip, TextureMip):
        if mip.base != tex.shape:
            raise ValueError(f"texture: mip was made of a texture {tuple(mip.base)}, but tex has "
                             f"shape {tuple(tex.shape)}")
        return mip.levels[:most] if most >= 0 else mip.levels, True
    if not isinstance(mip, (list, tuple)):
        raise TypeError(f"texture: mip is {type(mip).__name__}, expected a list of tensors or what "
                        f"texture_construct_mip returns")
    _check_levels(tex, mip)
    return tuple(mip[:most] if most >= 0 else mip), False


def _check_levels(tex: torch.Tensor, mip: Sequence[Any]) -> None:
    shape = list(tex.shape)
    for i, level in enumerate(mip):
        for axis in (-3, -2):
            if shape[axis] > 1 and shape[axis] % 2:
                raise ValueError(f"texture: mip has a level {i}, but the one before it has "
                                 f"{shape[-3]} x {shape[-2]} texels, which cannot be halved")
            shape[axis] = max(1, shape[axis] // 2)
        _tensors.check_floats("texture", f"mip[{i}]", level, shape, None, tex)
