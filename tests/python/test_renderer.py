# SPDX-License-Identifier: Apache-2.0
"""The renderer's images in their shapes, batches, scenes as records, and gradients. Memory and
errors: test_processes.py, test_errors.py."""

import pickle
import unittest

import numpy as np

from scenes import ALL, IMAGE, cotangents, patch
from tilegrad import Camera, Light, Renderer, Scene, Surface, Texture, files

H, W = IMAGE["height"], IMAGE["width"]


def images(frame):
    return {name: np.array(getattr(frame, name)) for name in (*frame.outputs, "face_ids")}


class Images(unittest.TestCase):
    def test_shapes_and_dtypes(self):
        for dtype in (np.float32, np.float64):
            frame = Renderer().render(patch(dtype, count=3), outputs=ALL, **IMAGE)
            self.assertEqual(len(frame), 3)
            channels = {"color": 3, "attributes": 2, "normals": 3, "uv": 2, "barycentrics": 2}
            for name in ALL:
                image = getattr(frame, name)
                lead = (3, channels[name]) if name in channels else (3,)
                self.assertEqual(image.shape, lead + (H, W), name)
                self.assertEqual(image.dtype, dtype)
                self.assertFalse(image.flags.writeable)
            self.assertEqual(frame.face_ids.shape, (3, H, W))
            self.assertEqual(frame.face_ids.dtype, np.int32)
            seen = frame.face_ids >= 0
            self.assertGreater(seen.sum(), 900)
            self.assertTrue(np.array_equal(seen, np.isfinite(frame.depth)))
            self.assertTrue(np.array_equal(seen, frame.alpha == 1))
            self.assertLessEqual(frame.alpha_error_bound, 1e-6)
            self.assertEqual(frame.dtype, dtype)

    def test_only_what_is_asked_for_is_there(self):
        scene = patch()
        frame = Renderer().render(scene, outputs="alpha", **IMAGE)
        self.assertEqual(frame.outputs, ("alpha",))
        with self.assertRaisesRegex(AttributeError, "depth was not rendered"):
            frame.depth
        self.assertEqual(frame.scenes, (scene,))

    def test_a_batch_is_its_images(self):
        """An array with a leading axis, a list of scenes, and scenes alone give the same bits."""
        renderer, count = Renderer(), 4
        batch = patch(count=count)
        alone = [batch.replace(positions=batch.positions[n], colors=batch["colors"][n],
                               camera=batch.camera[n], lights=Light.of_numbers(batch["lights"][n]),
                               textures=Texture(batch._arguments["textures"].texels[n], "clamp"))
                 for n in range(count)]
        together = images(renderer.render(batch, outputs=ALL, **IMAGE))
        listed = images(renderer.render(alone, outputs=ALL, **IMAGE))
        mixed = images(renderer.render([alone[0], batch], outputs=ALL, **IMAGE))
        for name, image in together.items():
            self.assertTrue(np.array_equal(image, listed[name]), name)
            self.assertTrue(np.array_equal(image, mixed[name][1:]), name)
            for n, scene in enumerate(alone):
                one = images(renderer.render(scene, outputs=ALL, **IMAGE))
                self.assertTrue(np.array_equal(image[n:n + 1], one[name]), name)

    def test_none_is_a_batch_too(self):
        frame = Renderer().render([], width=5, height=4)
        self.assertEqual(frame.color.shape, (0, 3, 4, 5))
        self.assertEqual(Renderer().backward(frame, alpha=np.zeros((0, 4, 5))), [])

    def test_options_reach_the_engine(self):
        renderer, scene = Renderer(), patch()
        base = images(renderer.render(scene, **IMAGE))
        flipped = scene.replace(faces=np.ascontiguousarray(scene.faces[:, ::-1]), per_corner=(),
                                uvs=np.zeros((16, 2), np.float32))
        self.assertEqual((renderer.render(flipped, culling="back", **IMAGE).face_ids >= 0).sum(), 0)
        for change in ({"delta": 1e-2}, {"interpolation": "screen_linear"},
                       {"alpha_rule": "paper", "paper_box": 0.5, "paper_faces": 1},
                       {"max_alpha_error": 0.2}):
            other = images(renderer.render(scene, **{**IMAGE, **change}))
            self.assertFalse(all(np.array_equal(base[name], other[name]) for name in base), change)
        self.assertTrue(np.isinf(renderer.render(scene, alpha_rule="paper").alpha_error_bound))

    def test_what_is_taken_away_is_not_per_corner(self):
        scene = patch()
        plain = scene.replace(uvs=None, textures=None, surfaces=None, face_surfaces=None)
        self.assertIsNone(plain["uvs"])
        self.assertIsNotNone(plain.replace(uvs=scene["uvs"], per_corner="uvs")["uvs"])
        image = files.MeshTexture("one", np.full((2, 2, 3), 255, np.uint8))
        mesh = files.Mesh(scene.positions, scene.faces, textures=[image],
                          corner_uvs=np.zeros((18, 3, 2), np.float32),
                          materials=[files.Material(texture=0)])
        camera = Camera()
        self.assertIsNotNone(mesh.scene(camera)["uvs"])
        plain = mesh.scene(camera, uvs=None, textures=None, surfaces=None, face_surfaces=None)
        self.assertIsNone(plain["uvs"])

    def test_textures(self):
        """Four texels, seen straight on: where they land, how they wrap."""
        positions = [(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1)]
        texels = np.arange(12, dtype=np.float32).reshape(2, 2, 3) / 12
        quad = Scene(positions, [(0, 1, 2), (0, 2, 3)], Camera(fx=2, fy=2, cx=2, cy=2),
                     uvs=[(0, 0), (1, 0), (1, 1), (0, 1)], textures=Texture(texels, "clamp",
                                                                            "nearest"))
        got = Renderer().render(quad, width=4, height=4).color[0].transpose(1, 2, 0)
        np.testing.assert_allclose(got, texels.repeat(2, 0).repeat(2, 1), atol=1e-6)
        shifted = quad.replace(uvs=[(1, 0), (2, 0), (2, 1), (1, 1)],
                               textures=Texture(texels, "repeat", "nearest"))
        again = Renderer().render(shifted, width=4, height=4).color[0].transpose(1, 2, 0)
        np.testing.assert_allclose(again, got, atol=1e-6)


