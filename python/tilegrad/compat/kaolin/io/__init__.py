# SPDX-License-Identifier: Apache-2.0
"""kaolin.io: import_mesh, obj, off, render: what its DIB-R examples read."""

from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.io import obj, off, render
from tilegrad.compat.kaolin.io._load import Path, load_surface
from tilegrad.compat.kaolin.rep import SurfaceMesh

__all__ = ["import_mesh", "obj", "off", "render"]

__getattr__ = missing_from(__name__)


def import_mesh(filename: Path, triangulate: bool = True) -> SurfaceMesh:
    """Everything that a file has, of any format that tilegrad.meshes reads; faces are cut into
    triangles, whatever `triangulate` says. OSError, ValueError: name the file and what is wrong
    with it."""
    del triangulate
    return load_surface(filename)
