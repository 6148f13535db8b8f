# SPDX-License-Identifier: Apache-2.0
"""Files that the examples for Kaolin's callers read: a sphere with a texture, and views of the body
of fit_kaolin.py in the form of Kaolin's data generator."""

from __future__ import annotations

import json
import math
import pathlib

import numpy as np

import fit_kaolin
from tilegrad import images


def write_sphere(folder: pathlib.Path, rings: int = 20, segments: int = 32) -> pathlib.Path:
    """sphere.obj with a uv for each corner of a face, its material, and a grey texture."""
    sphere = fit_kaolin.make_sphere(rings, segments)
    images.save_image(folder / "sphere.png", np.full((64, 64, 3), 128, np.uint8))
    (folder / "sphere.mtl").write_text("newmtl skin\nKd 1 1 1\nmap_Kd sphere.png\n")
    lines = ["mtllib sphere.mtl", "usemtl skin"]
    lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in sphere.vertices.tolist()]
    lines += [f"vt {u:.6f} {v:.6f}" for u, v in sphere.face_uvs.reshape(-1, 2).tolist()]
    for i, corners in enumerate((sphere.faces + 1).tolist()):
        lines.append("f " + " ".join(f"{c}/{3 * i + k + 1}" for k, c in enumerate(corners)))
    path = folder / "sphere.obj"
    path.write_text("\n".join(lines) + "\n")
    return path


def write_views(folder: pathlib.Path, count: int, size: int) -> None:
    """{i}_rgb.png, {i}_semantic.npy and {i}_metadata.json for i < count."""
    views = fit_kaolin.make_views(fit_kaolin.make_sphere(), count, size)
    for i, (image, mask, transform) in enumerate(zip(*views)):
        pixels = (255 * image).round().numpy().astype(np.uint8)
        images.save_image(folder / f"{i}_rgb.png", pixels)
        images.save_image(folder / f"{i}_semantic.npy", mask.numpy().astype(np.int32))
        matrix = np.column_stack([transform.numpy(), [0, 0, 0, 1]])
        camera = {"tf_mat": matrix.tolist(), "resolution": {"width": size, "height": size},
                  "focal_length": 1., "horizontal_aperture": 2 * math.tan(math.radians(20)),
                  "clipping_range": [0.1, 100.]}
        (folder / f"{i}_metadata.json").write_text(json.dumps(
            {"camera_properties": camera, "asset_transforms": [["body", np.eye(4).tolist()]]}))
