# SPDX-License-Identifier: Apache-2.0
"""Reads and writes image files as arrays (height, width, channels), row 0 on top."""

from __future__ import annotations

import os
import warnings
from typing import Any, Optional

import numpy as np

from tilegrad import _arrays, _tools
from tilegrad._arrays import ending_of, name_of, Path

_CHANNELS = {1: ["Y"], 2: ["Y", "A"], 3: ["R", "G", "B"], 4: ["R", "G", "B", "A"]}  # of EXR


def load_image(path: Path, *, max_bytes: Optional[int] = None) -> np.ndarray:
    """Reads an image.

    PNG, JPEG, BMP, TGA, PNM, SGI: (H, W, 1 to 4) uint8; 16 bits are reduced to 8. EXR: (H, W, 1 to 4)
    float32, of its channels R, G, B, A or Y, A or its only one. NPY: the array as it is, float16 as
    float32.
    max_bytes: as in `load_mesh`.
    OSError, ValueError: name the file and what is wrong with it.
    """
    ending = ending_of(path)
    limit = _arrays.as_limit("load_image", max_bytes)
    if ending == ".npy":
        return _tools.load_npy(name_of(path), limit)
    if ending != ".exr":
        return _tools.load_image(name_of(path), limit)
    layers = load_layers(path, max_bytes=max_bytes)
    if len(layers) == 1:
        return np.stack(list(layers.values()), axis=-1)
    for names in reversed(_CHANNELS.values()):
        if set(names) <= set(layers):
            return np.stack([layers[name] for name in names], axis=-1)
    raise ValueError(f"{os.fsdecode(path)}: channels {', '.join(layers)} do not make a picture; "
                     f"load_layers reads them")


def load_layers(path: Path, *, max_bytes: Optional[int] = None) -> dict[str, np.ndarray]:
    """Every channel of an EXR image by its name, (H, W) float32: its display window, 0 where the file
    has no data. Drops what lies outside with a warning. max_bytes: as in `load_mesh`."""
    limit = _arrays.as_limit("load_layers", max_bytes)
    names, planes, left_out = _tools.load_exr(name_of(path), limit)
    for text in left_out:
        warnings.warn(f"{os.fsdecode(path)}: {text}", stacklevel=2)
    return dict(zip(names, planes))


def save_image(path: Path, image: Any, *, planar: bool = False) -> None:
    """Writes an image, whole or not at all; its format follows the ending.

    .png: 8 bits; real numbers 0 to 1 become 0 to 255, what is beyond is clamped. .exr: float32,
    every bit. .npy: the array as it is, of any shape.
    image: (H, W) or (H, W, 1 to 4); with planar (1 to 4, H, W), as renders are.
    ValueError: another ending, shape, or a number that is not finite (PNG). OSError: not written.
    """
    ending = ending_of(path)
    planar = _arrays.as_flag("save_image", "planar", planar)
    if ending == ".npy":
        array = _arrays.plain("save_image", "image", image)
        return _tools.save_npy(name_of(path), np.ascontiguousarray(array).reshape(array.shape))
    if ending not in (".png", ".exr"):
        raise ValueError(f"save_image: {os.fsdecode(path)!r} must end in .png, .exr or .npy")
    if ending == ".png":
        return _tools.save_png(name_of(path), as_bytes("save_image", "image", image, planar))
    pixels = _pixels("save_image", "image", image, planar)
    planes = np.ascontiguousarray(np.moveaxis(pixels, -1, 0), np.float32)
    return _tools.save_exr(name_of(path), _CHANNELS[pixels.shape[-1]], planes)


def save_layers(path: Path, layers: dict[str, Any]) -> None:
    """Writes an image of channels by name, (H, W) each: R, G, B, A, Z and others. path: .exr."""
    if ending_of(path) != ".exr":
        raise ValueError(f"save_layers: {os.fsdecode(path)!r} must end in .exr")
    if not layers:
        raise ValueError(f"save_layers: no layer for {os.fsdecode(path)!r}")
    sizes: dict[str, int] = {}
    names = [_arrays.as_text("save_layers", "layer name", name) for name in layers]
    planes = [_arrays.as_array("save_layers", name, layers[name], np.float32, ("H", "W"), sizes)
              for name in names]
    _tools.save_exr(name_of(path), names, np.stack(planes))


def _pixels(function: str, argument: str, image: Any, planar: bool = False) -> np.ndarray:
    """(H, W, C) of numbers."""
    array = _arrays.plain(function, argument, image)
    if array.dtype.kind not in "buif":
        raise TypeError(f"{function}: {argument} has dtype {array.dtype}, expected numbers")
    if array.ndim == 2:
        return array[..., None]
    if array.ndim == 3 and planar:
        array = np.moveaxis(array, 0, -1)
    if array.ndim != 3 or array.shape[-1] not in _CHANNELS:
        expected = "(1 to 4, H, W)" if planar else "(H, W) or (H, W, 1 to 4)"
        raise ValueError(f"{function}: {argument} has shape {np.shape(image)}, expected {expected}")
    return array


def as_bytes(function: str, argument: str, image: Any, planar: bool = False) -> np.ndarray:
    """(H, W, C) uint8 from uint8, bool, or real numbers of which [0, 1] becomes [0, 255]."""
    pixels = _pixels(function, argument, image, planar)
    if pixels.dtype == bool:
        pixels = pixels * np.uint8(255)
    if pixels.dtype.kind == "f":
        if not np.isfinite(pixels).all():
            raise ValueError(f"{function}: {argument} has numbers that are not finite")
        _arrays.warn_of_bytes(function, argument, pixels)
        pixels = np.rint(np.clip(pixels, 0, 1) * 255).astype(np.uint8)
    if pixels.dtype != np.uint8:
        raise TypeError(f"{function}: {argument} has dtype {pixels.dtype}, expected uint8, bool or "
                        f"floating point")
    return np.ascontiguousarray(pixels)
