# SPDX-License-Identifier: Apache-2.0
"""The renderer of tilegrad in C++; use it through the package tilegrad."""

from typing import Any

__version__: str
DEFAULTS: dict[str, Any]

def simd_target() -> str: ...
