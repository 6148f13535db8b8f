# SPDX-License-Identifier: Apache-2.0
"""examples/python/fit_kaolin.py, a shorter run of it."""

import contextlib
import io
import pathlib
import sys
import tempfile
import unittest
import warnings
import xml.etree.ElementTree as ElementTree

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
    import fit_kaolin
    from loss_curve import loss_curve_svg


@unittest.skipIf(torch is None, "torch is absent (Debian: python3-torch)")
class FitKaolin(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            cls.fitted, cls.views = fit_kaolin.fit(epochs=16, views=8, size=64)

    def test_converges(self):
        losses = self.fitted.losses
        self.assertGreater(losses["silhouette"][0], 0.25)
        self.assertLess(losses["silhouette"][-1], 0.06)
        self.assertLess(losses["image"][-1], losses["image"][0] / 3)

    @unittest.skipIf(files is None, "no tilegrad.files")
    def test_pictures(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "pictures.png"
            fit_kaolin.save_pictures(str(path), self.fitted, self.views)
            self.assertEqual(files.load_image(path).shape, (2 * 64, 6 * 64, 3))

    def test_curve(self):
        svg = loss_curve_svg("a < b", "step", self.fitted.losses)
        lines = ElementTree.fromstring(svg).findall("{http://www.w3.org/2000/svg}polyline")
        self.assertEqual([len(line.get("points").split()) for line in lines], 3 * [32])


if __name__ == "__main__":
    unittest.main()
