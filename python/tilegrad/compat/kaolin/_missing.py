# SPDX-License-Identifier: Apache-2.0
"""The error of a module for a name that it lacks."""

from __future__ import annotations

from typing import Any, Callable


def missing_from(module: str) -> Callable[[str], Any]:
    """A `__getattr__` for `module`: an AttributeError that says where to look."""
    def __getattr__(name: str) -> Any:
        raise AttributeError(
            f"module {module!r} has no attribute {name!r}: the section on Kaolin in "
            f"docs/porting.md lists what is available, and what stands in for the rest")

    return __getattr__
