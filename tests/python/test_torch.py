# SPDX-License-Identifier: Apache-2.0
"""tilegrad.torch: gradients against differences, graphs, memory, workers."""

import copy
import math
import pickle
import unittest
from unittest import mock

import numpy as np

import tilegrad
from scenes import patch
from support import needs_torch, torch
from tilegrad import Camera, Light, Surface, Texture

if torch:
    import tilegrad.torch as tg

SIZE = {"width": 9, "height": 8, "delta": 4e-3}

def arguments(dtype=np.float64, **changes):
    """A warped patch of 18 faces with everything that a scene may have, in arrays."""
    scene = patch(dtype=dtype, **changes)
    out = dict(scene._arguments)
    out["camera"] = Camera(fx=9, fy=9.5, cx=4.4, cy=4.1)
    return out


def tensors(dtype=np.float64, **changes):
    """The same, what may have a gradient in tensors; surface_textures with them."""
    given = arguments(dtype, **changes)
    out = {name: torch.tensor(value) if isinstance(value, np.ndarray) and name not in (
        "faces", "face_surfaces") else value for name, value in given.items()}
    out["camera"] = torch.tensor(given["camera"].numbers.astype(dtype))
    texture = given["textures"]
    out["textures"] = Texture(torch.tensor(texture.texels), texture.wrap, texture.filter)
    numbers = np.stack([surface.numbers for surface in given["surfaces"]])
    out["surfaces"] = torch.tensor(numbers.astype(dtype))
    out["surface_textures"] = (0, 0)
    if given.get("lights") is not None:
        out["lights"] = torch.tensor(given["lights"].numbers.astype(dtype))
    return out


def rendered(given, **options):
    return tg.render(**{**SIZE, **given, **options})


@needs_torch
class Gradients(unittest.TestCase):
    """torch.autograd.gradcheck: central differences with steps of 1e-6 in float64. Their own error
    is 1e-10 by rounding and about 1e-12 of third derivatives, which are below delta^-1.5 = 4e3."""

    def check(self, name, outputs, **changes):
        given = tensors(**changes)
        texture = given["textures"]
        leaf = texture.texels if name == "textures" else given[name]

        def images(value):
            value = Texture(value, texture.wrap, texture.filter) if name == "textures" else value
            made = rendered({**given, name: value}, outputs=outputs)
            inside = made.face_ids >= 0
            # Depth is infinite outside, where differences have no meaning.
            return tuple(getattr(made, output)[inside] if output == "depth"
                         else getattr(made, output) for output in outputs)

        leaf = leaf.clone().requires_grad_()
        self.assertTrue(torch.autograd.gradcheck(images, leaf, eps=1e-6, atol=1e-7, rtol=1e-5))
        self.assertGreater(float(torch.autograd.grad(sum(i.sum() for i in images(leaf)),
                                                     leaf)[0].abs().max()), 1e-3)

    def test_every_input(self):
        around = np.random.default_rng(1).normal(size=(16, 3)) * 0.2 + (0, 0, 1)
        for name, outputs, changes in (
                ("positions", ("color", "alpha", "attributes", "depth", "normals", "uv"), {}),
                *(("positions", ("color", "alpha"), {"lighting": lighting})
                  for lighting in ("none", "lambert", "spherical_harmonics")),
                ("camera", ("color", "alpha", "attributes", "depth"), {}),
                ("colors", ("color", "alpha"), {}), ("uvs", ("color", "uv"), {}),
                ("textures", ("color",), {}), ("attributes", ("attributes",), {}),
                ("normals", ("color", "normals"), {"normals": around}),
                ("lights", ("color",), {"lighting": "lambert"}),
                ("lights", ("color",), {"lighting": "phong"}),
                ("light_directions", ("color",), {"lights": None, "light_directions": around}),
                ("sh", ("color",), {"lighting": "spherical_harmonics"}),
                ("surfaces", ("color",), {}),
                # Two images: what each has of its own, and what they share.
                *((name, ("color", "alpha"), {"count": 2})
                  for name in ("positions", "colors", "textures", "lights", "camera", "uvs"))):
            with self.subTest(name, **changes):
                self.check(name, outputs, **changes)

    def test_camera_of_free_numbers(self):
        given = tensors(lighting="none")

        def alpha(rotation, translation, fx, cx):
            camera = tg.camera(tg.rotation_6d(rotation), translation, fx, 9.5, cx, 4.1)
            return rendered({**given, "camera": camera}).alpha

        parts = [torch.tensor(v, dtype=torch.float64, requires_grad=True)
                 for v in ([1, 0.05, 0, 0.1, 1, 0.02], [0.05, 0.02, -0.1], 9, [4.4, 4.9])]
        self.assertTrue(torch.autograd.gradcheck(alpha, parts, eps=1e-6, atol=1e-7, rtol=1e-5))

    def test_lights_and_surfaces_of_parts(self):
        given = tensors()

        def color(direction, intensity, diffuse, shininess):
            return rendered({**given, "lights": tg.lights(direction, intensity),
                             "surfaces": tg.surfaces(diffuse=diffuse, shininess=shininess)}).color

        parts = [torch.tensor(v, dtype=torch.float64, requires_grad=True)
                 for v in ([[0.3, 0.5, 1], [-0.4, 0.2, 1]], [0.8, 0.3],
                           [[0.4, 0.5, 0.6], [0.9, 0.3, 0.2]], 6.0)]
        self.assertTrue(torch.autograd.gradcheck(color, parts, eps=1e-6, atol=1e-7, rtol=1e-5))

    def test_numbers_keep_the_digits_of_float64(self):
        numbers = [0.3, 0.5, 1.1, 0.7]
        self.assertEqual(tg.lights(numbers[:3], numbers[3]).tolist(), numbers)
        self.assertEqual(tg.camera(fx=70.1)[12].item(), 70.1)
        self.assertEqual(tg.lights(torch.tensor([0, 0, 1]), 0.7)[3].item(), 0.7)
        beside = tg.lights(torch.tensor(numbers[:3]), 0.7)  # a tensor decides
        self.assertEqual(beside.dtype, torch.float32)

    def test_engine_agrees_with_reference(self):
        """float32 against float64, of all inputs at once."""
        found = {}
        for dtype in (np.float32, np.float64):
            given = tensors(dtype)
            leaves = {name: value.requires_grad_() for name, value in given.items()
                      if isinstance(value, torch.Tensor)}
            leaves["textures"] = given["textures"].texels.requires_grad_()
            images = rendered(given, outputs=("color", "alpha", "attributes"))
            loss = (images.color * torch.linspace(-1, 1, 3).reshape(3, 1, 1)).sum() \
                + images.alpha.square().sum() + images.attributes.square().sum()
            gradients = torch.autograd.grad(loss, list(leaves.values()))
            found[dtype] = dict(zip(leaves, gradients))
            self.assertTrue(all(g.dtype == images.alpha.dtype for g in gradients))
        for name, expected in found[np.float64].items():
            error = (found[np.float32][name] - expected).abs().max() / expected.abs().max()
            self.assertLess(float(error), 1e-3, name)


