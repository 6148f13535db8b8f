# SPDX-License-Identifier: Apache-2.0
"""tilegrad.torch: what it is given: lists of meshes, tensors of autocast, faces of int64."""

import unittest

import numpy as np

import tilegrad
from support import needs_torch, torch
from test_torch import PatchTest, rendered
from tilegrad import Camera, Texture

if torch:
    import tilegrad.torch as tg


@needs_torch
class Lists(unittest.TestCase):
    """Different meshes in one call."""

    def setUp(self):
        self.spheres = [tilegrad.icosphere(level, 0.5) for level in (1, 2, 0)]
        self.views = [Camera.orbit(angle, 20, 2, width=20, height=16) for angle in (0, 40, 80)]

    def check(self, options, own, shared):
        """One call of all meshes and a call each: the same images, and the same gradients."""
        leaves = [value for values in own.values() for value in values
                  if isinstance(value, torch.Tensor) and value.is_floating_point()]
        common = [value for value in shared.values() if isinstance(value, torch.Tensor)]
        for leaf in (*leaves, *common):
            leaf.requires_grad_()
        together = tg.render(**own, **shared, **options)
        apart = [tg.render(**{name: values[i] for name, values in own.items()}, **shared, **options)
                 for i in range(3)]
        weights = torch.rand(together.alpha.shape)
        gradients = []
        for color, alpha in ((together.color, together.alpha),
                             (torch.cat([one.color for one in apart]),
                              torch.cat([one.alpha for one in apart]))):
            self.assertTrue(torch.equal(color, together.color))
            self.assertTrue(torch.equal(alpha, together.alpha))
            loss = (color.sum(dim=1) * weights + alpha * weights).sum()
            gradients.append(torch.autograd.grad(loss, leaves + common))
        for one, other in zip(*gradients):
            torch.testing.assert_close(one, other, rtol=1e-5, atol=1e-6)
            self.assertGreater(float(one.abs().max()), 0)

    def test_are_the_same_as_one_call_each(self):
        own = {"positions": [torch.tensor(p) for p, _ in self.spheres],
               "faces": [f for _, f in self.spheres], "camera": self.views,
               "colors": [torch.tensor(0.5 + p) for p, _ in self.spheres]}
        options = {"width": 20, "height": 16, "delta": 1e-2}
        self.check(options, own, {})
        light = tg.lights(torch.tensor([[0.2, 0.5, 1.0]]))
        self.check(options, own, {"lights": light, "lighting": "lambert"})

    def test_batches_textures_and_what_all_share(self):
        own = {"positions": [torch.tensor(p) * torch.tensor([1, 0.8]).reshape(2, 1, 1)
                             for p, _ in self.spheres],
               "faces": [torch.tensor(f).long() for _, f in self.spheres],
               "uvs": [torch.tensor(0.5 + p[:, :2]) for p, _ in self.spheres]}
        view = torch.tensor(self.views[0].numbers, dtype=torch.float32)
        self.check({"width": 20, "height": 16, "delta": 1e-2}, own,
                   {"camera": view, "textures": torch.rand(4, 5, 3)})

    def test_textures_of_their_own(self):
        positions = [torch.tensor(p) for p, _ in self.spheres]
        texels = [torch.rand(4, 4 + i, 3, requires_grad=True) for i in range(3)]
        uvs = [torch.tensor(0.5 + p[:, :2]) for p, _ in self.spheres]
        faces = [f for _, f in self.spheres]
        images = tg.render(positions, faces, self.views[0], width=20, height=16, uvs=uvs,
                           textures=[Texture(t, "clamp") for t in texels])
        images.color[1].sum().backward()
        self.assertGreater(float(texels[1].grad.abs().max()), 0)
        for other in (texels[0], texels[2]):
            self.assertEqual(float(other.grad.abs().max()), 0)

    def test_errors(self):
        positions = [torch.tensor(p) for p, _ in self.spheres]
        faces = [f for _, f in self.spheres]
        size = {"width": 20, "height": 16}
        with self.assertRaisesRegex(ValueError, "render: faces is a list of 2, expected 3"):
            tg.render(positions, faces[:2], self.views[0], **size)
        with self.assertRaisesRegex(ValueError, r"render: scene 2: faces\[.*outside of \[0, 12\)"):
            tg.render(positions, faces[:2] + faces[:1], self.views[0], **size)
        with self.assertRaisesRegex(TypeError, "float64, expected float32"):
            tg.render([positions[0], positions[1].double()], faces[:2], self.views[0], **size)


@needs_torch
class Types(PatchTest):
    def test_in_autocast_it_is_float32(self):
        expected = rendered(self.given)
        gradient = self.gradient(expected.color.sum())
        turn = torch.tensor([1, 0.05, 0, 0.1, 1, 0.02])
        view = tg.camera(tg.rotation_6d(turn), (0, 0, -0.1), 9, 9.5, 4.4, 4.1)
        with torch.autocast("cpu", dtype=torch.bfloat16):
            images = rendered(self.given)
            self.assertTrue(torch.equal(self.gradient(images.color.sum()), gradient))
            turned = tg.camera(tg.rotation_6d(turn), (0, 0, -0.1), 9, 9.5, 4.4, 4.1)
            halves = {name: value.bfloat16() for name, value in self.given.items()
                      if isinstance(value, torch.Tensor) and value.is_floating_point()}
            texture = self.given["textures"]
            halves["textures"] = Texture(texture.texels.bfloat16(), texture.wrap, texture.filter)
            linear = torch.nn.Linear(3, 3)
            torch.nn.init.eye_(linear.weight)
            torch.nn.init.zeros_(linear.bias)
            moved = linear(self.positions)  # as a network's output: bfloat16
            self.assertEqual(moved.dtype, torch.bfloat16)
            half = rendered({**self.given, **halves, "positions": moved})
        self.assertTrue(torch.equal(images.color, expected.color))
        self.assertTrue(torch.equal(turned, view))
        self.assertEqual((half.color.dtype, half.alpha.dtype), (torch.float32,) * 2)
        same = rendered({**self.given, **{name: value.float() for name, value in halves.items()
                                          if name != "textures"},
                         "textures": Texture(texture.texels.bfloat16().float(), texture.wrap,
                                             texture.filter), "positions": moved.float()})
        self.assertTrue(torch.equal(half.color, same.color))
        half.alpha.sum().backward()
        self.assertGreater(float(linear.weight.grad.abs().max()), 0)

    def test_whole_faces_are_copied_once(self):
        for wide in (self.given["faces"].astype(np.int64), torch.tensor(self.given["faces"]).long()):
            given = {**self.given, "faces": wide}
            expected = rendered({**given, "faces": self.given["faces"]}).color
            tilegrad.reset_stats()
            for _ in range(300):
                images = rendered(given)
            self.assertEqual(tilegrad.stats()["copies"], 1)
            self.assertTrue(torch.equal(images.color, expected))
            wide[0] = wide[1]  # seen, although the array is the same
            changed = rendered(given)
            self.assertEqual(tilegrad.stats()["copies"], 2)
            self.assertFalse(torch.equal(changed.color, expected))
