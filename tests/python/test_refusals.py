# SPDX-License-Identifier: Apache-2.0
"""What is refused before it is lost or fills the memory, and with which exception."""

import os
import unittest
from unittest import mock

import numpy as np

import tilegrad
from file_samples import FolderTest, textured_mesh
from scenes import ALL, IMAGE, LIGHTINGS, patch
from support import needs_torch, torch
from tilegrad import Camera, Light, Renderer, Scene, Surface, files

TRIANGLE = dict(positions=np.array([[-9, -9, 0], [9, -9, 0], [0, 9, 0]], np.float32),
                faces=np.array([[0, 1, 2]], np.int32),
                camera=tilegrad.Camera(translation=(0, 0, -3), fx=16, fy=16, cx=8, cy=8))


def render(**parts):
    return Renderer(threads=1).render(Scene(**TRIANGLE, **parts), width=16, height=16)


class Numbers(FolderTest):
    def test_materials_that_are_not_finite(self) -> None:
        for bad in (np.nan, np.inf, -np.inf, 3e38):
            mesh = textured_mesh()
            mesh.materials[1].base_color = (0, bad, 1, 1)
            with self.assertRaisesRegex(ValueError, "blue.*base_color"):
                files.save_mesh(self.folder / "a.glb", mesh)
            self.assertFalse((self.folder / "a.glb").exists())
        mesh.materials[1].base_color = (0, np.nan, 1, 1)
        self.assertRaisesRegex(ValueError, "blue.*base_color", mesh.scene, TRIANGLE["camera"])

    def test_places_that_are_not_finite(self) -> None:
        mesh = textured_mesh()
        for origin, error in (([np.nan, 0, 0], ValueError), (None, TypeError)):
            mesh.origin = origin
            self.assertRaisesRegex(error, "save_mesh: origin", mesh.save, self.folder / "a.glb")
        for bad in (np.nan, np.inf):
            self.assertRaisesRegex(ValueError, "rvec", files.rotation_from_vector, (bad, 0, 0))

    def test_materials_that_are_none(self) -> None:
        mesh = textured_mesh()
        mesh.materials = None
        self.assertRaisesRegex(TypeError, "save_mesh: materials is None", mesh.save,
                               self.folder / "a.glb")

    def test_what_the_lighting_does_not_use(self) -> None:
        nan = np.nan
        for parts, name in (({"lights": [Light(intensity=nan)]}, "lights"),
                            ({"lights": [Light(direction=(nan, 0, 1))]}, "lights"),
                            ({"sh": np.full(9, nan, np.float32)}, "sh"),
                            ({"light_directions": np.full((3, 3), nan, np.float32)},
                             "light_directions")):
            with self.assertRaisesRegex(ValueError, f"scene 0: {name}.*nan"):
                render(colors=np.ones((3, 3), np.float32), **parts)
        with self.assertRaisesRegex(ValueError, "surfaces.*diffuse.*nan"):
            render(colors=np.ones((3, 3), np.float32), surfaces=[Surface(diffuse=(nan, 0, 0))])

    def test_images_beyond_float(self) -> None:
        large = np.full((3, 3), 1e30, np.float32)
        self.assertAlmostEqual(render(colors=large).color.max() / 1e30, 1, 5)
        for parts in ({"surfaces": [Surface(base_color=(1e30, 1, 1))]},
                      {"lighting": "spherical_harmonics", "sh": np.full(9, 1e30, np.float32)}):
            with self.assertRaisesRegex(ValueError, "the image overflows.*color"):
                render(colors=large, **parts)