class PatchTest(unittest.TestCase):
    """A test with a patch, whose positions have a gradient."""

    def setUp(self):
        self.given = tensors(np.float32)
        self.positions = self.given["positions"].requires_grad_()

    def gradient(self, loss):
        return torch.autograd.grad(loss, self.positions)[0]


@needs_torch
class Graphs(PatchTest):
    def test_images_are_those_of_the_renderer(self):
        given = arguments(np.float32)
        frame = tilegrad.Renderer(1).render(tilegrad.Scene(**given), **SIZE,
                                            outputs=("color", "alpha", "barycentrics"))
        images = rendered(self.given, outputs=("color", "alpha", "barycentrics"))
        for name in ("color", "alpha", "barycentrics", "face_ids"):
            np.testing.assert_array_equal(getattr(images, name).detach().numpy(),
                                          getattr(frame, name))
        self.assertIsNone(images.depth)
        self.assertFalse(images.barycentrics.requires_grad or images.face_ids.requires_grad)

    def test_memory_is_shared(self):
        positions = self.positions.detach()
        tilegrad.reset_stats()
        first = rendered({**self.given, "positions": positions})
        self.assertEqual(tilegrad.stats()["copies"], 0)
        self.assertTrue(first.alpha.is_contiguous())

    def test_a_loss_of_depth_that_is_nan_outside(self):
        """Its gradient is NaN where depth is infinite, whatever `where` chooses there."""
        images = rendered(self.given, outputs="depth")
        inside = images.face_ids >= 0
        self.assertFalse(bool(inside.all()))
        chosen = self.gradient((images.depth[inside] - 2).square().sum())
        images = rendered(self.given, outputs="depth")
        loss = torch.where(inside, (images.depth - 2).square(), torch.zeros(()))
        self.assertTrue(torch.equal(self.gradient(loss.sum()), chosen))

    def test_renders_between_forward_and_backward(self):
        alone = self.gradient(rendered(self.given).color.sum())
        first = rendered(self.given)
        moved = {**self.given, "positions": self.positions + 0.05}
        second = rendered(moved)
        for _ in range(3):  # reuses memory of frames that are gone
            rendered({**moved, "colors": None}, width=40)
        self.assertTrue(torch.equal(self.gradient(first.color.sum()), alone))
        self.gradient(second.color.sum())

    def test_backward_twice_with_a_kept_graph(self):
        loss = rendered(self.given).color.sum()
        one = torch.autograd.grad(loss, self.positions, retain_graph=True)[0]
        self.assertTrue(torch.equal(one, self.gradient(loss)))
        self.assertRaisesRegex(RuntimeError, "second time", self.gradient, loss)

    def test_only_what_is_needed_is_computed(self):
        colors = self.given["colors"].requires_grad_()
        with mock.patch.object(tilegrad.Renderer, "backward", autospec=True,
                               side_effect=tilegrad.Renderer.backward) as spy:
            images = rendered(self.given)
            images.color.sum().backward()
            self.assertEqual(spy.call_args.kwargs["wrt"], ("positions", "colors"))
            self.assertEqual(set(spy.call_args.kwargs) - {"wrt"}, {"color"})
            self.positions.requires_grad_(False)
            rendered(self.given).alpha.sum().backward()
            self.assertEqual(spy.call_args.kwargs["wrt"], ("colors",))
            calls = spy.call_count
            with torch.no_grad():
                self.assertFalse(rendered(self.given).color.requires_grad)
            self.assertEqual(spy.call_count, calls)
        self.assertFalse(colors.grad.isnan().any())

    def test_changes_in_place_are_found(self):
        loss = rendered(self.given).color.sum()
        with torch.no_grad():
            self.positions += 0.1
        with self.assertRaisesRegex(RuntimeError, "modified by an inplace operation"):
            self.gradient(loss)
        images = rendered(self.given)
        with self.assertRaisesRegex(RuntimeError, "modified by an inplace operation"):
            self.gradient(images.alpha.mul_(2).sum())

    def test_strided_tensors(self):
        expected = self.gradient(rendered(self.given).color.sum())
        wide = torch.zeros(16, 6)
        wide[:, ::2] = self.positions.detach()
        strided = wide[:, ::2].requires_grad_()
        self.assertFalse(strided.is_contiguous())
        images = rendered({**self.given, "positions": strided})
        got = torch.autograd.grad(images.color.permute(3, 0, 1, 2).sum(), strided)[0]
        self.assertTrue(torch.equal(got, expected))

    def test_meshes_of_files(self):
        """With textures, and without: scene_arguments has None for what a mesh lacks."""
        from file_samples import textured_mesh
        from tilegrad import files
        positions, faces = tilegrad.icosphere(1, 0.5)
        for mesh, distance in ((textured_mesh(), 3),
                               (files.Mesh(positions, faces, colors=positions + 0.5), 2)):
            positions = torch.tensor(mesh.positions, requires_grad=True)
            view = Camera(translation=(0, 0, -distance), fx=12, fy=12, cx=8, cy=8)
            images = tg.render(positions, mesh.faces, view, width=16, height=16, delta=1e-2,
                               **mesh.scene_arguments())
            if mesh.textures:
                self.assertGreater(float(images.color[0, 2].max()), 0.9)
            images.alpha.sum().backward()
            self.assertGreater(float(positions.grad.abs().max()), 0)


