# SPDX-License-Identifier: Apache-2.0
"""Names of files."""

from __future__ import annotations

import os
from typing import Union

Path = Union[str, "os.PathLike[str]"]


def ending_of(path: Path) -> str:
    """The ending of a file name, in lower case: ".png"; "" if it has none."""
    return os.path.splitext(os.fspath(path))[1].lower()