class Names(FolderTest):
    def test_files_that_cannot_hold_them(self) -> None:
        one = np.ones(2, np.float32)
        for name in ("a\0b", "\0", "../a", "a\\b"):
            with self.assertRaisesRegex(ValueError, "cannot be the name"):
                files.save_weights(self.folder / "a.npz", {name: one, "a": one})
        for name in ("n" * 65532, "\u00e4" * 33000):  # 16 bits hold the bytes of a name and ".npy"
            with self.assertRaisesRegex(ValueError, "a.npz: .*65531 bytes at most"):
                files.save_weights(self.folder / "a.npz", {name: one})
        with self.assertRaisesRegex(ValueError, "a.npz: no array"):
            files.save_weights(self.folder / "a.npz", {})
        plane = np.ones((2, 2), np.float32)
        for names in (("R\0a", "R\0b"), ("n" * 256, "n" * 257)):
            with self.assertRaisesRegex(ValueError, "EXR channel name"):
                files.save_layers(self.folder / "a.exr", dict.fromkeys(names, plane))
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_half_of_a_character(self) -> None:
        """A lone surrogate, which UTF-8 cannot hold."""
        one, plane, bad = np.ones(2, np.float32), np.ones((2, 2), np.float32), "a\ud800"
        mesh = textured_mesh()
        mesh.textures[0].name = bad
        view = files.View(bad, TRIANGLE["camera"], 5, 5)
        for call in (lambda: files.save_weights(self.folder / "a.npz", {bad: one}),
                     lambda: files.save_weights(self.folder / "a.safetensors", {bad: one}),
                     lambda: files.save_weights(self.folder / "a.safetensors", {"a": one},
                                                {"b": bad}),
                     lambda: files.save_layers(self.folder / "a.exr", {bad: plane}),
                     lambda: files.save_mesh(self.folder / "a.glb", mesh),
                     lambda: files.save_cameras(self.folder / "a.json", [view])):
            self.assertRaisesRegex(ValueError, r"^save_\w+: .*'a\\ud800' has an unpaired surrogate", call)
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_names_that_no_file_has(self) -> None:
        one = np.ones((2, 2), np.float32)
        for stem in ("a\ud800", "a\0"):
            for call in (lambda: files.load_mesh(stem + ".glb"),
                         lambda: files.load_image(stem + ".png"),
                         lambda: files.load_weights(stem + ".npz"),
                         lambda: files.load_cameras(stem), lambda: files.load_checkpoint(stem),
                         lambda: files.Dataset(stem), lambda: files.Predictor(stem),
                         lambda: files.save_mesh(stem + ".glb", textured_mesh()),
                         lambda: files.save_image(stem + ".npy", one),
                         lambda: files.save_weights(stem + ".npz", {"a": one}),
                         lambda: files.save_cameras(stem, [])):
                self.assertRaisesRegex(ValueError, "cannot be the name of a file", call)
        files.save_image(os.fsencode(self.folder / "a.npy"), one)
        np.testing.assert_array_equal(files.load_image(self.folder / "a.npy"), one)

    def test_cameras_that_could_not_be_read(self) -> None:
        camera = TRIANGLE["camera"]
        for format in ("opencv", "nerf", "colmap"):
            path = self.folder / format
            for views in ([], [files.View("a", camera, 0, 5)], [files.View("a", camera, 5, -1)]):
                self.assertRaises(ValueError, files.save_cameras, path, views, format=format)
            self.assertFalse(path.exists())
        with self.assertRaisesRegex(ValueError, "line break"):
            files.save_cameras(path, [files.View("a\nb", camera, 5, 5)], format="colmap")


class Arguments(FolderTest):
    def test_of_files(self) -> None:
        plane = np.ones((2, 2), np.float32)
        for error, message, call in (
                (TypeError, "planar must be bool, got 'no'",
                 lambda: files.save_image("a.png", plane, planar="no")),
                (ValueError, "a.png' must end in .exr",
                 lambda: files.save_layers("a.png", {"R": plane})),
                (TypeError, "width must be int", lambda: files.load_cameras("a", width="a")),
                (ValueError, "height is -1", lambda: files.load_cameras("a", height=-1)),
                (ValueError, "below 2", lambda: files.load_image("a.png", max_bytes=2**63)),
                (TypeError, "weights must be a mapping", lambda: files.save_weights("a.npz", [1]))):
            self.assertRaisesRegex(error, message, call)


