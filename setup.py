# SPDX-License-Identifier: Apache-2.0
"""Lets CMake build and install the package where setuptools wants it. In the environment:

TILEGRAD_CMAKE_ARGS     more arguments for CMake, "-DTILEGRAD_PROGRAM=OFF" for the renderer alone
TILEGRAD_BUILD          an existing build tree to use instead of one of its own
"""

import os
import pathlib
import re
import shlex
import subprocess
import sys

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

SOURCE = pathlib.Path(__file__).parent.resolve()


def version():
    """As the C++ library has it."""
    header = (SOURCE / "include/tilegrad/version.h").read_text()
    return re.search(r'#define TILEGRAD_VERSION "([^"]+)"', header).group(1)


class CMakeBuild(build_ext):
    """The whole package by one run of CMake: extension modules and Python files."""

    def build_extension(self, ext):
        build = pathlib.Path(os.environ.get("TILEGRAD_BUILD") or self.build_temp).resolve()
        if not (build / "CMakeCache.txt").exists():
            self.cmake("-S", SOURCE, "-B", build, "-DCMAKE_BUILD_TYPE=Release",
                       "-DTILEGRAD_TESTS=OFF", "-DTILEGRAD_BENCH=OFF",
                       f"-DPython_EXECUTABLE={sys.executable}",
                       *shlex.split(os.environ.get("TILEGRAD_CMAKE_ARGS", "")))
        self.cmake("--build", build, "--parallel", self.parallel or os.cpu_count(),
                   "--target", "tilegrad_python")
        self.cmake(f"-DBUILD={build}", f"-DTO={pathlib.Path(self.build_lib).resolve()}",
                   "-P", SOURCE / "python/install_into.cmake")

    def get_outputs(self):
        return [str(path) for path in pathlib.Path(self.build_lib).rglob("*") if path.is_file()]

    @staticmethod
    def cmake(*arguments):
        subprocess.run(["cmake", *map(str, arguments)], check=True)


setup(version=version(), ext_modules=[Extension("tilegrad._core", [])],
      cmdclass={"build_ext": CMakeBuild})
