# SPDX-License-Identifier: Apache-2.0
"""The K nearest faces of every pixel, as PyTorch3D's rasterizer gives them, so that shaders written
for its Fragments run on what tilegrad draws. tilegrad.compat.pytorch3d has the same for torch.

PyTorch3D's NDC: x to the left, y up, [-1, 1] on the shorter side of the image; row 0 is on top.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Optional, Sequence, Union

import numpy as np

from tilegrad import _arrays, _core
from tilegrad._arrays import thread_count
from tilegrad._camera import Camera
from tilegrad._camera_arguments import checked_size, common_size, filled_size
from tilegrad._renderer import Frame
from tilegrad._scene import Scene


class Fragments(NamedTuple):
    """N images of H x W pixels with K layers, nearest first; -1 in all arrays after the last face
    of a pixel.

    pix_to_face: (N, H, W, K) int64, index of the face among the faces of all images, one image
        after the other.
    zbuf: (N, H, W, K), depth in the camera, world units.
    bary_coords: (N, H, W, K, 3), weights of the face's corners.
    dists: (N, H, W, K), squared distance to the face's boundary, NDC; negative inside.
    """

    pix_to_face: Any
    zbuf: Any
    bary_coords: Any
    dists: Any


def to_fragments(source: Union[Frame, Scene, Sequence[Scene]], faces_per_pixel: int = 1, *,
                 width: Optional[int] = None, height: Optional[int] = None,
                 blur_radius: float = 0.0, perspective_correct: bool = True,
                 clip_barycentric_coords: Optional[bool] = None, cull_backfaces: bool = False,
                 threads: int = 0) -> Fragments:
    """The faces_per_pixel nearest faces of every pixel of a frame, or of scenes.

    source: a Frame, with its scenes and size; or a Scene or a list of them, with width and height
        in pixels, or with cameras that have them (`Camera.size`).
    faces_per_pixel: K, 1..1024.
    blur_radius: NDC^2, >= 0: a pixel also lists faces whose boundary is nearer than its square
        root.
    perspective_correct: whether barycentrics are linear on the face or on the screen.
    clip_barycentric_coords: whether to move those outside of a face to its boundary; None: if
        blur_radius > 0, as in PyTorch3D.
    cull_backfaces: whether to drop faces seen from behind.
    threads: as in Renderer.

    Faces that reach behind the camera are dropped, not clipped. Errors: TypeError, ValueError.
    """
    scenes, width, height = _scenes_of(source, width, height)
    options = layered_options("to_fragments", height, width, faces_per_pixel, blur_radius,
                              perspective_correct, clip_barycentric_coords, cull_backfaces)
    images = [image for scene in scenes for image in _face_vertices(scene, width, height)]
    if not images:
        raise ValueError("to_fragments: source has scenes of no image")
    counts = [len(image) for image in images]
    firsts = np.cumsum([0, *counts[:-1]]).tolist()
    return Fragments(*_core.rasterize_layers(np.concatenate(images), list(zip(firsts, counts)),
                                             options, thread_count("to_fragments", threads)))


def layered_options(function: str, height: int, width: int, faces_per_pixel: int,
                    blur_radius: float, perspective_correct: bool,
                    clip_barycentric_coords: Optional[bool],
                    cull_backfaces: bool) -> _core.LayeredOptions:
    """The options, checked as far as numbers go."""
    blur_radius = _arrays.as_number(function, "blur_radius", blur_radius, float)
    clip = blur_radius > 0 if clip_barycentric_coords is None else clip_barycentric_coords
    size = {name: _arrays.as_pixels(function, name, value)
            for name, value in (("height", height), ("width", width))}
    layers = _arrays.as_number(function, "faces_per_pixel", faces_per_pixel, int)
    if not 1 <= layers <= 1024:
        raise ValueError(f"{function}: faces_per_pixel is {layers}, expected 1..1024")
    return _core.LayeredOptions(
        **size, faces_per_pixel=layers, blur_radius=blur_radius,
        perspective_correct=_arrays.as_flag(function, "perspective_correct", perspective_correct),
        clip_barycentrics=_arrays.as_flag(function, "clip_barycentric_coords", clip),
        cull_backfaces=_arrays.as_flag(function, "cull_backfaces", cull_backfaces))


def _scenes_of(source: Any, width: Optional[int],
               height: Optional[int]) -> tuple[Sequence[Scene], int, int]:
    if isinstance(source, Frame):
        if width is not None or height is not None:
            raise ValueError("to_fragments: a Frame has its own width and height")
        return source.scenes, source.face_ids.shape[2], source.face_ids.shape[1]
    scenes = [source] if isinstance(source, Scene) else source
    if not isinstance(scenes, (list, tuple)) or not all(isinstance(s, Scene) for s in scenes):
        raise TypeError(f"to_fragments: source must be a Frame, a Scene or a list of scenes, got "
                        f"{type(source).__name__}")
    if not scenes:
        raise ValueError("to_fragments: source has no scene")
    sizes = [scene.camera.size for scene in scenes]
    width, height = filled_size(width, height, common_size("to_fragments", sizes) or (None, None))
    if width is None or height is None:
        raise ValueError("to_fragments: scenes need width and height")
    for own in sizes:
        checked_size("to_fragments", own, (width, height))
    return scenes, width, height


def _face_vertices(scene: Scene, width: int, height: int) -> np.ndarray:
    """(N, F, 3, 3) corners of a scene's faces in its images: x, y in PyTorch3D's NDC, and depth."""
    _arrays.check_indices("to_fragments", "faces", scene.faces, scene.positions.shape[-2])
    camera = Camera.of_numbers(np.asarray(scene.camera.numbers, np.float64))
    numbers = camera.numbers.reshape(-1, 1, camera.numbers.shape[-1])
    each = Camera.of_numbers(numbers)  # (N or 1, 1): broadcasts over vertices
    positions = np.asarray(scene.positions, np.float64)
    seen = positions @ each.rotation[:, 0].swapaxes(-1, -2) + each.translation
    depth = -seen[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        x = each.cx + each.fx * seen[..., 0] / depth
        y = each.cy - each.fy * seen[..., 1] / depth
    per_pixel = 2 / min(width, height)
    ndc = np.stack([(width / 2 - x) * per_pixel, (height / 2 - y) * per_pixel, depth], axis=-1)
    ndc[depth <= 0] = 0  # dropped in any case
    corners = np.broadcast_to(ndc, (len(scene), *ndc.shape[1:]))[:, scene.faces]
    return corners.astype(scene.dtype)