class Memory(FolderTest):
    def setUp(self) -> None:
        super().setUp()
        mesh = textured_mesh()
        mesh.textures[0].image = np.zeros((1024, 1024, 3), np.uint8)  # 3 MB of a small file
        files.save_mesh(self.folder / "a.glb", mesh)
        files.save_image(self.folder / "a.png", mesh.textures[0].image)
        files.save_weights(self.folder / "a.npz", {"a": np.zeros(1 << 20, np.float32)})
        files.save_weights(self.folder / "a.safetensors", {"a": np.zeros(1 << 20, np.float32)})
        files.save_layers(self.folder / "a.exr", {"R": np.zeros((512, 512), np.float32),
                                                  "G": np.zeros((512, 512), np.float32),
                                                  "B": np.zeros((512, 512), np.float32)})
        self.loads = ((files.load_mesh, "a.glb"), (files.load_image, "a.png"),
                      (files.load_image, "a.exr"), (files.load_weights, "a.npz"),
                      (files.load_weights, "a.safetensors"), (files.load_layers, "a.exr"))

    def test_a_limit_of_the_call(self) -> None:
        for load, name in self.loads:
            load(self.folder / name, max_bytes=20 << 20)
            load(self.folder / name, max_bytes=None)
            refused = f"{name}.*max_bytes.*LIMIT"
            with self.assertRaisesRegex((OSError, ValueError, MemoryError), refused):
                load(self.folder / name, max_bytes=1 << 20)
            with self.assertRaises(MemoryError) as not_even_read:
                load(self.folder / name, max_bytes=1)
            self.assertEqual(str(not_even_read.exception).count(name), 1)
            with self.assertRaisesRegex(ValueError, "max_bytes is 0"):
                load(self.folder / name, max_bytes=0)
            with self.assertRaisesRegex(TypeError, "max_bytes must be int or None"):
                load(self.folder / name, max_bytes="1G")

    def test_a_limit_of_the_environment(self) -> None:
        for load, name in self.loads:
            if name.endswith(".safetensors"):
                continue  # becomes no more than the file is
            with mock.patch.dict(os.environ, {"TILEGRAD_READ_LIMIT": "1M"}):
                with self.assertRaisesRegex((OSError, ValueError, MemoryError), f"{name}.*LIMIT"):
                    load(self.folder / name)
                load(self.folder / name, max_bytes=20 << 20)
            with mock.patch.dict(os.environ, {"TILEGRAD_READ_LIMIT": "many"}):
                self.assertRaisesRegex(ValueError, "LIMIT: \"many\"", load, self.folder / name)


@needs_torch
class Tensors(FolderTest):
    def test_odd_ones_are_type_errors_wherever_they_go(self) -> None:
        plain = torch.ones(3, 3)
        self.write(plain)
        odd = (plain.clone().requires_grad_(), torch.nn.Parameter(plain),
               torch.view_as_complex(torch.ones(3, 3, 2)).conj(), plain.to_sparse(),
               torch.empty(3, 3, device="meta"), plain.to(torch.bfloat16),
               torch.nested.nested_tensor([plain[0], plain[1]]),
               torch.quantize_per_tensor(plain, 0.1, 0, torch.qint8))
        for value in odd:
            for name in ("a.png", "a.exr", "a.npy", "a.npz", "a.safetensors"):
                with self.subTest(kind=str(value.dtype), name=name):
                    self.assertRaises(TypeError, self.write, value, name)

    def test_signs_that_torch_keeps_apart(self) -> None:
        lazy = torch.view_as_complex(torch.ones(3, 3, 2)).conj().imag
        self.assertTrue(lazy.is_neg())
        files.save_weights(self.folder / "a.npz", {"a": lazy})
        np.testing.assert_array_equal(files.load_weights(self.folder / "a.npz")["a"], -1)
        scene = Scene(lazy, TRIANGLE["faces"], TRIANGLE["camera"])
        np.testing.assert_array_equal(scene.positions, -1)

    def write(self, value, name: str = "") -> None:
        """To the file `name`, or to one of every kind."""
        for ending in ("png", "exr", "npy", "npz", "safetensors") if not name else (name[2:],):
            path = self.folder / f"a.{ending}"
            if ending in ("npz", "safetensors"):
                files.save_weights(path, {"a": value})
            else:
                files.save_image(path, value)


