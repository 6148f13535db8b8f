# SPDX-License-Identifier: Apache-2.0
"""kaolin.io.render."""

from __future__ import annotations

import json
import math
import os
from typing import Any, Union

import torch

from tilegrad.compat.kaolin.render.camera import generate_perspective_projection
from tilegrad.images import load_image
from tilegrad.compat.kaolin._missing import missing_from

__getattr__ = missing_from(__name__)

_PICTURES = ("rgb", "normals")  # {idx}_rgb.png; the others are arrays: {idx}_semantic.npy


def import_synthetic_view(root_dir: Union[str, "os.PathLike[str]"], idx: int, rgb: bool = True,
                          depth_linear: bool = False, semantic: bool = False,
                          instance: bool = False, normals: bool = False,
                          bbox_2d_tight: bool = False,
                          bbox_2d_loose: bool = False) -> dict[str, Any]:
    """Reads one view of a folder that Kaolin's data generator wrote.

    Returns what was asked for (None where the file is absent): rgb and normals [H,W,3], 0 to 1;
    depth_linear, semantic, instance [H,W]; boxes as the file has them; and metadata, a dictionary
    of cam_transform [4,3], cam_proj [3,1], asset_transforms [4,4], clipping_range.
    OSError, ValueError: name the file and what is wrong with it.
    """
    root = os.fspath(root_dir)
    wanted = {"rgb": rgb, "depth_linear": depth_linear, "semantic": semantic,
              "instance": instance, "normals": normals}
    output = {name: _image(root, idx, name) for name, is_wanted in wanted.items() if is_wanted}
    path = os.path.join(root, f"{idx}_metadata.json")
    with open(path, encoding="utf-8") as file:
        text = file.read()
    try:
        metadata = json.loads(text)
        output["metadata"] = _metadata(metadata)
        for name, is_wanted in (("bbox_2d_tight", bbox_2d_tight), ("bbox_2d_loose", bbox_2d_loose)):
            if is_wanted:
                output[name] = metadata[name]
    except (KeyError, IndexError, TypeError, ValueError, ZeroDivisionError) as error:
        raise ValueError(f"{path}: not the metadata of a view: {error!r}") from error
    return output


def _image(root: str, idx: int, name: str) -> Any:
    path = os.path.join(root, f"{idx}_{name}.{'png' if name in _PICTURES else 'npy'}")
    if not os.path.exists(path):
        return None
    image = torch.from_numpy(load_image(path))
    return image[..., :3] / 255. if name in _PICTURES else image


def _metadata(metadata: dict[str, Any]) -> dict[str, Any]:
    camera = metadata["camera_properties"]
    size = camera["resolution"]
    # Kaolin takes the horizontal angle for the vertical one; in square images it is.
    angle = 2 * math.atan(camera["horizontal_aperture"] / (2 * camera["focal_length"]))
    return {"cam_transform": torch.tensor(camera["tf_mat"], dtype=torch.float32)[:, :3],
            "asset_transforms": torch.tensor(metadata["asset_transforms"][0][1],
                                             dtype=torch.float32),
            "cam_proj": generate_perspective_projection(angle, size["width"] / size["height"]),
            "clipping_range": camera["clipping_range"]}
