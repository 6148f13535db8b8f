# SPDX-License-Identifier: Apache-2.0
"""Built-in shapes for examples and tests."""

from __future__ import annotations

import numpy as np

from tilegrad import _arrays, _core


def icosphere(level: int = 3, radius: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A subdivided icosahedron: positions (V, 3) float32, faces (F, 3) int32, counter-clockwise
    seen from outside.

    level: 0 to 8; V = 10 * 4^level + 2, F = 20 * 4^level. Level 3 is the DIB-R paper's template.
    radius: world units, > 0.
    """
    return _core.icosphere(_arrays.as_number("icosphere", "level", level, int),
                           _arrays.as_number("icosphere", "radius", radius, float))
