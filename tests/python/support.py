# SPDX-License-Identifier: Apache-2.0
"""What several tests share."""

import os
import pathlib
import unittest

try:
    import torch
except ImportError:
    torch = None

# The tree that the package was built from. Tests run from it, but see the installed package only.
SOURCE = pathlib.Path(os.environ.get("TILEGRAD_SOURCE", pathlib.Path(__file__).parents[2]))

# For classes whose name contains "Long".
long_test = unittest.skipUnless(os.environ.get("TILEGRAD_LABEL") == "long",
                                "runs in ./run test --long")
needs_torch = unittest.skipIf(torch is None, "no torch (Debian: python3-torch)")


def require_torch() -> None:
    """The setUpModule of files in which nothing works without torch."""
    if torch is None:
        raise unittest.SkipTest("no torch (Debian: python3-torch)")
