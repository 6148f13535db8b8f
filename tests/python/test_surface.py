# SPDX-License-Identifier: Apache-2.0
"""What the package shows: every public name is documented; and its modules import each other in one
direction."""

import ast
import importlib
import inspect
import pathlib
import pkgutil
import unittest

import tilegrad

PACKAGE = pathlib.Path(tilegrad.__file__).parent


def public_modules():
    """Modules that can be imported here; those that need torch, or _tools, which a build of the
    renderer alone leaves out, only where it is."""
    for info in pkgutil.walk_packages([str(PACKAGE)], "tilegrad."):
        if info.name.rpartition(".")[2].startswith("_"):
            continue
        try:
            yield importlib.import_module(info.name)
        except ImportError as error:
            if error.name != "torch" and "_tools" not in str(error):
                raise


def extension(name):
    """An extension module; None for _tools where the build left it out."""
    if name == "_tools" and not any(PACKAGE.glob("_tools*.so")):
        return None
    return importlib.import_module(f"tilegrad.{name}")


class Types(unittest.TestCase):
    def test_the_package_is_typed(self):
        self.assertTrue((PACKAGE / "py.typed").exists())


class Docstrings(unittest.TestCase):
    def documented(self, value, name):
        self.assertTrue(inspect.getdoc(value), f"{name} has no docstring")

    def test_every_public_name_has_one(self):
        seen = 0
        for module in [tilegrad, *public_modules()]:
            self.documented(module, module.__name__)
            for name in getattr(module, "__all__", []):
                value = getattr(module, name)
                if not callable(value):
                    continue
                seen += 1
                self.documented(value, f"{module.__name__}.{name}")
                for member in self.members(value):
                    self.documented(getattr(value, member), f"{name}.{member}")
        self.assertGreater(seen, 10)

    @staticmethod
    def members(value):
        """Methods, properties and parts that a class of the package has itself or inherits."""
        if not inspect.isclass(value):
            return []
        own = [vars(base) for base in value.__mro__ if base.__module__.startswith("tilegrad")]
        fields = getattr(value, "__dataclass_fields__", ())  # documented with their class
        return sorted({name for names in own for name in names if not name.startswith("_")
                       and name not in fields and not isinstance(names[name], type(Slotted.slot))})

    def test_extension_modules(self):
        for name in ("_core", "_tools"):
            module = extension(name)
            if module is None:
                continue
            self.documented(module, name)
            for key, value in vars(module).items():
                if not key.startswith("_") and callable(value):
                    self.documented(value, f"{name}.{key}")

    def test_all_lists_what_there_is(self):
        """Nothing public is imported into the package but left out of __all__."""
        for name, value in vars(tilegrad).items():
            if name.startswith("_") or inspect.ismodule(value):
                continue
            self.assertIn(name, tilegrad.__all__)


class Slotted:
    """Its slot is of the type of those that are no part of an interface."""

    __slots__ = ("slot",)


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
