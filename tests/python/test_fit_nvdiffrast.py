# SPDX-License-Identifier: Apache-2.0
"""examples/python/fit_nvdiffrast.py, a shorter run of it."""

import contextlib
import io
import pathlib
import sys
import tempfile
import unittest

from support import SOURCE

try:
    from tilegrad import files
except ImportError:  # of builds with TILEGRAD_PROGRAM=OFF
    files = None
try:
    import torch
except ImportError:
    torch = None
else:
    sys.path.insert(0, str(SOURCE / "examples" / "python"))
    import fit_nvdiffrast


@unittest.skipIf(torch is None, "torch is absent (Debian: python3-torch)")
class FitNvdiffrast(unittest.TestCase):
    def test_converges(self):
        with contextlib.redirect_stdout(io.StringIO()) as output:
            fitted = fit_nvdiffrast.fit(sizes=(8, 16), steps=300)
        self.assertEqual(len(output.getvalue().splitlines()), 2)
        distances = fitted.losses["distance of corners"]
        self.assertGreater(distances[0], 0.1)
        self.assertLess(distances[-1], 0.04)
        losses = fitted.losses["image loss"]
        self.assertLess(max(losses[-10:]), losses[0] / 10)
        error = (fitted.colors - fitted.cube.colors).abs().mean()
        self.assertLess(error, 0.15)

    @unittest.skipIf(files is None, "no tilegrad.files")
    def test_pictures(self):
        with contextlib.redirect_stdout(io.StringIO()):
            fitted = fit_nvdiffrast.fit(sizes=(8,), steps=2)
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "pictures.png"
            fit_nvdiffrast.save_pictures(str(path), fitted)
            self.assertEqual(files.load_image(path).shape, (3 * 256, 3 * 256, 3))


if __name__ == "__main__":
    unittest.main()
