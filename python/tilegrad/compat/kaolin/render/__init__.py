# SPDX-License-Identifier: Apache-2.0
"""kaolin.render: camera, lighting, mesh."""

from tilegrad.compat.kaolin.render import camera, lighting, mesh

__all__ = ["camera", "lighting", "mesh"]
