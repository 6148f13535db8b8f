# SPDX-License-Identifier: Apache-2.0
"""Camera of kaolin.render.camera: extrinsics and intrinsics, and the rays of its pixels."""

from __future__ import annotations

import inspect
from typing import Any, Callable, Optional, Sequence

import torch

from tilegrad._dense import full_precision
from tilegrad.compat.kaolin.render._pinhole import CameraExtrinsics, PinholeIntrinsics

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
        lens = cameras[0].intrinsics
        params = torch.cat([camera.params for camera in cameras])
        return cls(CameraExtrinsics(torch.cat([camera.view_matrix() for camera in cameras])),
                   PinholeIntrinsics(lens.width, lens.height, params, lens.near, lens.far))

    def to(self, *args: Any, **kwargs: Any) -> Camera:
        """A camera of another dtype or device, as torch.Tensor.to has it."""
        lens = self.intrinsics
        return Camera(CameraExtrinsics(self.view_matrix().to(*args, **kwargs)),
                      PinholeIntrinsics(lens.width, lens.height,
                                        lens.params.to(*args, **kwargs), lens.near, lens.far))

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
        item = slice(item, item + 1 or None) if isinstance(item, int) else item
        lens = self.intrinsics
        return Camera(CameraExtrinsics(self.view_matrix()[item]),
                      PinholeIntrinsics(lens.width, lens.height, lens.params[item], lens.near,
                                        lens.far))

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
