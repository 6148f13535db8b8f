# SPDX-License-Identifier: Apache-2.0
"""pip and cmake --install put a package where Python finds it, which works from there alone: with the
program, and in a wheel with all libraries where none is installed."""

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
HAS_PIP = importlib.util.find_spec("pip") is not None
FILES = ("pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "CMakeLists.txt",
         "CMakePresets.json")
FOLDERS = ("cmake", "configs", "data", "include", "python", "src")


class Workspace(unittest.TestCase):
    """A copy of the sources in a folder that goes away."""

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
        self.run_python("-m", "pip", "install", "--no-deps", "--no-index", "--target", self.target,
                        what, **more)

    def check(self):
        """The package in the target folder is the one that runs."""
        files = {str(path.relative_to(self.target)) for path in self.target.rglob("*")}
        for name in ("tilegrad/__init__.py", "tilegrad/compat/kaolin/__init__.py", "tilegrad/py.typed",
                     f"tilegrad-{tilegrad.__version__}.dist-info/METADATA"):
            self.assertIn(name, files)
        code = "import tilegrad; print(tilegrad.__file__)"
        where = self.run_python("-c", code, PYTHONPATH=str(self.target)).strip()
        self.assertEqual(where, str(self.target / "tilegrad/__init__.py"))


@unittest.skipUnless(HAS_PIP, "python3-pip is not installed")
class Pip(Workspace):
    @unittest.skipUnless(BUILD, "TILEGRAD_BUILD names no build tree")
    def test_install_from_a_build_tree(self):
        self.pip(self.source, TILEGRAD_BUILD=BUILD, timeout=300)
        self.check()
        moved = self.work / "moved"  # it finds nothing by where it was installed
        self.target.rename(moved)
        self.assertIn("checks hold", self.run_python("-m", "tilegrad.selftest", "--only", "same bits",
                                                     PYTHONPATH=str(moved)))
        self.assertIn("quick", self.run_python("-m", "tilegrad", "configs",
                                               PYTHONPATH=str(moved)))

    @unittest.skipUnless(BUILD and shutil.which("patchelf"), "patchelf is not installed")
    def test_a_wheel_with_libraries(self):
        """In an environment of its own: the command, its pages, its configurations. The loader takes
        every library that is not the system's from the package, each with its licence."""
        self.run_python(self.source / "python/build_backend.py", self.work / "wheel",
                        TILEGRAD_BUILD=BUILD, TILEGRAD_BUNDLE="1", timeout=300)
        wheel, = (self.work / "wheel").glob("tilegrad-*.whl")
        env = self.work / "env"
        self.run_python("-m", "venv", "--system-site-packages", env)
        subprocess.run([env / "bin/pip", "install", "-q", "--no-index", wheel], check=True,
                       timeout=120)
        clean = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        done = subprocess.run([env / "bin/tilegrad", "configs", "quick"], capture_output=True,
                              text=True, check=True, cwd=self.work, env=clean)
        self.assertIn('name = "quick"', done.stdout)
        self.assertIn("tilegrad-fit.1", os.listdir(env / "share/man/man1"))
        package, = env.glob("lib/python3*/site-packages/tilegrad")
        self.assertTrue(list((package / "lib").glob("*.copyright")))
        weights = {path.name for path in (SOURCE / "data/weights").glob("*.safetensors")}
        self.assertEqual({path.name for path in package.glob("share/tilegrad/weights/*")}, weights)
        write = ("import numpy as np; from tilegrad import files; box = np.zeros((64, 64, 4)); "
                 "box[16:48, 20:44] = 1; files.save_image('box.png', box)")
        for command in ([env / "bin/python", "-c", write],
                        [env / "bin/tilegrad", "predict", "--refine", "0", "box.png"],
                        [env / "bin/tilegrad", "sample", "--count", "2", "--out", "cars"]):
            subprocess.run(command, check=True, cwd=self.work, env=clean, capture_output=True)
        for binary in [package / "bin/tilegrad", *package.glob("*.so")]:
            lines = subprocess.run(["ldd", binary], capture_output=True, text=True,
                                   check=True).stdout
            others = {line.split()[0] for line in lines.splitlines()
                      if "=> /" in line and str(package.resolve()) not in line}
            self.assertLessEqual(others, {"libc.so.6", "libm.so.6", "libgcc_s.so.1",
                                          "libstdc++.so.6"})


class RendererAlone(Workspace):
    """What TILEGRAD_PROGRAM=OFF makes: no function that fails where it is used, no command."""

    def test_the_package(self):
        package = self.work / "alone/tilegrad"
        shutil.copytree(pathlib.Path(tilegrad.__file__).parent, package,
                        ignore=shutil.ignore_patterns("_tools*.so", "bin", "lib", "__pycache__"))
        self.check_alone(package.parent)

    def check_alone(self, folder):
        code = """
import tilegrad
ball = tilegrad.icosphere(1)
for name in ("render", "fit", "train", "files", "losses", "predict", "runs"):
    assert not hasattr(tilegrad, name) and name not in dir(tilegrad), name
camera = tilegrad.Camera.framing(ball, width=16, height=16)
assert tilegrad.Renderer(1).render(tilegrad.Scene(*ball, camera)).alpha.any()
for line in ("import tilegrad.files", "from tilegrad import files", "import tilegrad.losses"):
    try:
        exec(line)
    except ImportError as error:
        print(error)
"""
        said = self.run_python("-c", code, PYTHONPATH=str(folder)).splitlines()
        self.assertEqual(said, ["this build of tilegrad has the renderer only "
                                "(TILEGRAD_PROGRAM=OFF)"] * 3)

    def test_the_command(self):
        """A wheel has it where it has the program."""
        backend = self.work / "stage.py"
        backend.write_text("import pathlib, sys; sys.path.insert(0, 'source/python')\n"
                           "import build_backend as backend\n"
                           "stage = pathlib.Path(sys.argv[1])\n"
                           "backend.write_metadata(stage, 'tag')\n"
                           "print(list(stage.glob('*.dist-info/entry_points.txt')) != [])\n")
        for name in ("alone", "whole"):
            (self.work / name / "tilegrad/bin").mkdir(parents=True)
        (self.work / "whole/tilegrad/bin/tilegrad").touch()
        self.assertEqual(self.run_python(backend, "alone"), "False\n")
        self.assertEqual(self.run_python(backend, "whole"), "True\n")


@long_test
@unittest.skipUnless(HAS_PIP, "python3-pip is not installed")
class LongPip(Workspace):
    def test_install_from_a_source_archive(self):
        """Everything that building needs is in the archive. The renderer alone, for one
        instruction set and hardly optimised, to save time."""
        self.run_python("-c", "import sys; sys.path.insert(0, 'source/python'); "
                        "import build_backend; build_backend.build_sdist('.')")
        archive, = self.work.glob("tilegrad-*.tar.gz")
        shutil.rmtree(self.source / "src")
        launcher = {"CMAKE_CXX_COMPILER_LAUNCHER": "ccache"} if shutil.which("ccache") else {}
        self.pip(archive, TILEGRAD_BUILD="", timeout=1500, **launcher,
                 TILEGRAD_CMAKE_ARGS="-DTILEGRAD_PROGRAM=OFF -DTILEGRAD_SIMD=scalar "
                                     "-DCMAKE_CXX_FLAGS_RELEASE=-O1")
        self.check()
        RendererAlone.check_alone(self, self.target)
        self.assertFalse((self.target / "bin/tilegrad").exists())


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
