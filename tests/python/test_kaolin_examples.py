# SPDX-License-Identifier: Apache-2.0
"""examples/python/kaolin_*.py, shorter runs of them: code as Kaolin's callers write it, of three
generations, with one import changed."""

import importlib.util
import pathlib
import re
import sys
import tempfile
import unittest
import warnings

from support import SOURCE

try:
    import torch
except ImportError:
    torch = None

EXAMPLES = SOURCE / "examples" / "python"
NAMES = ("kaolin_0_1_renderer", "kaolin_0_12_tutorial", "kaolin_0_15_text_to_mesh",
         "kaolin_project_texture")


class Examples(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        if torch is None or importlib.util.find_spec("tilegrad._tools") is None:
            raise unittest.SkipTest("torch is absent (Debian: python3-torch), or a build without "
                                    "files")
        sys.path.insert(0, str(EXAMPLES))
        cls.modules = {name: __import__(name) for name in (*NAMES, "kaolin_files")}

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.sphere = self.modules["kaolin_files"].write_sphere(self.folder, 12, 16)
        warnings.simplefilter("ignore")
        self.addCleanup(warnings.resetwarnings)

    def test_one_import_is_all_that_is_tilegrads(self):
        for name in NAMES:
            code = re.sub(r'""".*?"""', "", (EXAMPLES / f"{name}.py").read_text(), flags=re.S)
            lines = [line for line in code.splitlines() if "tilegrad" in line]
            self.assertEqual(lines, ["import tilegrad.compat.kaolin as kal"], name)

    def test_renderer_of_0_1(self):
        losses = self.modules["kaolin_0_1_renderer"].fit(self.sphere, steps=60, size=32)
        last = [sum(values) / 10 for values in zip(*losses[-10:])]
        self.assertLess(last[0], losses[0][0] / 2)  # image
        self.assertLess(last[1], losses[0][1] / 2)  # silhouette

    def test_tutorial_of_0_12(self):
        self.modules["kaolin_files"].write_views(self.folder, 8, 48)
        losses = self.modules["kaolin_0_12_tutorial"].fit(self.folder, views=8, epochs=30)
        last = [sum(values) / 4 for values in zip(*losses[-4:])]
        self.assertLess(last[0], losses[0][0] / 2)
        self.assertLess(last[1], losses[0][1] / 2)

    def test_text_to_mesh_of_0_15(self):
        losses = self.modules["kaolin_0_15_text_to_mesh"].fit(self.sphere, steps=60, size=32)
        self.assertLess(sum(losses.score[-5:]) / 5, losses.score[0] / 2)
        self.assertLess(losses.chamfer[1], losses.chamfer[0] / 2)

    def test_projected_texture(self):
        texture, truth, seen = self.modules["kaolin_project_texture"].project(self.sphere, 64)
        self.assertGreater(seen.float().mean().item(), 0.9)
        error = (texture - truth).abs().amax(dim=1)[seen]
        self.assertLess(error.mean().item(), 0.02)
        # The image has two pixels a texel, so that colours are those of texels beside at most; they
        # change by 0.4 * 5 * (2 pi / 64) = 0.2 over one.
        self.assertLess(error.max().item(), 0.4)


if __name__ == "__main__":
    unittest.main()
