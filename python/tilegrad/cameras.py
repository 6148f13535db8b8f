# SPDX-License-Identifier: Apache-2.0
"""Camera files of COLMAP, NeRF and OpenCV. For arrays of those programs' cameras, and of OpenGL's,
Kaolin's and PyTorch3D's, `tilegrad.Camera` has from_... and to_..."""

from __future__ import annotations

import dataclasses
from typing import Any, Iterable, Optional

import numpy as np

from tilegrad import _arrays, _tools
from tilegrad._arrays import ending_of, name_of, Path
from tilegrad._camera import Camera
from tilegrad._camera_arguments import checked_size

_CENTRES = ("integer", "half")
_FORMATS = ("opencv", "nerf", "colmap")


@dataclasses.dataclass
class View:
    """A camera of a file: its name, and the size of its image in pixels."""

    name: str
    camera: Camera
    width: int
    height: int


def load_cameras(path: Path, *, width: int = 0, height: int = 0,
                 opencv_centre: str = "integer") -> list[View]:
    """The cameras of a COLMAP folder (cameras and images, .txt or .bin), of NeRF's transforms.json,
    or of a JSON file with OpenCV's K (docs/rendering.md).

    width, height: of the images, pixels, if the file lacks them. opencv_centre: "integer" or
    "half", as pixel_centre in `Camera.from_opencv`.
    OSError, ValueError: name the file, and the line or frame. Lens distortion is refused.
    """
    half = _arrays.check_choice("load_cameras", "opencv_centre", opencv_centre, _CENTRES) == 1
    size = tuple(_arrays.as_count("load_cameras", name, value)
                 for name, value in (("width", width), ("height", height)))
    views = _tools.load_cameras(name_of(path), size, half)
    return [View(name, Camera.of_numbers(numbers, size if all(size) else None), *size)
            for name, numbers, size in views]


def save_cameras(path: Path, views: Iterable[View], *, format: Optional[str] = None) -> None:
    """Writes what `load_cameras` reads, whole or not at all.

    format: "opencv" or "nerf", a JSON file, or "colmap", a folder of text files. Default: "opencv"
    for a path that ends in .json, else "colmap".
    """
    if format is None:
        format = "opencv" if ending_of(path) == ".json" else "colmap"
    _arrays.check_choice("save_cameras", "format", format, _FORMATS)
    _tools.save_cameras(name_of(path), format,
                        [(_arrays.as_text("save_cameras", "view name", view.name),
                          _numbers(view.camera),
                          checked_size("save_cameras", view.camera.size, (view.width, view.height)))
                         for view in views])


def rotation_from_vector(rvec: Any) -> np.ndarray:
    """(3, 3) from OpenCV's rotation vector (3,), axis times angle in radians, as solvePnP returns
    it."""
    array = _arrays.as_array("rotation_from_vector", "rvec", rvec, np.float64, (3,))
    _arrays.check_finite("rotation_from_vector", "rvec", array)
    return _tools.rotation_from_vector(array)


def _numbers(camera: Camera) -> np.ndarray:
    if not isinstance(camera, Camera) or camera.numbers.ndim != 1:
        raise TypeError("save_cameras: each view's camera must be a single Camera")
    return camera.numbers
