# SPDX-License-Identifier: Apache-2.0
"""Cameras, and those of other programs."""

from __future__ import annotations

import numpy as np

from tilegrad import _core
from tilegrad._packed import Packed, Part

_D = _core.CAMERA


class Camera(Packed):
    """A pinhole camera, or N of them.

    World to camera, then camera to pixels::

        p = rotation @ world + translation
        x = cx + fx * p.x / -p.z        # pixels from the left edge
        y = cy - fy * p.y / -p.z        # pixels from the top edge

    Axes as OpenGL: x right, y up, looking along -z. The centre of pixel (column j, row i) is at
    (j + 0.5, i + 0.5).

    rotation: (3, 3) or (N, 3, 3), orthonormal; its rows are the camera's axes in the world.
    translation: (3,) or (N, 3), world units.
    fx, fy, cx, cy: numbers or (N,), pixels: focal lengths and principal point.
    near_plane: number or (N,), > 0, world units; what is nearer is cut away.

    Numbers are kept in float64 and rounded to the dtype of the scene. Errors: TypeError, ValueError
    for what is no array of these shapes; render refuses numbers that are not finite.
    """

    __slots__ = ()
    _SIZE = len(_D)

    rotation = Part(0, (3, 3), "(..., 3, 3) world to camera.")
    translation = Part(9, (3,), "(..., 3) world units.")
    fx = Part(12, (), "(...) focal length, pixels.")
    fy = Part(13, (), "(...) focal length, pixels.")
    cx = Part(14, (), "(...) principal point, pixels from the left edge.")
    cy = Part(15, (), "(...) principal point, pixels from the top edge.")
    near_plane = Part(16, (), "(...) world units.")

    def __init__(self, rotation=np.reshape(_D[:9], (3, 3)).tolist(), translation=_D[9:12],
                 fx=_D[12], fy=_D[13], cx=_D[14], cy=_D[15], near_plane=_D[16]) -> None:
        self._pack(rotation=rotation, translation=translation, fx=fx, fy=fy, cx=cx, cy=cy,
                   near_plane=near_plane)
