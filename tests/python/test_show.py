# SPDX-License-Identifier: Apache-2.0
"""Pictures in one call, their framing, and meshes of other libraries."""

import ast
import importlib
import inspect
import pathlib
import pkgutil
import tempfile
import types
import unittest

import numpy as np

import tilegrad
from tilegrad import images, meshes

POSITIONS, FACES = tilegrad.icosphere(2, 0.5)
LONG = POSITIONS * np.array([1, 0.2, 0.5], np.float32)


def decoded(png):
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "a.png"
        path.write_bytes(png)
        return images.load_image(path)


class Framing(unittest.TestCase):
    def test_the_object_touches_the_margin_at_any_size_and_place(self):
        for scale, shift in ((1, 0), (1e-4, 3e-4), (1e4, 2e4), (1e-13, 0)):
            points = LONG * np.float32(scale) + np.float32(shift)
            frame = tilegrad.render((points, FACES), azimuth=[0, 90, 60], elevation=[0, 0, 40],
                                    width=300, height=200)
            for drawn in frame.face_ids >= 0:
                rows, columns = np.nonzero(drawn)
                gaps = (rows.min() - 10, 189 - rows.max(), columns.min() - 15, 284 - columns.max())
                self.assertGreaterEqual(min(gaps), -1)
                self.assertLessEqual(min(gaps), 3)

    def test_points_alone(self):
        camera = tilegrad.Camera.framing(POSITIONS, width=64, height=64)
        same = tilegrad.Camera.framing((POSITIONS, FACES), width=64, height=64)
        np.testing.assert_array_equal(camera.numbers, same.numbers)

    def test_errors(self):
        for mesh, message in ((np.zeros((0, 3)), "no faces"),
                              (np.full((3, 3), np.nan), "not finite")):
            self.assertRaisesRegex(ValueError, message, tilegrad.Camera.framing, mesh)
        with self.assertRaisesRegex(ValueError, "margin is 0.5"):
            tilegrad.Camera.framing(POSITIONS, margin=0.5)


class Pictures(unittest.TestCase):
    def test_save_and_notebook_show_the_same(self):
        frame = tilegrad.render((POSITIONS, FACES), width=48, height=32)
        with tempfile.TemporaryDirectory() as folder:
            frame.save(pathlib.Path(folder) / "a.png")
            saved = images.load_image(pathlib.Path(folder) / "a.png")
        np.testing.assert_array_equal(saved, frame.picture())
        np.testing.assert_array_equal(saved, decoded(frame._repr_png_()))
        drawn = frame.face_ids[0] >= 0
        self.assertTrue((saved[drawn][:, 3] == 255).all())
        self.assertGreater(saved[drawn][:, :3].min(), 15)  # lit from more than one side
        # No dark seam where alpha fades.
        fading = (saved[..., 3] > 60) & ~drawn
        self.assertTrue(fading.any())
        self.assertGreater(saved[fading][:, :3].min(), 15)

    def test_a_background_fills(self):
        frame = tilegrad.render((POSITIONS, FACES), width=32, height=32, background=(1, 0, 0))
        np.testing.assert_array_equal(frame.picture()[0, 0], [255, 0, 0, 255])

    def test_several_stand_side_by_side(self):
        frame = tilegrad.render((POSITIONS, FACES), azimuth=[0, 90], width=32, height=24)
        self.assertEqual(decoded(frame._repr_png_()).shape, (24, 64, 4))

    def test_gradients_flow(self):
        frame = tilegrad.render((POSITIONS, FACES), width=32, height=32, delta=1e-3)
        gradients = tilegrad.Renderer().backward(frame, alpha=np.ones_like(frame.alpha))
        self.assertTrue((gradients.positions != 0).any())


