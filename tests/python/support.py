# SPDX-License-Identifier: Apache-2.0
"""What several tests share."""

import os
import pathlib
import unittest

# The tree that the package was built from. Tests run from it, but see the installed package only.
SOURCE = pathlib.Path(os.environ.get("TILEGRAD_SOURCE", pathlib.Path(__file__).parents[2]))

# For classes whose name contains "Long".
long_test = unittest.skipUnless(os.environ.get("TILEGRAD_LABEL") == "long",
                                "runs in ./run test --long")
