# SPDX-License-Identifier: Apache-2.0
"""Small files for tests: made here, or by the program where it was built."""

import atexit
import functools
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

import numpy as np

try:
    from tilegrad import files
except ImportError as error:  # of builds with TILEGRAD_PROGRAM=OFF
    raise unittest.SkipTest(f"no tilegrad._tools: {error}") from None

_FOLDER = pathlib.Path(tempfile.mkdtemp(prefix="tilegrad_python_"))
atexit.register(shutil.rmtree, _FOLDER)
PROGRAM = pathlib.Path(os.environ.get("TILEGRAD_BUILD", "")) / "src/cli/tilegrad"

_CONFIG = """name = "tiny"
[network]
channels = 4
code = 16
hidden1 = 16
hidden2 = 16
template_level = 1
[schedule]
batch = 4
views = 2
steps = 3
"""


def run_program(*arguments: object) -> None:
    """Runs tilegrad; the test is skipped where it was not built."""
    if not PROGRAM.exists():
        raise unittest.SkipTest(f"no program {PROGRAM}: set TILEGRAD_BUILD to a build folder")
    subprocess.run([PROGRAM, *map(str, arguments)], check=True, capture_output=True)


@functools.lru_cache(maxsize=None)
def dataset() -> pathlib.Path:
    """Fifteen procedural models in five classes, 4 views of 32 x 32 pixels."""
    folder = _FOLDER / "dataset"
    run_program("dataset", "--source", "procedural", "--per-class", 3, "--size", 32, "--views", 4,
                "--validation-share", 0.34, "--out", folder)
    return folder


@functools.lru_cache(maxsize=None)
def run() -> pathlib.Path:
    """A run of three steps of a small network."""
    folder = _FOLDER / "run"
    config = _FOLDER / "tiny.toml"
    config.write_text(_CONFIG)
    run_program("train", "--data", dataset(), "--config", config, "--out", folder)
    return folder


def textured_mesh() -> files.Mesh:
    """A square of two faces: one red through a texture of 2 x 2 texels, one plain blue."""
    texels = np.array([[[255, 0, 0], [200, 0, 0]], [[150, 0, 0], [100, 0, 0]]], np.uint8)
    return files.Mesh(
        positions=np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        normals=np.tile(np.array([[0, 0, 1]], np.float32), (4, 1)),
        corner_uvs=np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], np.float32),
        face_materials=np.array([0, 1], np.int32),
        materials=[files.Material("red", (1, 1, 1, 1), texture=0, wrap="clamp repeat", nearest=True),
                   files.Material("blue", (0, 0, 1, 1), double_sided=False, unlit=True)],
        textures=[files.MeshTexture("texels", texels)])


class FolderTest(unittest.TestCase):
    """A test with a folder of its own that is gone afterwards."""

    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory(prefix="tilegrad_python_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.addCleanup(self._expect_nothing_hidden)

    def _expect_nothing_hidden(self) -> None:
        """Nothing that its owner would not see is left where somebody works."""
        self.assertEqual(list(self.folder.rglob(".*")), [])
