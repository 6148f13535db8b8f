# SPDX-License-Identifier: Apache-2.0
"""Cameras, and those of other programs."""

from __future__ import annotations

import math
import os
from typing import Any, Optional, Sequence

import numpy as np

from tilegrad import _arrays, _core
from tilegrad._arrays import name_of
from tilegrad._camera_arguments import checked_size, is_half, known_size, Rows, Size, size_of
from tilegrad._packed import Packed, Part

_D = _core.CAMERA
Parts = dict[str, np.ndarray]
# The numbers of a camera of other programs, in the order of _core.camera_from and camera_to.
_CONVENTIONS: dict[str, dict[str, tuple[int, ...]]] = {
    "opencv": {"k": (3, 3), "rotation": (3, 3), "translation": (3,)},
    "colmap": {"quaternion": (4,), "translation": (3,), "fx": (), "fy": (), "cx": (), "cy": ()},
    "opengl": {"projection": (4, 4), "model_view": (4, 4)},
    "kaolin": {"rotation": (3, 3), "position": (3,), "projection": (3,)},
    "pytorch3d": {"r": (3, 3), "t": (3,), "focal_length": (2,), "principal_point": (2,)},
    "nerf": {"camera_to_world": (4, 4), "fl_x": (), "fl_y": (), "cx": (), "cy": ()},
}


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
    fx, fy, cx, cy: numbers or (N,), pixels: focal lengths, not 0, and principal point.
    near_plane: number or (N,), > 0, world units; nearer geometry is clipped.
    size: (width, height) of the images that fx, fy, cx, cy are for, pixels; None: unknown. Set by
        constructors that take width and height, and by readers of files. If known, rendering at
        another size is an error; `resize` converts the camera to that size.

    Numbers are kept in float64 and rounded to the dtype of the scene. Errors: TypeError, ValueError
    for what is not an array of these shapes; render refuses numbers that are not finite, focal
    lengths of 0, and near planes that are not above 0.

    `rotation` is not checked; any matrix is applied as is. A reflection (determinant -1, or one
    negative focal length) shows the mirror image and swaps front and back faces; with scale or
    shear, specular light uses -rotation.T @ translation as the eye's position, which is then wrong.
    Camera.from_... and files.save_cameras refuse such matrices.
    """

    __slots__ = ("size",)
    _SIZE = len(_D)

    rotation = Part(0, (3, 3), "(..., 3, 3) world to camera.")
    translation = Part(9, (3,), "(..., 3) world units.")
    fx = Part(12, (), "(...) focal length, pixels.")
    fy = Part(13, (), "(...) focal length, pixels.")
    cx = Part(14, (), "(...) principal point, pixels from the left edge.")
    cy = Part(15, (), "(...) principal point, pixels from the top edge.")
    near_plane = Part(16, (), "(...) world units.")

    def __init__(self, rotation=np.reshape(_D[:9], (3, 3)).tolist(), translation=_D[9:12],
                 fx=_D[12], fy=_D[13], cx=_D[14], cy=_D[15], near_plane=_D[16],
                 size: Optional[Size] = None) -> None:
        self._pack(rotation=rotation, translation=translation, fx=fx, fy=fy, cx=cx, cy=cy,
                   near_plane=near_plane)
        self.size = known_size("Camera", size)

    @classmethod
    def of_numbers(cls, numbers: np.ndarray, size: Optional[Size] = None) -> "Camera":
        """From an array (..., 17), without a copy."""
        camera = super().of_numbers(numbers)
        camera.size = size
        return camera

    def __getitem__(self, index: Any) -> "Camera":
        camera = super().__getitem__(index)
        camera.size = self.size
        return camera

    @classmethod
    def _names(cls) -> list[str]:
        return [*super()._names(), "size"]

    # Constructors. Each argument may have a leading axis N, for N cameras.

    @classmethod
    def look_at(cls, eye, target=(0, 0, 0), up=(0, 1, 0), *, fov_y: float = _core.FOV_Y,
                width: int, height: int) -> "Camera":
        """At `eye`, looking at `target`, with `up` upwards; world units, (3,) or (N, 3). Where `up`
        is parallel to the view, another axis of the world replaces it.

        fov_y: degrees, the full vertical field of view, (0, 180). Pixels are square, the principal
            point is the middle of an image of width x height pixels.
        """
        rows = Rows("Camera.look_at", eye=(eye, (3,)), target=(target, (3,)), up=(up, (3,)))
        size = size_of("Camera.look_at", width, height)
        fov_y = _arrays.as_number("Camera.look_at", "fov_y", fov_y, float)
        numbers = _core.camera_look_at(fov_y, size, *rows.arrays)
        return cls.of_numbers(rows.shaped(numbers), size)

    @classmethod
    def orbit(cls, azimuth, elevation, distance, *, fov_y: float = _core.FOV_Y, width: int,
              height: int) -> "Camera":
        """At distance * (cos el cos az, sin el, cos el sin az), looking at the origin, y up.

        azimuth, elevation: degrees; distance: world units, > 0; numbers or (N,). The rest as in
        look_at.
        """
        function = "Camera.orbit"
        rows = Rows(function, azimuth=(azimuth, ()), elevation=(elevation, ()),
                     distance=(distance, ()))
        size = size_of(function, width, height)
        fov_y = _arrays.as_number(function, "fov_y", fov_y, float)
        numbers = _core.camera_orbit(fov_y, size, np.hstack(rows.arrays))
        return cls.of_numbers(rows.shaped(numbers), size)

    @classmethod
    def framing(cls, mesh: Any, *, azimuth=60, elevation=20, fov_y: float = _core.FOV_Y,
                margin: float = 0.05, width: int = 512, height: int = 512) -> "Camera":
        """From the given direction, at the smallest distance that shows the whole mesh.

        mesh: what `tilegrad.meshes.as_mesh` takes, or points (V, 3). azimuth, elevation: degrees;
            numbers or (N,); azimuth 90 looks at the +z side.
        margin: margin on each side, as a fraction of the image, [0, 0.5).
        """
        function = "Camera.framing"
        margin = _arrays.as_number(function, "margin", margin, float)
        if not 0 <= margin < 0.5:
            raise ValueError(f"{function}: margin is {margin}, must be in [0, 0.5)")
        return _framed(points_of(function, mesh), azimuth, elevation,
                       _arrays.as_number(function, "fov_y", fov_y, float), margin,
                       size_of(function, width, height))

    @classmethod
    def from_opencv(cls, k, rotation, translation, *, pixel_centre: str = "integer",
                    size: Optional[Size] = None) -> "Camera":
        """OpenCV's: x right, y down, z forward.

        k: (3, 3) or (N, 3, 3) intrinsic matrix, pixels, without skew.
        rotation, translation: (3, 3), (3,) or with N, world to camera.
        pixel_centre: "integer": the centre of the first pixel is (0, 0), as OpenCV calibrates;
            "half": it is (0.5, 0.5), for matrices whose principal point is just width / 2.
        size: as in Camera.
        """
        function = "Camera.from_opencv"
        return _converted("opencv", (k, rotation, translation), known_size(function, size),
                          half=is_half(function, pixel_centre))

    @classmethod
    def from_colmap(cls, quaternion, translation, fx, fy, cx, cy, *,
                    size: Optional[Size] = None) -> "Camera":
        """COLMAP's PINHOLE model, and a line of images.txt.

        quaternion: (4,) or (N, 4): w, x, y, z, world to camera, of any length > 0.
        translation: (3,) or (N, 3). fx, fy, cx, cy: pixels, numbers or (N,). size: as in Camera.
        """
        return _converted("colmap", (quaternion, translation, fx, fy, cx, cy),
                          known_size("Camera.from_colmap", size))

    @classmethod
    def from_opengl(cls, projection, model_view, *, width: int, height: int) -> "Camera":
        """OpenGL's perspective camera: clip = projection @ model_view @ world.

        projection, model_view: (4, 4) or (N, 4, 4), for column vectors; what glGetFloatv fills is
        the transpose. width, height: pixels of the image.
        """
        return _converted("opengl", (projection, model_view),
                          size_of("Camera.from_opengl", width, height))

    @classmethod
    def from_kaolin(cls, rotation, position, projection, *, width: int, height: int) -> "Camera":
        """Kaolin's and DIB-R's.

        rotation: (3, 3) or (N, 3, 3); position: (3,) or (N, 3), of the camera;
        projection: (3,) or (N, 3), camera_proj, its last number -1. width, height: pixels.
        """
        return _converted("kaolin", (rotation, position, projection),
                          size_of("Camera.from_kaolin", width, height))

    @classmethod
    def from_pytorch3d(cls, r, t, focal_length, principal_point=(0, 0), *, width: int,
                       height: int) -> "Camera":
        """PyTorch3D's PerspectiveCameras(in_ndc=True).

        r: (3, 3) or (N, 3, 3), for row vectors; t: (3,) or (N, 3);
        focal_length, principal_point: (2,) or (N, 2), NDC. width, height: pixels of the image.
        """
        return _converted("pytorch3d", (r, t, focal_length, principal_point),
                          size_of("Camera.from_pytorch3d", width, height))

    @classmethod
    def from_nerf(cls, camera_to_world, fl_x, fl_y, cx, cy, *,
                  size: Optional[Size] = None) -> "Camera":
        """A frame of NeRF's transforms.json.

        camera_to_world: (4, 4) or (N, 4, 4), transform_matrix. fl_x, fl_y, cx, cy: pixels.
        size: as in Camera.
        """
        return _converted("nerf", (camera_to_world, fl_x, fl_y, cx, cy),
                          known_size("Camera.from_nerf", size))

    # And back: dictionaries of the arguments of the constructors above.

    def to_opencv(self, *, pixel_centre: str = "integer") -> Parts:
        """k, rotation, translation, as from_opencv takes them."""
        return self._parts("opencv", half=is_half("Camera.to_opencv", pixel_centre))

    def to_colmap(self) -> Parts:
        """quaternion, translation, fx, fy, cx, cy, as from_colmap takes them."""
        return self._parts("colmap")

    def to_opengl(self, *, width: int, height: int, far_plane: float) -> Parts:
        """projection, model_view, as from_opengl takes them. far_plane: world units, beyond
        near_plane; tilegrad itself has none."""
        size = self._sized("Camera.to_opengl", width, height)
        far_plane = _arrays.as_number("Camera.to_opengl", "far_plane", far_plane, float)
        return self._parts("opengl", size, far_plane=far_plane)

    def to_kaolin(self, *, width: int, height: int) -> Parts:
        """rotation, position, projection, as from_kaolin takes them. ValueError if the principal
        point is not the middle of the image."""
        return self._parts("kaolin", self._sized("Camera.to_kaolin", width, height))

    def to_pytorch3d(self, *, width: int, height: int) -> Parts:
        """r, t, focal_length, principal_point, as from_pytorch3d takes them."""
        return self._parts("pytorch3d", self._sized("Camera.to_pytorch3d", width, height))

    def to_nerf(self) -> Parts:
        """camera_to_world, fl_x, fl_y, cx, cy, as from_nerf takes them."""
        return self._parts("nerf")

    def resize(self, width: int, height: int, to_width: int, to_height: int) -> "Camera":
        """Scales the camera of an image of width x height pixels to one of to_width x to_height."""
        size = size_of("Camera.resize", to_width, to_height)
        if min(size) < 1:
            raise ValueError(f"Camera.resize: to_width is {to_width}, to_height {to_height}; both "
                             f"must be above 0")
        numbers = _core.camera_resize(self._rows(), self._sized("Camera.resize", width, height),
                                      size)
        return Camera.of_numbers(numbers.reshape(self.numbers.shape), size)

    def _sized(self, function: str, width: int, height: int) -> Size:
        return checked_size(function, self.size, size_of(function, width, height))

    def _rows(self) -> np.ndarray:
        return np.ascontiguousarray(self.numbers, np.float64).reshape(-1, self._SIZE)

    def _parts(self, convention: str, *size: Size, **extra: Any) -> Parts:
        rows = _core.camera_to(convention, self._rows(), *size, **extra)
        lead, first, parts = self.numbers.shape[:-1], 0, {}
        for name, shape in _CONVENTIONS[convention].items():
            end = first + math.prod(shape)
            parts[name] = rows[:, first:end].reshape(lead + shape)
            first = end
        return parts


def _converted(convention: str, values: Sequence[Any], size: Optional[Size], **extra: Any) -> Camera:
    """A camera from another program's numbers."""
    shapes = _CONVENTIONS[convention]
    rows = Rows(f"Camera.from_{convention}",
                **{name: (value, shapes[name]) for name, value in zip(shapes, values)})
    if size is not None:
        extra["size"] = size
    return Camera.of_numbers(
        rows.shaped(_core.camera_from(convention, np.hstack(rows.arrays), **extra)), size)


