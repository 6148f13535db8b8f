# SPDX-License-Identifier: Apache-2.0
"""Gradients of scenes: shapes, sums, the arrays that they go to. Differences: test_torch.py."""

import unittest

import numpy as np

from scenes import IMAGE, cotangents, patch
from tilegrad import Camera, Renderer


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