class Scenes(unittest.TestCase):
    def test_pickle(self):
        scene = patch(count=2)
        again = pickle.loads(pickle.dumps(scene))
        renderer = Renderer()
        self.assertTrue(np.array_equal(renderer.render(scene, **IMAGE).color,
                                       renderer.render(again, **IMAGE).color))
        self.assertEqual(repr(again), "<tilegrad.Scene: 2 images, 16 vertices, 18 faces, float32>")

    def test_lists_of_records(self):
        """One Light of two, or two Lights; likewise surfaces."""
        scene = patch()
        two = [Light(d, i) for d, i in zip(scene._arguments["lights"].direction, (0.8, 0.3))]
        self.assertTrue(np.array_equal(scene.replace(lights=two)["lights"], scene["lights"]))
        each = scene._arguments["surfaces"]
        joined = Surface(ambient=[s.ambient for s in each], texture=[0, 0])
        got = Renderer().render([scene, scene.replace(surfaces=joined)], **IMAGE).color
        self.assertTrue(np.array_equal(got[0], got[1]))

    def test_surfaces_keep_their_textures(self):
        pair = Surface(base_color=np.ones((2, 3)), texture=[1, 0])
        self.assertEqual(pair.replace(shininess=3).textures(), [1, 0])
        self.assertEqual(pair.replace(texture=-1).textures(), [-1, -1])
        self.assertEqual([one.textures() for one in pair], [[1], [0]])
        self.assertEqual(pair[1:].textures(), [0])
        self.assertEqual(pair.replace(texture=1)[0].textures(), [1])
        self.assertEqual(Surface.of_numbers(pair.numbers).textures(), [-1, -1])
        self.assertIn("texture=[1, 0]", repr(pair))
        scene = patch(surfaces=pair, textures=[np.full((2, 2, 3), v, np.float32) for v in (1, 2)])
        for other in (list(pair), pair.replace(base_color=(1, 1, 1))):
            self.assertTrue(np.array_equal(
                Renderer().render(scene.replace(surfaces=other), **IMAGE).color,
                Renderer().render(scene, **IMAGE).color))

    def test_lists_of_numbers_are_float32(self):
        scene = Scene([[0, 0, -1], [1, 0, -1], [0, 1, -1]], [[0, 1, 2]], Camera())
        self.assertEqual(scene.dtype, np.float32)


# Gradients of scenes: shapes, sums, the arrays that they go to. Differences: test_torch.py.