# What was asked for and is not there: images of a scene without the parts for them are background,
# whatever the frame's memory was used for before; gradients of them, and of no images, are 0.

if torch:
    import tilegrad.torch

SMALL = {"width": 5, "height": 4}
BARE = {"uvs": None, "per_corner": (), "textures": None, "surfaces": None, "face_surfaces": None}


class NoImages(unittest.TestCase):
    WRT = ("positions", "camera", "colors", "uvs", "textures", "surfaces", "attributes")

    def scene(self, dtype, lighting):
        scene = patch(dtype, lighting, camera=Camera(translation=np.zeros((0, 3))))
        if lighting in ("none", "spherical_harmonics"):
            return scene
        return scene.replace(lights=Light((0, 0, 1)))

    def test_images_have_the_shapes_of_none(self):
        for dtype in (np.float32, np.float64):
            for lighting in LIGHTINGS:
                frame = Renderer(threads=1).render(self.scene(dtype, lighting), outputs=ALL, **SMALL)
                shapes = {name: getattr(frame, name).shape for name in ALL}
                self.assertEqual(shapes, {
                    "color": (0, 3, 4, 5), "alpha": (0, 4, 5), "attributes": (0, 2, 4, 5),
                    "depth": (0, 4, 5), "normals": (0, 3, 4, 5), "uv": (0, 2, 4, 5),
                    "barycentrics": (0, 2, 4, 5)})
                self.assertEqual(frame.face_ids.shape, (0, 4, 5))

    def gradients(self, dtype, lighting, out=None, **arguments):
        renderer = Renderer(threads=1)
        frame = renderer.render(self.scene(dtype, lighting), outputs=ALL, **SMALL)
        extra = {"none": (), "spherical_harmonics": ("sh",)}.get(lighting, ("lights",))
        return renderer.backward(frame, color=frame.color, alpha=frame.alpha, out=out,
                                 wrt=self.WRT + extra, **arguments)

    @staticmethod
    def arrays(gradients):
        for name in gradients:
            yield from ([*gradients._arrays[name]] if name == "textures"
                        else [gradients._arrays[name]])

    def test_gradients_of_what_they_share_are_zero(self):
        for dtype in (np.float32, np.float64):
            for lighting in LIGHTINGS:
                found = self.gradients(dtype, lighting)
                for array in self.arrays(found):
                    array[:] = 7
                found = self.gradients(dtype, lighting, out=found)
                self.assertEqual(found.positions.shape, (16, 3))
                self.assertFalse(any(array.any() for array in self.arrays(found)))

    def test_what_is_added_to_stays(self):
        found = self.gradients(np.float32, "phong")
        for array in self.arrays(found):
            array[:] = 7
        found = self.gradients(np.float32, "phong", out=found, accumulate=True)
        self.assertTrue(all((array == 7).all() for array in self.arrays(found)))

    def test_beside_scenes_with_images(self):
        renderer = Renderer(threads=1)
        none, some = self.scene(np.float32, "phong"), patch()
        frame = renderer.render([none, some], outputs=ALL, **IMAGE)
        self.assertEqual(frame.attributes.shape, (1, 2, 29, 34))
        found = renderer.backward(frame, color=np.ones_like(frame.color), wrt=("positions",))
        self.assertFalse(found[0].positions.any())
        self.assertTrue(found[1].positions.any())


@needs_torch
class InTorch(unittest.TestCase):
    def test_no_images(self):
        positions = torch.tensor(patch().positions, requires_grad=True)
        images = tilegrad.torch.render(
            positions, patch().faces, Camera(translation=np.zeros((0, 3))), width=200, height=150,
            outputs=("color", "alpha", "attributes"), attributes=np.ones((16, 5), np.float32))
        self.assertEqual(tuple(images.attributes.shape), (0, 5, 150, 200))
        (images.color.sum() + images.alpha.sum()).backward()
        self.assertFalse(positions.grad.any())
