# SPDX-License-Identifier: Apache-2.0
"""A mesh with default lighting."""

from __future__ import annotations

import os
from typing import Any, Optional, Sequence

import numpy as np

from tilegrad._camera import Camera
from tilegrad._renderer import Frame, PASSED_ON, Renderer
from tilegrad._scene import Light

_SOFT_PIXELS = 0.6  # how far outlines fade, as anti-aliasing
# Towards lights, in the camera's axes: from above on the left, from the right, and from behind it.
_LIGHTS = ((-0.4, 0.6, 1.0), (1.0, -0.1, 0.4), (0.0, 0.0, 1.0))
_INTENSITIES = (0.65, 0.2, 0.2)
_renderers: dict[tuple[int, int], Renderer] = {}  # of this process, by threads


def lit(mesh: Any, camera: Camera, size: tuple[int, int], *,
        background: Optional[Sequence[float]] = None,
        outputs: Sequence[str] = ("color", "alpha"), threads: int = 0, **arguments: Any) -> Frame:
    """A picture of a `tilegrad.meshes.Mesh`; background and arguments as in `tilegrad.render`."""
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