class Others(unittest.TestCase):
    """Objects with the members that trimesh and Open3D have; neither is imported."""

    def test_trimesh(self):
        colors = np.full((len(POSITIONS), 4), 128, np.uint8)
        visual = types.SimpleNamespace(vertex_colors=colors, uv=None)
        mesh = meshes.as_mesh(types.SimpleNamespace(
            vertices=POSITIONS.astype(np.float64), faces=FACES.astype(np.int64), visual=visual,
            vertex_normals=POSITIONS * 2))
        np.testing.assert_array_equal(mesh.positions, POSITIONS)
        np.testing.assert_allclose(mesh.colors, 128 / 255)
        made = mesh.to_trimesh(types.SimpleNamespace(Trimesh=lambda **given: given))
        np.testing.assert_array_equal(made["faces"], FACES)
        self.assertEqual(made["vertex_colors"].shape, (len(POSITIONS), 4))

    def test_trimesh_with_a_texture(self):
        image = np.zeros((4, 4, 3), np.uint8)
        image[...] = (0, 255, 0)
        visual = types.SimpleNamespace(uv=np.full((len(POSITIONS), 2), 0.5),
                                       material=types.SimpleNamespace(image=image))
        mesh = types.SimpleNamespace(vertices=POSITIONS, faces=FACES, visual=visual)
        frame = tilegrad.render(mesh, width=32, height=32, lighting="none", lights=None)
        np.testing.assert_allclose(frame.color[0, :, 16, 16], [0, 1, 0], atol=1e-6)

    def test_open3d(self):
        given = types.SimpleNamespace(vertices=POSITIONS, triangles=FACES,
                                      vertex_colors=np.zeros((0, 3)), vertex_normals=[])
        mesh = meshes.as_mesh(given)
        self.assertIsNone(mesh.colors)
        mesh.colors = np.ones((len(POSITIONS), 4), np.float32)
        open3d = types.SimpleNamespace(
            utility=types.SimpleNamespace(Vector3dVector=np.asarray, Vector3iVector=np.asarray),
            geometry=types.SimpleNamespace(
                TriangleMesh=lambda v, t: types.SimpleNamespace(vertices=v, triangles=t)))
        back = meshes.as_mesh(mesh.to_open3d(open3d))
        np.testing.assert_array_equal(back.positions, POSITIONS)
        self.assertEqual(back.colors.shape, (len(POSITIONS), 3))

    def test_what_is_no_mesh(self):
        self.assertRaisesRegex(TypeError, "got int, expected a Mesh", tilegrad.render, 3)
        self.assertRaisesRegex(ValueError, r"faces has shape \(1, 4\), expected \(F, 3\)",
                               meshes.as_mesh, (POSITIONS, [[0, 1, 2, 3]]))
        self.assertRaisesRegex(TypeError, "save_mesh: mesh is NoneType", meshes.save_mesh, "a.glb",
                               None)
        self.assertRaises(OSError, tilegrad.render, "none.glb")

    def test_arrays_that_would_change(self):
        exact = POSITIONS.astype(np.float64)
        for positions, faces, error, message in (
                (POSITIONS, FACES.astype(np.int64) + 2**32, ValueError, "faces.*int32's range"),
                (POSITIONS * 1j, FACES, TypeError, "positions has dtype complex64"),
                (POSITIONS.astype(str), FACES, TypeError, "positions has dtype <U"),
                (POSITIONS.astype(object), FACES, TypeError, "positions has dtype object"),
                (POSITIONS > 0, FACES, TypeError, "positions has dtype bool"),
                (np.ma.masked_less(POSITIONS, 0), FACES, TypeError, "positions is a masked array"),
                (exact + 4.6e6, FACES, ValueError, "positions are up to .*from the origin")):
            self.assertRaisesRegex(error, "as_mesh: " + message, meshes.as_mesh, (positions, faces))
        near = meshes.as_mesh((exact + 100, FACES))
        np.testing.assert_allclose(near.positions, exact + 100, rtol=1e-7)


# What the package shows: every public name is documented; and its modules import each other in one
# direction.

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
