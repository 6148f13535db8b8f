# SPDX-License-Identifier: Apache-2.0
"""kaolin.io.off."""

from __future__ import annotations

from typing import NamedTuple, Optional

import torch

from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.io._load import Path, load_surface

__getattr__ = missing_from(__name__)
__all__ = ["import_mesh"]


class OffMesh(NamedTuple):
    """vertices [V,3], faces [F,3] int64, face_colors [F,3] int64, 0 to 255, or None."""

    vertices: torch.Tensor
    faces: torch.Tensor
    face_colors: Optional[torch.Tensor]


def import_mesh(path: Path, with_face_colors: bool = False) -> OffMesh:
    """Loads a mesh; faces are cut into triangles. OSError, ValueError: name the file and what is
    wrong with it."""
    mesh = load_surface(path, False, False)
    colors = mesh.face_colors if with_face_colors else None
    return OffMesh(mesh.vertices, mesh.faces,
                   None if colors is None else (255 * colors[:, 0]).round().long())
