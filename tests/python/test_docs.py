# SPDX-License-Identifier: Apache-2.0
"""The Python of README.md and of the pages in docs/ runs as it stands there."""

import os
import pydoc
import re

import numpy as np

import tilegrad
from file_samples import FolderTest, dataset, run, run_program, textured_mesh
from support import SOURCE, needs_torch
from tilegrad import files


def code_of(page: str, language: str = "python") -> str:
    """All blocks of a page behind each other."""
    text = (SOURCE / page).read_text(encoding="utf-8")
    return "\n".join(re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL))


class Docs(FolderTest):
    def setUp(self) -> None:
        super().setUp()
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(self.folder)

    def run_page(self, page: str, language: str = "python") -> dict:
        names: dict = {}
        exec(code_of(page, language), names)  # pylint: disable=exec-used
        return names

    def test_readme(self) -> None:
        self.assertTrue((self.run_page("README.md")["gradients"].positions != 0).any())

    def test_help(self) -> None:
        """Whether or not torch is there."""
        self.assertIn("icosphere", pydoc.plaintext.document(tilegrad))

    def test_python(self) -> None:
        names = self.run_page("docs/python.md")
        self.assertLess(np.abs(names["guess"] - names["truth"]).max(), 0.01)

    @needs_torch
    def test_torch(self) -> None:
        """Blocks of code that needs torch are marked py, all others python."""
        names = self.run_page("docs/python.md", "py")
        self.assertGreater(float(names["positions"].grad.abs().max()), 0)

    def test_files(self) -> None:
        for name, target in (("runs/demo", run()), ("datasets/furniture", dataset())):
            path = self.folder / name
            path.parent.mkdir()
            path.symlink_to(target)
        run_program("dataset-view", "--data", dataset(), "--out", "photo.png")
        with open("chair.obj", "w", encoding="utf-8") as file:
            for p in textured_mesh().positions:
                file.write("v {} {} {}\n".format(*p))
            file.write("f 1 2 3 4\n")
        self.run_page("docs/files.md")
        self.assertEqual(len(files.load_mesh("chair.glb").faces), 2)

    def test_cameras(self) -> None:
        """OpenCV's file has one camera in three forms, that of the table above it."""
        with open("opencv.json", "w", encoding="utf-8") as file:
            file.write(code_of("docs/rendering.md", "json"))
        views = files.load_cameras("opencv.json")
        self.assertEqual([view.name for view in views], ["0001", "0002", "0003"])
        for view in views:
            np.testing.assert_allclose(view.camera.rotation, np.eye(3), atol=1e-8)
            np.testing.assert_allclose(view.camera.translation, [-1, 0, -4], atol=1e-8)
            np.testing.assert_allclose([view.camera.cx, view.camera.cy], [320, 240], atol=1e-12)
