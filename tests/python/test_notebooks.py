# SPDX-License-Identifier: Apache-2.0
"""The notebooks in examples/ run from top to bottom, and show pictures. Jupyter is not needed: their
code is run cell by cell, and the last expression of a cell is asked for its picture."""

import ast
import contextlib
import io
import json
import os
import tempfile
import unittest

from file_samples import FolderTest
from support import SOURCE

NOTEBOOKS = sorted((SOURCE / "examples/notebooks").glob("*.ipynb"))
KEYS = {"cells", "metadata", "nbformat", "nbformat_minor"}


def run_cell(code, names):
    """The value of the cell's last expression; None if it ends otherwise."""
    tree = ast.parse(code)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)  # pylint: disable=exec-used
    if last is None:
        return None
    return eval(compile(ast.Expression(last.value), "cell", "eval"), names)  # pylint: disable=eval-used


class Notebooks(FolderTest):
    def test_they_run(self):
        self.assertGreaterEqual(len(NOTEBOOKS), 2)
        self.addCleanup(os.chdir, os.getcwd())
        for path in NOTEBOOKS:
            with self.subTest(path.name), tempfile.TemporaryDirectory() as folder:
                os.chdir(folder)
                notebook = json.loads(path.read_text(encoding="utf-8"))
                self.assertEqual(set(notebook), KEYS)
                names, pictures, printed = {}, 0, io.StringIO()
                for cell in notebook["cells"]:
                    if cell["cell_type"] != "code":
                        continue
                    self.assertEqual(cell["outputs"], [])  # kept out of the repository
                    with contextlib.redirect_stdout(printed):
                        shown = run_cell("".join(cell["source"]), names)
                    if hasattr(shown, "_repr_png_"):
                        pictures += 1
                        self.assertEqual(shown._repr_png_()[:4], b"\x89PNG")
                self.assertGreaterEqual(pictures, 2)
                self.assertTrue(os.listdir(folder))
                self.check(path.stem, names)

    def check(self, name, names):
        if name == "first_pictures":
            self.assertLess(names["after"], 0.97 * names["before"])
        if name == "fit_from_images":
            self.assertGreater(names["result"].held_out["silhouette_iou"], 0.85)


if __name__ == "__main__":
    unittest.main()
