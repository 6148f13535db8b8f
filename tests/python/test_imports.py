# SPDX-License-Identifier: Apache-2.0
"""Modules of the package import each other in one direction."""

import ast
import pathlib
import unittest

import tilegrad

PACKAGE = pathlib.Path(tilegrad.__file__).parent


def imported(path):
    """The modules of the package's own folder that a file imports, anywhere in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module == "tilegrad":
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and str(node.module).startswith("tilegrad."):
            names.add(node.module.split(".")[1])
    return {name for name in names if (PACKAGE / f"{name}.py").exists()}


class Directions(unittest.TestCase):
    def test_there_is_no_circle(self):
        """Whoever imports nothing that is left is taken away, until all are."""
        left = {path.stem: imported(path) for path in PACKAGE.glob("*.py")}
        self.assertGreater(len(left), 20)
        while left:
            free = {name for name, needs in left.items() if not needs & set(left)}
            self.assertTrue(free, f"a circle: {left}")
            left = {name: needs for name, needs in left.items() if name not in free}


if __name__ == "__main__":
    unittest.main()
