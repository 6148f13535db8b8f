# SPDX-License-Identifier: Apache-2.0
"""Names of files."""

from __future__ import annotations

import os
from typing import Any, Union

Path = Union[str, bytes, "os.PathLike[Any]"]


def name_of(path: Path) -> str:
    """The name of a file or folder, as C++ takes it. ValueError: not a possible file name."""
    name = os.fsdecode(path)
    try:
        if b"\0" not in os.fsencode(name):
            return name
    except UnicodeEncodeError:  # an unpaired surrogate
        pass
    raise ValueError(f"{name!r} cannot be the name of a file")


def ending_of(path: Path) -> str:
    """The ending of a file name, in lower case: ".png"; "" if it has none."""
    return os.path.splitext(os.fsdecode(path))[1].lower()
