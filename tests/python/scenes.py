# SPDX-License-Identifier: Apache-2.0
"""Scenes that several tests render."""

import numpy as np

from tilegrad import Camera, Light, Scene, Surface, Texture

IMAGE = {"width": 34, "height": 29, "delta": 1e-3}
ALL = ("color", "alpha", "attributes", "depth", "normals", "uv", "barycentrics")
LIGHTINGS = ("none", "lambert", "phong", "spherical_harmonics")


def patch(dtype=np.float32, lighting="phong", count=None, seed=7, **changes):
    """A warped grid of 4 x 4 vertices with everything that a scene may have; with `count`, that
    many images, each with positions, colours, camera and lights of its own."""
    numbers = np.random.default_rng(seed)
    lead = () if count is None else (count,)
    x, y = np.meshgrid(np.arange(4) * 0.4 - 0.6, np.arange(4) * 0.4 - 0.6)
    grid = np.stack([x, y, np.full_like(x, -2)], axis=-1).reshape(16, 3)
    positions = grid + numbers.uniform(-0.03, 0.03, lead + (16, 3)) * (1, 1, 6)
    v = (4 * np.arange(3)[:, None] + np.arange(3)).reshape(-1, 1)
    faces = np.concatenate([v + (0, 1, 5), v + (0, 5, 4)])
    arguments = {
        "positions": positions.astype(dtype),
        "faces": faces.astype(np.int32),
        "camera": Camera(fx=30, fy=31, cx=17 + 0.5 * np.arange(count or 1).reshape(lead), cy=14),
        "colors": numbers.uniform(0.3, 0.9, lead + (16, 3)).astype(dtype),
        "uvs": numbers.uniform(0.1, 0.9, (18, 3, 2)).astype(dtype),
        "per_corner": ("uvs",),
        "attributes": numbers.uniform(-1, 1, (16, 2)).astype(dtype),
        "textures": Texture(numbers.uniform(0.3, 0.9, lead + (4, 5, 3)).astype(dtype), "clamp"),
        "surfaces": [Surface(ambient=(0.2, 0.2, 0.3), texture=0), Surface(texture=0)],
        "face_surfaces": (np.arange(18) % 2).astype(np.int32),
        "lighting": lighting,
    }
    if lighting == "spherical_harmonics":
        arguments["sh"] = numbers.uniform(-0.3, 0.3, lead + (9,)).astype(dtype) + dtype(0.1)
    elif lighting != "none":
        directions = np.array([(0.3, 0.5, 1), (-0.4, 0.2, 1)]) + numbers.uniform(0, 0.1,
                                                                                 lead + (2, 3))
        arguments["lights"] = Light(directions, np.broadcast_to([0.8, 0.3], lead + (2,)))
    return Scene(**{**arguments, **changes})


def cotangents(frame, names=("color", "alpha"), seed=3):
    """dL/d(image) that look random."""
    numbers = np.random.default_rng(seed)
    out = {name: numbers.uniform(-1, 1, getattr(frame, name).shape).astype(frame.dtype)
           for name in names}
    if "depth" in out:
        out["depth"] *= np.isfinite(frame.depth)
    return out
