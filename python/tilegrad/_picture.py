# SPDX-License-Identifier: Apache-2.0
"""Frames as images in files and notebooks."""

from __future__ import annotations

import struct
import zlib
from typing import Any, Optional, Sequence

import numpy as np

from tilegrad import _arrays


class Pictured:
    """Display and export of a Frame."""

    __slots__ = ()
    background: Optional[Sequence[float]]  # r, g, b that pictures are drawn over; unset: none

    def picture(self, index: int = 0) -> np.ndarray:
        """An image for display: (H, W, 4) uint8, transparent, or over `background` if that is
        set."""
        return pixels_of(self, index, getattr(self, "background", None))

    def save(self, path: Any, index: int = 0) -> None:
        """Writes `picture(index)` as .png, or in another format of `tilegrad.images.save_image`."""
        from tilegrad.images import save_image
        save_image(path, self.picture(index))

    def _repr_png_(self) -> Optional[bytes]:
        """The display in notebooks: up to eight images side by side; None: there are none."""
        if not len(self):
            return None
        return _encoded(np.hstack([self.picture(i) for i in range(min(len(self), 8))]))


def pixels_of(frame: Any, index: int, background: Optional[Sequence[float]]) -> np.ndarray:
    """(H, W, 4) uint8 of an image: colours as they are, over the background or transparent."""
    color = np.moveaxis(np.array(frame.color[index], np.float32), 0, -1)
    drawn = frame.face_ids[index] >= 0
    if "alpha" not in frame.outputs:
        alpha = drawn.astype(np.float32)
    else:
        alpha = np.array(frame.alpha[index], np.float32)
        color = _extended(color, drawn)
    if background is not None:
        over = _arrays.as_array("Frame", "background", background, np.float32, (3,))
        color = over + alpha[..., None] * (color - over)
        alpha = np.ones_like(alpha)
    picture = np.concatenate([color, alpha[..., None]], axis=-1)
    return np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)


def _extended(color: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """Colours extended outward by two pixels, where alpha fades: undrawn pixels are black."""
    color, known = color.copy(), drawn.copy()
    for _ in range(2):
        total, count = np.zeros_like(color), np.zeros(known.shape, np.float32)
        for shift in ((0, 1), (0, -1), (1, 0), (-1, 0)):
            beside = np.roll(known, shift, axis=(0, 1))
            total += np.where(beside[..., None], np.roll(color, shift, axis=(0, 1)), 0)
            count += beside
        new = ~known & (count > 0)
        color[new] = total[new] / count[new][:, None]
        known |= new
    return color


_COLOR_TYPES = {1: 0, 2: 4, 3: 2, 4: 6}  # by channels


def _encoded(pixels: np.ndarray) -> bytes:
    """(H, W, 1 to 4) uint8."""
    height, width, channels = pixels.shape
    rows = np.zeros((height, 1 + width * channels), np.uint8)  # a filter byte leads each row
    rows[:, 1:] = pixels.reshape(height, -1)
    header = struct.pack(">IIBBBBB", width, height, 8, _COLOR_TYPES[channels], 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 6)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*chunk) for chunk in chunks)


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