def _framed(points: np.ndarray, azimuth: Any, elevation: Any, fov_y: float, margin: float,
            size: Size) -> Camera:
    """The nearest camera from that direction that has all points in the picture."""
    width, height = size
    low, high = points.min(axis=0), points.max(axis=0)
    centre = (low + high) / 2
    camera = Camera.orbit(azimuth, elevation, 1, fov_y=fov_y, width=width, height=height)
    rotation = camera.rotation
    seen = (points - centre) @ np.swapaxes(rotation, -1, -2)  # ([N,] V, 3), from the centre
    free = 1 - 2 * margin
    slopes = free * np.array(size) / 2 / np.stack([camera.fx, camera.fy], axis=-1)
    needed = seen[..., 2:] + np.abs(seen[..., :2]) / slopes[..., None, :]
    extent = float(np.linalg.norm(high - low))
    distance = needed.max(axis=(-1, -2)) + (1e-3 * extent or 1e-12)  # a point has no extent
    back = rotation[..., 2, :]  # the camera's z in the world
    camera = Camera.look_at(centre + distance[..., None] * back,
                            np.broadcast_to(centre, back.shape), fov_y=fov_y, width=width,
                            height=height)
    camera.near_plane[...] = np.minimum(camera.near_plane, 5e-4 * extent or 1e-12)
    return camera


