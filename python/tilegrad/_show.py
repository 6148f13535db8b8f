# SPDX-License-Identifier: Apache-2.0
"""A picture of a mesh in one call."""

from __future__ import annotations

from typing import Any, Optional, Sequence

from tilegrad._camera import Camera
from tilegrad._camera_arguments import filled_size
from tilegrad._lit import lit
from tilegrad._renderer import Frame
from tilegrad.meshes import as_mesh

_SIDE = 512  # pixels


def render(mesh: Any, camera: Optional[Camera] = None, *, width: Optional[int] = None,
           height: Optional[int] = None, azimuth: float = 60, elevation: float = 20,
           background: Optional[Sequence[float]] = None,
           outputs: Sequence[str] = ("color", "alpha"), threads: int = 0,
           **arguments: Any) -> Frame:
    """A picture of a mesh, framed and lit: `tilegrad.render("chair.glb").save("chair.png")`.

    mesh: a file, a `Mesh`, an object of trimesh or Open3D, or (positions, faces); what
        `tilegrad.meshes.as_mesh` takes.
    camera: None: `Camera.framing` of the mesh, from azimuth and elevation (degrees; numbers, or
        (N,) for N pictures).
    width, height: pixels; None: the size of the camera (`Camera.size`), or 512.
    background: r, g, b behind the object in `save`; None: transparent.
    arguments: those of `Scene` (lighting, lights, colors, ...) and of `Renderer.render` (delta,
        max_alpha_error, ...); without them Lambert light from behind the camera.
    Returns a Frame, which notebooks show, `save` writes, and `Renderer.backward` takes.
    """
    mesh = as_mesh(mesh)
    own = camera.size if isinstance(camera, Camera) else None
    width, height = filled_size(width, height, own or (_SIDE, _SIDE))
    if camera is None:
        camera = Camera.framing(mesh, azimuth=azimuth, elevation=elevation, width=width,
                                height=height)
    if not isinstance(camera, Camera):
        raise TypeError(f"render: camera must be a Camera, got {type(camera).__name__}")
    return lit(mesh, camera, (width, height), background=background, outputs=outputs,
               threads=threads, **arguments)
