# SPDX-License-Identifier: Apache-2.0
"""kaolin.render.camera: pinhole cameras, and the functions of its DIB-R examples. Cameras look
along -z, x right, y up."""

from __future__ import annotations

import enum
import inspect
import math
from typing import Any, Callable, Optional, Sequence, Union

import torch

from tilegrad._dense import full_precision
from tilegrad.compat._tensors import check_floats, check_up
from tilegrad.compat.kaolin._missing import missing_from

__getattr__ = missing_from(__name__)
__all__ = ["Camera", "CameraExtrinsics", "CameraFOV", "PinholeIntrinsics",
           "generate_centered_pixel_coords", "generate_perspective_projection",
           "generate_pinhole_rays", "generate_rotate_translate_matrices",
           "generate_transformation_matrix", "perspective_camera", "rotate_translate_points"]

_EPS = 1e-10  # Kaolin's, added to lengths


@full_precision
def rotate_translate_points(points: torch.Tensor, camera_rot: torch.Tensor,
                            camera_trans: torch.Tensor) -> torch.Tensor:
    """R (p - t). points: [B,N,3]. camera_rot: [B,3,3], rows are the camera's axes.
    camera_trans: [B,3] (or [B,3,1]), where the camera is. Returns [B,N,3]."""
    return (points - camera_trans.reshape(-1, 1, 3)) @ camera_rot.transpose(1, 2)


@full_precision
def perspective_camera(points: torch.Tensor, camera_proj: torch.Tensor) -> torch.Tensor:
    """(f_x x, f_y y) / (-z), the image in [-1, 1]. points: [B,N,3] in the camera. camera_proj:
    [3,1] or [B,3,1]. Returns [B,N,2]."""
    scaled = points * camera_proj.reshape(-1, 1, 3)
    return scaled[..., :2] / scaled[..., 2:]


def generate_perspective_projection(fovyangle: float, ratio: float = 1.0,
                                    dtype: torch.dtype = torch.float) -> torch.Tensor:
    """[3,1] (1 / (ratio tan(fovy/2)), 1 / tan(fovy/2), -1). fovyangle: full vertical field of view,
    radians. ratio: width / height."""
    tangent = math.tan(fovyangle / 2)
    return torch.tensor([[1 / (ratio * tangent)], [1 / tangent], [-1]], dtype=dtype)


@full_precision
def generate_rotate_translate_matrices(camera_position: torch.Tensor, look_at: torch.Tensor,
                                       camera_up_direction: torch.Tensor
                                       ) -> tuple[torch.Tensor, torch.Tensor]:
    """camera_rot [B,3,3] and camera_trans [B,3] of cameras at camera_position [B,3] that look at
    look_at [B,3], camera_up_direction [B,3] (or [1,3]) up. ValueError: an up along the view."""
    axes = _axes("generate_rotate_translate_matrices", camera_position - look_at,
                 camera_up_direction)
    return torch.stack(axes, dim=1), camera_position


@full_precision
def generate_transformation_matrix(camera_position: torch.Tensor, look_at: torch.Tensor,
                                   camera_up_direction: torch.Tensor) -> torch.Tensor:
    """camera_transform [B,4,3] of the same cameras: (p, 1) times it is p in the camera."""
    rotation = torch.stack(_axes("generate_transformation_matrix", camera_position - look_at,
                                 camera_up_direction), dim=2)
    return torch.cat([rotation, -camera_position.unsqueeze(1) @ rotation], dim=1)


def _axes(function: str, backward: torch.Tensor, up: torch.Tensor) -> list[torch.Tensor]:
    """The camera's x, y, z in the world, [B,3] each."""
    z = _unit(backward)
    up, z = torch.broadcast_tensors(up, z)
    check_up(function, up, z)
    x = _unit(torch.cross(up, z, dim=1))
    return [x, _unit(torch.cross(z, x, dim=1)), z]


def _unit(vectors: torch.Tensor) -> torch.Tensor:
    return vectors / (vectors.norm(dim=1, keepdim=True) + _EPS)


_Values = Union[torch.Tensor, Sequence[float], Any]  # or an array of NumPy
_Device = Union[torch.device, str, None]
_Amount = Union[float, torch.Tensor]


class CameraFOV(enum.IntEnum):
    """Which side of the image a field of view is of."""

    HORIZONTAL = 0
    VERTICAL = 1