def points_of(function: str, mesh: Any) -> np.ndarray:
    """The vertices that faces use, of anything `tilegrad.meshes.as_mesh` takes, or points (V, 3) as
    they are; float64. ValueError: there are none, or one is not finite."""
    points, faces = _parts(mesh)
    points = _arrays.as_array(function, "mesh", points, np.float64, ("V", 3))
    if faces is not None:
        faces = _arrays.as_indices(function, "faces", faces, ("F", 3))
        _arrays.check_indices(function, "faces", faces, len(points))
        points = points[np.unique(faces)]
    if not len(points):
        raise ValueError(f"{function}: mesh has no faces")
    if not np.isfinite(points).all():
        raise ValueError(f"{function}: mesh has positions that are not finite")
    return points


def _parts(mesh: Any) -> tuple[Any, Any]:
    """Vertices, and faces or None."""
    if isinstance(mesh, (str, bytes, os.PathLike)):
        from tilegrad import _tools
        arrays = _tools.load_mesh(name_of(mesh), 0)
        return arrays["positions"], arrays["faces"]
    if isinstance(mesh, (tuple, list)) and len(mesh) == 2:
        return mesh[0], mesh[1]
    if hasattr(mesh, "positions"):  # a tilegrad.meshes.Mesh
        return mesh.positions, mesh.faces
    if hasattr(mesh, "vertices"):
        faces = mesh.faces if hasattr(mesh, "faces") else getattr(mesh, "triangles", None)
        return np.asarray(mesh.vertices), np.asarray(faces)
    return mesh, None
