# SPDX-License-Identifier: Apache-2.0
"""What was asked for and is not there: images of a scene without the parts for them are background,
whatever the frame's memory was used for before; gradients of them, and of no images, are 0."""

import unittest

import numpy as np

from scenes import ALL, IMAGE, LIGHTINGS, patch
from support import needs_torch, torch
from tilegrad import Camera, Light, Renderer

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