class CameraExtrinsics:
    """Where cameras are, a view matrix [C,4,4]: world to camera. Methods that move a camera change
    it in place."""

    def __init__(self, view: torch.Tensor) -> None:
        check_floats("CameraExtrinsics", "view_matrix", view, ("C", 4, 4))
        self._view = view

    @classmethod
    def from_view_matrix(cls, view_matrix: _Values, dtype: torch.dtype = torch.float32,
                         device: _Device = None) -> CameraExtrinsics:
        """view_matrix: [4,4] or [C,4,4]."""
        view = torch.as_tensor(view_matrix, dtype=dtype, device=device)
        return cls(view[None] if view.ndim == 2 else view)

    @classmethod
    def from_camera_pose(cls, cam_pos: _Values, cam_dir: _Values,
                         dtype: torch.dtype = torch.float32,
                         device: _Device = None) -> CameraExtrinsics:
        """cam_pos: [3], [C,3] or [C,3,1]. cam_dir: [3,3] or [C,3,3], whose columns are the camera's
        right, up and backward in the world."""
        axes = torch.as_tensor(cam_dir, dtype=dtype, device=device).reshape(-1, 3, 3)
        position = torch.as_tensor(cam_pos, dtype=dtype, device=device).reshape(-1, 3)
        return cls(_view_matrix(axes.transpose(1, 2), position))

    @classmethod
    def from_lookat(cls, eye: _Values, at: _Values, up: _Values,
                    dtype: torch.dtype = torch.float32,
                    device: _Device = None) -> CameraExtrinsics:
        """eye, at, up: [3] or [C,3]: camera position, target, up direction.
        ValueError: an up along the view."""
        eye, at, up = torch.broadcast_tensors(*(
            torch.as_tensor(v, dtype=dtype, device=device).reshape(-1, 3) for v in (eye, at, up)))
        normalize = torch.nn.functional.normalize
        backward = normalize(eye - at, dim=-1)
        check_up("from_lookat", up, backward)
        right = normalize(torch.cross(up, backward, dim=-1), dim=-1)
        rotation = torch.stack([right, torch.cross(backward, right, dim=-1), backward], dim=1)
        return cls(_view_matrix(rotation, eye))

    def view_matrix(self) -> torch.Tensor:
        """[C,4,4], world to camera."""
        return self._view

    @full_precision
    def inv_view_matrix(self) -> torch.Tensor:
        """[C,4,4], camera to world."""
        rotation = self.R.transpose(1, 2)
        return _rows(rotation, -rotation @ self.t)

    @property
    def R(self) -> torch.Tensor:  # pylint: disable=invalid-name
        """[C,3,3], whose rows are the camera's right, up and backward."""
        return self._view[:, :3, :3]

    @property
    def t(self) -> torch.Tensor:
        """[C,3,1], the world's origin in the camera."""
        return self._view[:, :3, 3:]

    @property
    def device(self) -> torch.device:
        """Of the view matrix."""
        return self._view.device

    @property
    def dtype(self) -> torch.dtype:
        """Of the view matrix."""
        return self._view.dtype

    @full_precision
    def transform(self, vectors: torch.Tensor) -> torch.Tensor:
        """Points [V,3] or [C,V,3] from the world into cameras [C,V,3]."""
        check_floats("transform", "vectors", vectors, (*vectors.shape[:-1], 3), like=self._view)
        return vectors @ self.R.transpose(1, 2) + self.t.transpose(1, 2)

    @full_precision
    def inv_transform_rays(self, ray_orig: torch.Tensor,
                           ray_dir: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Rays [V,3] or [C,V,3] from cameras into the world [C,V,3]."""
        return (ray_orig - self.t.transpose(1, 2)) @ self.R, ray_dir @ self.R

    @full_precision
    def cam_pos(self) -> torch.Tensor:
        """[C,3,1], in the world."""
        return -self.R.transpose(1, 2) @ self.t

    def cam_right(self) -> torch.Tensor:
        """[C,3,1], the camera's x axis in the world."""
        return self.R[:, 0, :, None]

    def cam_up(self) -> torch.Tensor:
        """[C,3,1], the camera's y axis in the world."""
        return self.R[:, 1, :, None]

    def cam_forward(self) -> torch.Tensor:
        """[C,3,1], the camera's z axis in the world, away from what it sees."""
        return self.R[:, 2, :, None]

    @full_precision
    def translate(self, t: torch.Tensor) -> None:
        """Moves cameras by t [3], [C,3] or [C,3,1], in the world."""
        self._move(self.R @ t.reshape(-1, 3, 1))

    def move_right(self, amount: _Amount) -> None:
        """Along cam_right, by a number or [C]."""
        self._move_along(0, amount)

    def move_up(self, amount: _Amount) -> None:
        """Along cam_up."""
        self._move_along(1, amount)

    def move_forward(self, amount: _Amount) -> None:
        """Along cam_forward: backwards, if amount > 0."""
        self._move_along(2, amount)

    @full_precision
    def rotate(self, yaw: Optional[_Amount] = None, pitch: Optional[_Amount] = None,
               roll: Optional[_Amount] = None) -> None:
        """Turns cameras about their own y, then x, then z; radians, numbers or [C]."""
        for angle, (i, j) in ((yaw, (2, 0)), (pitch, (1, 2)), (roll, (0, 1))):
            if angle is None:
                continue
            angle = torch.as_tensor(angle, dtype=self.dtype).reshape(-1)
            turn = torch.eye(4, dtype=self.dtype).repeat(len(angle), 1, 1)
            turn[:, i, i] = turn[:, j, j] = torch.cos(angle)
            turn[:, i, j], turn[:, j, i] = torch.sin(angle), -torch.sin(angle)
            self._view = turn @ self._view

    def _move(self, in_camera: torch.Tensor) -> None:
        self._view = _rows(self.R, self.t - in_camera)

    def _move_along(self, axis: int, amount: _Amount) -> None:
        unit = torch.eye(3, dtype=self.dtype)[axis]
        self._move((torch.as_tensor(amount, dtype=self.dtype).reshape(-1, 1) * unit)[..., None])

    def __len__(self) -> int:
        return len(self._view)


class PinholeIntrinsics:
    """What cameras see: width, height, near and far, and params [C,4]: x0, y0, the principal
    point's offset from the centre of the image, and focal_x, focal_y, in pixels."""

    lens_type = "pinhole"

    def __init__(self, width: int, height: int, params: torch.Tensor, near: float = 1e-2,
                 far: float = 1e2) -> None:
        if not (width > 0 and height > 0 and 0 < near < far):
            raise ValueError(f"PinholeIntrinsics: width {width}, height {height}, near {near}, far "
                             f"{far}; expected numbers > 0, near before far")
        self.width, self.height, self.near, self.far = width, height, near, far
        self.params = params

    @classmethod
    def from_focal(cls, width: int, height: int, focal_x: _Amount,
                   focal_y: Optional[_Amount] = None, x0: _Amount = 0., y0: _Amount = 0.,
                   near: float = 1e-2, far: float = 1e2, num_cameras: int = 1,
                   device: _Device = None,
                   dtype: torch.dtype = torch.float32) -> PinholeIntrinsics:
        """focal_x, focal_y (None: as focal_x), x0, y0: pixels, numbers or [C]."""
        columns = [torch.as_tensor(v, dtype=dtype, device=device).reshape(-1).expand(num_cameras)
                   for v in (x0, y0, focal_x, focal_x if focal_y is None else focal_y)]
        return cls(width, height, torch.stack(columns, dim=1), near, far)

    @classmethod
    def from_fov(cls, width: int, height: int, fov: _Amount,
                 fov_direction: CameraFOV = CameraFOV.VERTICAL, **others: Any) -> PinholeIntrinsics:
        """fov: radians, the full angle of fov_direction. others: as in from_focal, from x0 on."""
        side = width if fov_direction == CameraFOV.HORIZONTAL else height
        tangent = torch.tan(fov / 2) if isinstance(fov, torch.Tensor) else math.tan(fov / 2)
        return cls.from_focal(width, height, side / 2 / tangent, **others)

    @property
    def x0(self) -> torch.Tensor:
        """[C], pixels, the principal point from the centre of the image."""
        return self.params[:, 0]

    @property
    def y0(self) -> torch.Tensor:
        """[C], as x0."""
        return self.params[:, 1]

    @property
    def focal_x(self) -> torch.Tensor:
        """[C], pixels."""
        return self.params[:, 2]

    @property
    def focal_y(self) -> torch.Tensor:
        """[C], pixels."""
        return self.params[:, 3]

    @property
    def cx(self) -> torch.Tensor:
        """[C], pixels, the principal point from the border of the image."""
        return self.width / 2 + self.x0

    @property
    def cy(self) -> torch.Tensor:
        """[C], as cx."""
        return self.height / 2 + self.y0

    @property
    def fov_x(self) -> torch.Tensor:
        """[C], degrees."""
        return self.fov(CameraFOV.HORIZONTAL)

    @property
    def fov_y(self) -> torch.Tensor:
        """[C], degrees."""
        return self.fov()

    def tan_half_fov(self, camera_fov_direction: CameraFOV = CameraFOV.VERTICAL) -> torch.Tensor:
        """[C]."""
        if camera_fov_direction == CameraFOV.HORIZONTAL:
            return self.width / 2 / self.focal_x
        return self.height / 2 / self.focal_y

    def fov(self, camera_fov_direction: CameraFOV = CameraFOV.VERTICAL,
            in_degrees: bool = True) -> torch.Tensor:
        """[C], the whole angle."""
        angle = 2 * torch.atan(self.tan_half_fov(camera_fov_direction))
        return torch.rad2deg(angle) if in_degrees else angle

    def projection_matrix(self) -> torch.Tensor:
        """[C,4,4], camera to clip coordinates, of which w is -z."""
        zero, one = torch.zeros_like(self.x0), torch.ones_like(self.x0)
        depth = self.far - self.near
        rows = [[2 / self.width * self.focal_x, zero, -2 / self.width * self.x0, zero],
                [zero, 2 / self.height * self.focal_y, -2 / self.height * self.y0, zero],
                [zero, zero, -(self.far + self.near) / depth * one,
                 -2 * self.far * self.near / depth * one],
                [zero, zero, -one, zero]]
        return torch.stack([torch.stack(row, dim=-1) for row in rows], dim=1)

    @full_precision
    def project(self, vectors: torch.Tensor) -> torch.Tensor:
        """Points [V,3] or [C,V,3] in cameras to clip coordinates [C,V,4]."""
        homogeneous = torch.nn.functional.pad(vectors, (0, 1), value=1.)
        return homogeneous @ self.projection_matrix().transpose(1, 2)

    def transform(self, vectors: torch.Tensor) -> torch.Tensor:
        """The same to NDC [C,V,3]."""
        clip = self.project(vectors)
        return clip[..., :3] / clip[..., 3:]

    def __len__(self) -> int:
        return len(self.params)


@full_precision
def _view_matrix(rotation: torch.Tensor, position: torch.Tensor) -> torch.Tensor:
    """[C,4,4] of R and of where the camera is."""
    return _rows(rotation, -rotation @ position.unsqueeze(-1))


def _rows(rotation: torch.Tensor, translation: torch.Tensor) -> torch.Tensor:
    """[C,4,4] of [C,3,3] and [C,3,1]."""
    top = torch.cat([rotation.expand(len(translation), 3, 3), translation], dim=2)
    last = top.new_tensor([0., 0, 0, 1]).expand(len(top), 1, 4)
    return torch.cat([top, last], dim=1)


Rays = tuple[torch.Tensor, torch.Tensor]

# By the argument that names it.
_EXTRINSICS = {"eye": CameraExtrinsics.from_lookat, "cam_pos": CameraExtrinsics.from_camera_pose,
               "view_matrix": CameraExtrinsics.from_view_matrix}
_INTRINSICS = {"fov": PinholeIntrinsics.from_fov, "focal_x": PinholeIntrinsics.from_focal}


class Camera:
    """C pinhole cameras; what extrinsics and intrinsics have, the camera has, too."""

    __slots__ = ("extrinsics", "intrinsics")

    def __init__(self, extrinsics: CameraExtrinsics, intrinsics: PinholeIntrinsics) -> None:
        if len(extrinsics) != len(intrinsics):
            raise ValueError(f"Camera: extrinsics of {len(extrinsics)} cameras, intrinsics of "
                             f"{len(intrinsics)}")
        self.extrinsics, self.intrinsics = extrinsics, intrinsics

    @classmethod
    def from_args(cls, **kwargs: Any) -> Camera:
        """From eye, at, up, or cam_pos, cam_dir, or view_matrix; and fov (radians) or focal_x
        (pixels), with width and height; and what else those constructors take. dtype: of the
        camera, float32 unless told.

        ValueError, TypeError: arguments that belong to none or to several of these.
        """
        place = _only(_EXTRINSICS, kwargs, "one of eye, cam_pos, view_matrix")
        lens = _only(_INTRINSICS, kwargs, "one of fov, focal_x (a pinhole camera's)")
        of_place = {k: v for k, v in kwargs.items() if k in inspect.signature(place).parameters}
        extrinsics = place(**of_place)
        rest = {k: v for k, v in kwargs.items() if k not in of_place}
        return cls(extrinsics, lens(**{"num_cameras": len(extrinsics), **rest},
                                    dtype=extrinsics.dtype, device=extrinsics.device))

    def transform(self, vectors: torch.Tensor) -> torch.Tensor:
        """Points [V,3] or [C,V,3] from the world to NDC [C,V,3], of the shape of `vectors` if C is
        1."""
        ndc = self.intrinsics.transform(self.extrinsics.transform(vectors))
        return ndc.reshape(vectors.shape) if len(self) == 1 else ndc

    @full_precision
    def view_projection_matrix(self) -> torch.Tensor:
        """[C,4,4], world to clip coordinates."""
        return self.intrinsics.projection_matrix() @ self.extrinsics.view_matrix()

    def generate_rays(self, coords_grid: Optional[Sequence[torch.Tensor]] = None) -> Rays:
        """As generate_pinhole_rays."""
        return generate_pinhole_rays(self, coords_grid)

    @classmethod
    def cat(cls, cameras: Sequence[Camera]) -> Camera:
        """All of them, in images as those of the first."""
        return cameras[0]._with(torch.cat([camera.view_matrix() for camera in cameras]),
                                torch.cat([camera.params for camera in cameras]))

    def to(self, *args: Any, **kwargs: Any) -> Camera:
        """A camera of another dtype or device, as by torch.Tensor.to."""
        return self._with(self.view_matrix().to(*args, **kwargs), self.params.to(*args, **kwargs))

    def _with(self, view: torch.Tensor, params: torch.Tensor) -> Camera:
        lens = self.intrinsics
        return Camera(CameraExtrinsics(view),
                      PinholeIntrinsics(lens.width, lens.height, params, lens.near, lens.far))

    def float(self) -> Camera:
        """The camera in float32."""
        return self.to(torch.float32)

    def double(self) -> Camera:
        """The camera in float64."""
        return self.to(torch.float64)

    def cpu(self) -> Camera:
        """Itself."""
        return self

    def cuda(self) -> Camera:
        """Itself: tilegrad renders on the CPU."""
        return self

    def __getattr__(self, name: str) -> Any:
        for part in ("extrinsics", "intrinsics"):
            if name != part and not name.startswith("_") and hasattr(getattr(self, part), name):
                return getattr(getattr(self, part), name)
        raise AttributeError(f"Camera has no attribute {name!r}: docs/porting.md lists what is "
                             f"available")

    def __getitem__(self, item: Any) -> Camera:
        if isinstance(item, int):
            if not -len(self) <= item < len(self):
                raise IndexError(f"Camera: item {item} of {len(self)}")
            item = slice(item, item + 1 or None)
        return self._with(self.view_matrix()[item], self.params[item])

    def __len__(self) -> int:
        return len(self.extrinsics)


def generate_centered_pixel_coords(img_width: int, img_height: int) -> Rays:
    """y and x of pixel centres, [H,W] each; row 0 on top."""
    y, x = torch.meshgrid(torch.arange(img_height) + 0.5, torch.arange(img_width) + 0.5,
                          indexing="ij")
    return y, x


def generate_pinhole_rays(camera: Camera,
                          coords_grid: Optional[Sequence[torch.Tensor]] = None) -> Rays:
    """Where rays through pixels begin, and their unit directions, [P,3] each, in the world.
    coords_grid: y and x in pixels; None: all pixel centres, row by row. ValueError: not one camera.
    """
    if len(camera) != 1:
        raise ValueError(f"generate_pinhole_rays: {len(camera)} cameras, expected one")
    grid = coords_grid or generate_centered_pixel_coords(camera.width, camera.height)
    y, x = (coordinate.to(camera.dtype).reshape(-1) for coordinate in grid)
    right = (x - camera.x0 - camera.width / 2) / camera.focal_x
    up = (camera.height / 2 - y - camera.y0) / camera.focal_y
    directions = torch.nn.functional.normalize(
        torch.stack([right, up, -torch.ones_like(right)], dim=-1), dim=-1)
    begin, directions = camera.inv_transform_rays(torch.zeros_like(directions), directions)
    return begin[0], directions[0]


def _only(constructors: dict[str, Callable[..., Any]], given: dict[str, Any],
          expected: str) -> Callable[..., Any]:
    """The constructor whose argument was given."""
    found = [constructor for name, constructor in constructors.items() if name in given]
    if len(found) != 1:
        raise ValueError(f"Camera.from_args: expected {expected}; got {', '.join(given)}")
    return found[0]
