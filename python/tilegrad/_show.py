# SPDX-License-Identifier: Apache-2.0
"""A picture of a mesh in one call."""

from __future__ import annotations

import os
from typing import Any, Optional, Sequence

import numpy as np

from tilegrad._camera import Camera
from tilegrad._camera_arguments import filled_size
from tilegrad._renderer import Frame, PASSED_ON, Renderer
from tilegrad._scene import Light

_SOFT_PIXELS = 0.6  # how far outlines fade, so that they do not look like stairs
# Towards lights, in the camera's axes: from above on the left, from the right, and from behind it.
_LIGHTS = ((-0.4, 0.6, 1.0), (1.0, -0.1, 0.4), (0.0, 0.0, 1.0))
_INTENSITIES = (0.65, 0.2, 0.2)
_renderers: dict[tuple[int, int], Renderer] = {}  # of this process, by threads


def lit(mesh: Any, camera: Camera, size: tuple[int, int], *,
        background: Optional[Sequence[float]] = None,
        outputs: Sequence[str] = ("color", "alpha"), threads: int = 0, **arguments: Any) -> Frame:
    """A picture of a `tilegrad.meshes.Mesh`; background and arguments as of `tilegrad.render`."""
    width, height = size
    options = {name: arguments.pop(name) for name in list(arguments) if name in PASSED_ON}
    options.setdefault("delta", (_SOFT_PIXELS * 2 / max(width, height)) ** 2)
    scene = mesh.scene(camera, **{**_look(camera), **arguments})
    frame = _renderer(threads).render(scene, width=width, height=height, outputs=outputs, **options)
    frame.background = background
    return frame


def _look(camera: Camera) -> dict[str, Any]:
    towards = np.asarray(_LIGHTS, np.float32) @ np.asarray(camera.rotation, np.float32)
    return {"lighting": "lambert",
            "lights": Light(towards, np.broadcast_to(_INTENSITIES, towards.shape[:-1]))}


def _renderer(threads: int) -> Renderer:
    key = (os.getpid(), threads)
    if key not in _renderers:
        _renderers[key] = Renderer(threads)
    return _renderers[key]


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
    width, height: pixels; None: what the camera is for (`Camera.size`), or 512.
    background: r, g, b of what `save` draws the object over; None: transparent.
    arguments: those of `Scene` (lighting, lights, colors, ...) and of `Renderer.render` (delta,
        max_alpha_error, ...); without them Lambert light from behind the camera.
    Returns a Frame, which notebooks show, `save` writes, and `Renderer.backward` takes.
    """
    from tilegrad.meshes import as_mesh  # which shows meshes by `lit`
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