class Gradients(unittest.TestCase):
    NAMES = ("positions", "camera", "colors", "uvs", "textures", "surfaces", "attributes")

    def names(self, lighting):
        extra = {"none": (), "spherical_harmonics": ("sh",)}.get(lighting, ("lights",))
        return self.NAMES + extra

    def test_shapes_are_those_of_the_scene(self):
        renderer = Renderer()
        for dtype in (np.float32, np.float64):
            for count in (None, 3):
                scene = patch(dtype, count=count)
                frame = renderer.render(scene, outputs=("color", "alpha", "attributes"), **IMAGE)
                got = renderer.backward(frame, wrt=self.names("phong"),
                                        **cotangents(frame, frame.outputs))
                for name in ("positions", "colors", "uvs", "attributes"):
                    self.assertEqual(getattr(got, name).shape, scene[name].shape, name)
                    self.assertEqual(getattr(got, name).dtype, dtype)
                self.assertEqual(got.camera.rotation.shape, scene.camera.rotation.shape)
                self.assertEqual(got.lights.direction.shape, scene["lights"].shape[:-1] + (3,))
                self.assertEqual(got.surfaces.base_color.shape, (2, 3))
                self.assertEqual(got.textures[0].shape[-3:], (4, 5, 3))
                self.assertEqual(set(got), set(self.names("phong")))

    def test_what_images_share_gets_the_sum(self):
        """In the order of images: the batch's sum is that of its parts."""
        renderer = Renderer()
        cameras = Camera(fx=30, fy=31, cx=[16.0, 17, 18], cy=14)
        scene = patch(np.float64, camera=cameras)
        frame = renderer.render(scene, **IMAGE)
        pulled = cotangents(frame)
        names = ("positions", "colors", "uvs", "textures", "surfaces", "lights")
        together = renderer.backward(frame, wrt=names, **pulled)
        parts = [scene.replace(camera=cameras[n]) for n in range(3)]
        frame = renderer.render(parts, **IMAGE)
        apart = renderer.backward(frame, wrt=names, **pulled)
        self.assertEqual(len(apart), 3)
        for name in names:
            values = [getattr(g, name) for g in (together, *apart)]
            values = [v[0] if name == "textures" else getattr(v, "numbers", v) for v in values]
            self.assertTrue(np.any(values[0] != 0), name)
            np.testing.assert_allclose(values[0], sum(values[1:]), rtol=1e-12, atol=1e-13)

    def test_out_is_overwritten_or_added_to(self):
        renderer = Renderer()
        scene = patch()
        frame = renderer.render(scene, **IMAGE)
        pulled = cotangents(frame)
        names = ("positions", "camera", "surfaces", "lights", "textures")
        first = renderer.backward(frame, wrt=names, **pulled)
        kept = {name: np.array(value) for name, value in self.arrays(first).items()}
        same = renderer.backward(frame, out=first, **pulled)
        for name, value in self.arrays(first).items():
            self.assertIs(self.arrays(same)[name], value)
            self.assertTrue(np.array_equal(value, kept[name]))
        renderer.backward(frame, out=first, accumulate=True, **pulled)
        for name, value in self.arrays(first).items():
            np.testing.assert_allclose(value, 2 * kept[name], rtol=1e-6)

    def test_wrt_may_be_one_name_with_out(self):
        renderer = Renderer()
        frame = renderer.render(patch(), **IMAGE)
        pulled = cotangents(frame)
        first = renderer.backward(frame, wrt="positions", **pulled)
        expected = np.array(first.positions)
        renderer.backward(frame, wrt="positions", out=first, **pulled)
        self.assertTrue(np.array_equal(first.positions, expected))
        with self.assertRaisesRegex(ValueError, "wrt is .'camera',"):
            renderer.backward(frame, wrt="camera", out=first, **pulled)

    @staticmethod
    def arrays(gradients):
        return {name: value[0] if name == "textures" else value
                for name, value in gradients._arrays.items()}

    def test_default_is_positions(self):
        renderer = Renderer()
        frame = renderer.render(patch(), **IMAGE)
        got = renderer.backward(frame, alpha=np.ones_like(frame.alpha))
        self.assertEqual(list(got), ["positions"])
        with self.assertRaisesRegex(AttributeError, "colors was not requested"):
            got.colors
        self.assertEqual(renderer.backward(frame, alpha=frame.alpha, wrt="uvs").uvs.shape,
                         (18, 3, 2))

    def test_surfaces_without_any(self):
        """The default surface has gradients, too."""
        renderer = Renderer()
        scene = patch(surfaces=None, face_surfaces=None)
        frame = renderer.render(scene, **IMAGE)
        got = renderer.backward(frame, color=np.ones_like(frame.color), wrt="surfaces").surfaces
        self.assertEqual(got.base_color.shape, (1, 3))
        self.assertTrue((got.base_color > 1).all())