@needs_torch
class Modules(unittest.TestCase):
    def test_renderer(self):
        given = tensors(np.float32)
        renderer = tg.Renderer(**SIZE, outputs=("alpha",))
        for module in (renderer, copy.deepcopy(renderer), pickle.loads(pickle.dumps(renderer))):
            images = module(**given)
            self.assertTrue(torch.equal(images.alpha, rendered(given).alpha))
            self.assertIsNone(images.color)
        self.assertEqual(renderer(**given, width=20).alpha.shape, (1, 8, 20))
        self.assertIn("width=9", repr(renderer))
        self.assertEqual(list(renderer.state_dict()), [])


@needs_torch
class Errors(unittest.TestCase):
    def test_other_devices(self):
        given = tensors(np.float32)
        for name in ("positions", "colors", "camera"):
            with self.assertRaisesRegex(TypeError, f"render: {name} is on meta.*{name}.cpu"):
                rendered({**given, name: given[name].to("meta")})
        texels = given["textures"].texels.to("meta")
        with self.assertRaisesRegex(TypeError, "render: textures is on meta"):
            rendered({**given, "textures": texels})

    def test_a_camera_of_another_size(self):
        given = tensors(np.float32)
        given["camera"] = Camera(fx=9, fy=9.5, cx=4.4, cy=4.1, size=(9, 8))
        self.assertEqual(rendered(given).alpha.shape, (1, 8, 9))
        with self.assertRaisesRegex(ValueError, "for images of 9 x 8 pixels, not 18 x 16"):
            rendered(given, width=18, height=16)

    def test_shapes_and_names(self):
        given = tensors(np.float32)
        with self.assertRaisesRegex(TypeError, r"colors has dtype torch.bfloat16.*colors.float"):
            rendered({**given, "colors": given["colors"].bfloat16()})
        with self.assertRaisesRegex(ValueError, r"camera has shape \(3, 3\), expected \(..., 17\)"):
            rendered({**given, "camera": torch.eye(3)})
        with self.assertRaisesRegex(ValueError, r"colors has shape \(5, 3\).*V = 16"):
            rendered({**given, "colors": torch.zeros(5, 3)})
        self.assertRaisesRegex(TypeError, "colours", rendered, given, colours=1)
        self.assertRaisesRegex(ValueError, "outputs is 'rgb'", rendered, given, outputs=("rgb",))
        with self.assertRaisesRegex(ValueError, r"rotation has shape \(3,\)"):
            tg.camera(rotation=torch.zeros(3))
        with self.assertRaisesRegex(ValueError, r"fx has shape \(3,\), expected \(2,\), as the "
                                    "arguments before it have it"):
            tg.camera(rotation=torch.eye(3).expand(2, 3, 3), fx=torch.ones(3))
        with self.assertRaisesRegex(ValueError, r"intensity has shape \(3, 2\), expected \(4,\)"):
            tg.lights(torch.ones(4, 3), torch.ones(3, 2))
        with self.assertRaisesRegex(ValueError, "delta has no gradient"):
            rendered(given, delta=torch.tensor(1e-3, requires_grad=True))
        given["positions"][3, 1] = float("nan")
        self.assertRaisesRegex(ValueError, r"positions\[3,1\] is nan", rendered, given)

    def test_six_numbers_without_a_rotation(self):
        for numbers in ([0, 0, 0, 1, 0, 0], [1, 2, 3, 2, 4, 6], [1, 0, 0, 0, 0, 0], [math.nan] * 6):
            for dtype in (torch.float32, torch.float64):
                with self.assertRaisesRegex(ValueError, "rotation_6d"):
                    tg.rotation_6d(torch.tensor([[1, 0, 0, 0, 1, 0], numbers], dtype=dtype))

    def test_six_numbers_of_any_size(self):
        for numbers in ([1e30, 0, 0, 0, 1e-30, 0], [1e-40, 0, 0, 1, 1, 0]):
            found = tilegrad.torch.rotation_6d(torch.tensor(numbers))
            self.assertTrue(torch.equal(found, torch.eye(3)))
        with self.assertRaisesRegex(ValueError, "rotation_6d: numbers .* not finite"):
            tilegrad.torch.rotation_6d(torch.tensor([math.nan, 0, 0, 0, 1, 0]))

    def test_six_numbers_of_another_kind(self):
        with self.assertRaisesRegex(ValueError, r"numbers have shape \(5,\), expected \(..., 6\)"):
            tg.rotation_6d(torch.ones(5))
        with self.assertRaisesRegex(TypeError, "numbers have dtype torch.int64"):
            tg.rotation_6d(torch.tensor([1, 0, 0, 0, 1, 0]))

    def test_surface_textures_and_threads(self):
        given = tensors(np.float32)
        self.assertIsInstance(given["surfaces"], torch.Tensor)
        for bad, error in (((0.7, 0), TypeError), ((2**32, 0), ValueError)):
            with self.assertRaisesRegex(error, "^render: surface_textures has"):
                rendered(given, surface_textures=bad)
        expected = rendered(given, surface_textures=(0, -1)).color
        for same in (torch.tensor([0, -1]), np.array([0, -1])):
            self.assertTrue(torch.equal(rendered(given, surface_textures=same).color, expected))
        with self.assertRaisesRegex(ValueError, "^render: surface_textures belong to surfaces in"):
            rendered({**given, "surfaces": Surface(texture=0), "face_surfaces": None},
                     surface_textures=(0,))
        with self.assertRaisesRegex(TypeError, "^render: threads must be int, got"):
            rendered(given, threads=[2])

    def test_lazy_negation(self):
        """What torch has negated in name only, as the imaginary part of a conjugate."""
        given = tensors(np.float32)
        colors = given["colors"].detach()
        lazy = torch.complex(colors, -colors).conj().imag
        self.assertTrue(lazy.is_neg())
        self.assertTrue(torch.equal(rendered({**given, "colors": lazy}).color,
                                    rendered(given).color))

    def test_constants_of_the_package_are_taken(self):
        given = arguments(np.float32)
        given["positions"] = torch.tensor(given["positions"])
        given["lights"] = Light((0, 0, 1))
        given["surfaces"] = Surface(texture=0)
        given["face_surfaces"] = None
        self.assertTrue(torch.isfinite(rendered(given).color).all())
