# SPDX-License-Identifier: Apache-2.0
"""pip and cmake --install put a package where Python finds it, which works from there alone."""

import importlib.util
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import tilegrad
from support import SOURCE, long_test

BUILD = os.environ.get("TILEGRAD_BUILD", "")
HAS_PIP = all(importlib.util.find_spec(name) for name in ("pip", "setuptools", "wheel"))
NEEDS = "python3-pip, python3-setuptools and python3-wheel are not installed"
FILES = ("setup.py", "pyproject.toml", "MANIFEST.in", "README.md", "LICENSE", "CHANGELOG.md",
         "CMakeLists.txt", "CMakePresets.json")
FOLDERS = ("cmake", "data", "include", "python", "src")


class Workspace(unittest.TestCase):
    """A copy of the sources in a folder that goes away: builds leave traces beside setup.py."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.work = pathlib.Path(folder.name)
        self.source, self.target = self.work / "source", self.work / "target"
        self.source.mkdir()
        for name in FILES:
            shutil.copy(SOURCE / name, self.source)
        for name in FOLDERS:
            shutil.copytree(SOURCE / name, self.source / name,
                            ignore=shutil.ignore_patterns("__pycache__"))

    def run_python(self, *arguments, timeout=60, **environment):
        clean = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        done = subprocess.run([sys.executable, *map(str, arguments)], cwd=self.work,
                              env={**clean, **environment}, capture_output=True, text=True,
                              timeout=timeout)
        self.assertEqual(done.returncode, 0, done.stdout[-3000:] + done.stderr[-3000:])
        return done.stdout

    def pip(self, what, **more):
        self.run_python("-m", "pip", "install", "--no-build-isolation", "--no-deps", "--no-index",
                        "--target", self.target, what, **more)

    def check(self):
        """The package in the target folder is the one that runs, and it is sound."""
        files = {str(path.relative_to(self.target)) for path in self.target.rglob("*")}
        for name in ("tilegrad/__init__.py", "tilegrad/_core.pyi", "tilegrad/py.typed",
                     f"tilegrad-{tilegrad.__version__}.dist-info/METADATA"):
            self.assertIn(name, files)
        code = "import tilegrad; print(tilegrad.__file__)"
        where = self.run_python("-c", code, PYTHONPATH=str(self.target)).strip()
        self.assertEqual(where, str(self.target / "tilegrad/__init__.py"))
        self.assertIn("checks hold", self.run_python("-m", "tilegrad.selftest",
                                                     PYTHONPATH=str(self.target)))


@unittest.skipUnless(HAS_PIP, NEEDS)
class Pip(Workspace):
    @unittest.skipUnless(BUILD, "TILEGRAD_BUILD names no build tree")
    def test_install_from_a_build_tree(self):
        self.pip(self.source, TILEGRAD_BUILD=BUILD, timeout=300)
        self.check()
        moved = self.work / "moved"  # it finds nothing by where it was installed
        self.target.rename(moved)
        self.assertIn("checks hold", self.run_python("-m", "tilegrad.selftest",
                                                     PYTHONPATH=str(moved)))


@long_test
@unittest.skipUnless(HAS_PIP, NEEDS)
class LongPip(Workspace):
    def test_install_from_a_source_archive(self):
        """Everything that building needs is in the archive. The renderer alone, and for one
        instruction set, to save time."""
        subprocess.run([sys.executable, "setup.py", "-q", "sdist"], cwd=self.source, check=True,
                       capture_output=True)
        archive, = (self.source / "dist").glob("tilegrad-*.tar.gz")
        shutil.rmtree(self.source / "src")
        launcher = {"CMAKE_CXX_COMPILER_LAUNCHER": "ccache"} if shutil.which("ccache") else {}
        self.pip(archive, TILEGRAD_BUILD="", timeout=1500, **launcher,
                 TILEGRAD_CMAKE_ARGS="-DTILEGRAD_PROGRAM=OFF -DTILEGRAD_SIMD=scalar")
        self.check()


class Modules(unittest.TestCase):
    def test_extension_modules_depend_on_nothing_of_the_build(self):
        """No search path into a build tree, no libtilegrad.so."""
        folder = pathlib.Path(tilegrad.__file__).parent
        modules = list(folder.glob("*.so"))
        self.assertTrue(modules)
        for path in modules:
            dynamic = subprocess.run(["readelf", "-d", path], capture_output=True, text=True,
                                     check=True).stdout
            self.assertNotIn("RPATH", dynamic)
            self.assertNotIn("RUNPATH", dynamic)
            self.assertNotIn("libtilegrad", dynamic)


if __name__ == "__main__":
    unittest.main()
