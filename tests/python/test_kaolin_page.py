# SPDX-License-Identifier: Apache-2.0
"""docs/porting.md's table of Kaolin's names against the modules: what it lists is there, what it
leaves out is not, and what it calls missing says so."""

import importlib
import importlib.util
import pkgutil
import re
import types
import unittest

from support import SOURCE

try:
    import torch
except ImportError:
    torch = None

ROOT = "tilegrad.compat.kaolin"
HEADER = "| module | available | not available |"


def rows():
    """(module, available names, missing names) of the table."""
    page = (SOURCE / "docs" / "porting.md").read_text()
    table = page.split(HEADER)[1].split("\n\n")[0].strip().splitlines()[1:]
    for line in table:
        name, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        yield (re.search(r"`kal\.([\w.]+)`", name)[1],
               *(re.findall(r"`(\w+)`", cell) for cell in cells))


def public_names(module):
    """What a module offers: __all__, or what it defines itself."""
    if hasattr(module, "__all__"):
        return set(module.__all__)
    return {name for name, value in vars(module).items()
            if not name.startswith("_") and isinstance(value, (types.FunctionType, type))
            and value.__module__ == module.__name__}


def modules(package=ROOT):
    """All public modules below the package, from its files."""
    found = []
    for place in importlib.util.find_spec(package).submodule_search_locations or ():
        for info in pkgutil.iter_modules([place]):
            if not info.name.startswith("_"):
                found += [f"{package}.{info.name}"] + modules(f"{package}.{info.name}") * info.ispkg
    return found


@unittest.skipIf(torch is None, "torch is absent (Debian: python3-torch)")
class PortingPage(unittest.TestCase):
    def setUp(self):
        if importlib.util.find_spec("tilegrad._tools") is None:
            raise unittest.SkipTest("a build without files")
        self.rows = list(rows())

    def test_the_table_is_read(self):
        self.assertGreater(len(self.rows), 15)
        self.assertGreater(sum(len(there) for _, there, _ in self.rows), 60)
        self.assertEqual(len({name for name, _, _ in self.rows}), len(self.rows))

    def test_available_names_are_there_and_no_others(self):
        for name, there, _ in self.rows:
            with self.subTest(module=name):
                module = importlib.import_module(f"{ROOT}.{name}")
                for attribute in there:
                    self.assertTrue(hasattr(module, attribute), attribute)
                self.assertEqual(public_names(module), set(there))

    def test_missing_names_point_to_the_page(self):
        for name, _, missing in self.rows:
            module = importlib.import_module(f"{ROOT}.{name}")
            for attribute in missing:
                with self.subTest(name=f"{name}.{attribute}"), \
                        self.assertRaisesRegex(AttributeError, "docs/porting.md"):
                    getattr(module, attribute)

    def test_every_module_with_names_has_a_row(self):
        listed = {f"{ROOT}.{name}" for name, _, _ in self.rows}
        below = {"rasterization", "dibr", "utils"}  # files of render.mesh
        for name in modules():
            with self.subTest(module=name):
                parent, last = name.rsplit(".", 1)
                self.assertTrue(name in listed
                                or last in below and parent == f"{ROOT}.render.mesh")


if __name__ == "__main__":
    unittest.main()
