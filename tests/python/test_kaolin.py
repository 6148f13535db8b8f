# SPDX-License-Identifier: Apache-2.0
"""tilegrad.compat.kaolin: published numbers, gradients, bounds, conventions, errors."""

import json
import math
import os
import pathlib
import unittest
import warnings

import numpy as np

from support import SOURCE, require_torch, torch

if torch:
    import tilegrad.compat.kaolin as kaolin
    from tilegrad.compat.kaolin.render.mesh import dibr
    mesh = kaolin.render.mesh

setUpModule = require_torch


def shared_vectors(name):
    """The independent test data, which is not part of the project; skips where it is absent."""
    roots = [os.environ.get("TILEGRAD_SHARED"), SOURCE / "../shared", SOURCE / "../../shared"]
    for root in filter(None, roots):
        path = pathlib.Path(root) / "vectors" / name
        if path.exists():
            return json.loads(path.read_text())
    raise unittest.SkipTest(f"test vectors {name} not found; set TILEGRAD_SHARED to their folder")


def double(values, **options):
    return torch.tensor(values, dtype=torch.float64, **options)


def relative_error(got, expected):
    """The largest difference, relative to the largest number."""
    return float((got.double() - expected).abs().max() / expected.abs().max())


def random_faces(images=2, faces=6, dtype=None, size=0.5):
    """Corners in the image and their depths; float64 unless told."""
    dtype = dtype or torch.float64
    torch.manual_seed(0)
    centres = 2 * torch.rand(images, faces, 1, 2, dtype=dtype) - 1
    corners = centres + size * (2 * torch.rand(images, faces, 3, 2, dtype=dtype) - 1)
    return corners.requires_grad_(), -1 - torch.rand(images, faces, 3, dtype=dtype)


def quiet(function, *arguments, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return function(*arguments, **options)


def equation_6(corners, ids, sigmainv):
    """alpha over all faces, for each pixel with each face. [B,F,3,2], [B,H,W] -> [B,H,W]"""
    height, width = ids.shape[1:]
    x = (2 * torch.arange(width, dtype=corners.dtype) + 1 - width) / width
    y = (height - 2 * torch.arange(height, dtype=corners.dtype) - 1) / height
    pixels = torch.stack(torch.meshgrid(x, y, indexing="xy"), dim=-1)[:, :, None, None]
    outside = []
    for image in corners.detach():
        edges = image.roll(-1, dims=1) - image
        to_pixel = pixels - image
        along = ((to_pixel * edges).sum(-1) / (edges**2).sum(-1)).clamp(0, 1)
        squared = ((to_pixel - along[..., None] * edges)**2).sum(-1).min(dim=-1)[0]
        outside.append((1 - torch.exp(-sigmainv * squared)).prod(dim=-1))
    return torch.where(ids >= 0, 1., 1 - torch.stack(outside))


class GoldenSoftMask(unittest.TestCase):
    """Numbers of Kaolin's own tests, made by its CUDA code."""

    def setUp(self):
        self.vectors = shared_vectors("01_dibr_soft_mask_simple.json")
        self.height, self.width = self.vectors["height"], self.vectors["width"]

    def render(self, dtype, case, exact):
        corners = torch.tensor(self.vectors["face_vertices_image"], dtype=dtype,
                               requires_grad=True)
        depth = torch.tensor(self.vectors["face_vertices_z"], dtype=dtype)
        _, mask, ids = quiet(
            mesh.dibr_rasterization, self.height, self.width, depth, corners,
            torch.ones(*depth.shape, 1, dtype=dtype), torch.ones(depth.shape[:2], dtype=dtype),
            sigmainv=case["sigmainv"], boxlen=case["boxlen"], knum=self.vectors["knum"],
            multiplier=self.vectors["multiplier"], exact_kaolin=exact)
        return corners, mask, ids

    def target(self, ids):
        """The hard mask, five columns to the left."""
        return torch.nn.functional.pad((ids >= 0)[:, :, 5:].double(), (0, 5))

    def test_exact_kaolin(self):
        expected_ids = torch.tensor(self.vectors["selected_face_idx"])
        tolerances = {torch.float32: (1e-5, 1e-3), torch.float64: (1e-10, 1e-8)}
        for dtype, (mask_tolerance, gradient_tolerance) in tolerances.items():
            for case in self.vectors["cases"]:
                with self.subTest(dtype=dtype, sigmainv=case["sigmainv"], boxlen=case["boxlen"]):
                    corners, mask, ids = self.render(dtype, case, exact=True)
                    self.assertTrue(torch.equal(ids, expected_ids))
                    golden = double(case["soft_mask_golden"])
                    self.assertLess(float((mask - golden).abs().max()), mask_tolerance)
                    loss = kaolin.metrics.render.mask_iou(mask, self.target(ids).to(dtype))
                    self.assertAlmostEqual(loss.item(), case["loss_recomputed"], places=5)
                    loss.backward()
                    self.assertLess(
                        relative_error(corners.grad,
                                       double(case["grad_face_vertices_image_golden"])),
                        gradient_tolerance)

    def test_bounded_mask_is_equation_6(self):
        bounds = {torch.float32: 1e-6 + 1e-5, torch.float64: 1e-12 + 1e-13}  # and rounding
        for dtype, bound in bounds.items():
            for case in self.vectors["cases"]:
                corners, mask, ids = self.render(dtype, case, exact=False)
                exact = equation_6(corners.double(), ids, case["sigmainv"])
                self.assertLess(float((mask - exact).abs().max()), bound)


class Gradients(unittest.TestCase):
    """torch.autograd.gradcheck in float64."""

    def check(self, function, *inputs, **options):
        self.assertTrue(torch.autograd.gradcheck(function, inputs, **options))

    def test_rasterize(self):
        corners, depth = random_faces(size=1)
        features = torch.rand(*depth.shape, 3, dtype=torch.float64, requires_grad=True)
        valid = torch.tensor([[True] * 5 + [False]] * 2)
        for multiplier in (None, 1.):  # with 1, the eps in the weights counts
            image, ids = mesh.rasterize(9, 11, depth, corners, features, valid, multiplier, 1e-3)
            self.assertGreater(int((ids >= 0).sum()), 40)
            self.check(lambda c, f: mesh.rasterize(9, 11, depth, c, f, valid, multiplier, 1e-3)[0],
                       corners, features)

    def test_no_gradient_to_depth(self):
        corners, depth = random_faces()
        depth.requires_grad_()
        image, _ = mesh.rasterize(9, 11, depth, corners, torch.rand(*depth.shape, 2).double())
        image.sum().backward()
        self.assertIsNone(depth.grad)

    def test_soft_mask(self):
        corners, depth = random_faces()
        _, ids = mesh.rasterize(9, 11, depth, corners, depth[..., None])
        self.assertGreater(int((ids < 0).sum()), 20)
        for exact in (False, True):
            self.check(lambda c: quiet(mesh.dibr_soft_mask, c, ids, 50, 0.9, 4,
                                       exact_kaolin=exact), corners)

    def test_dibr_rasterization(self):
        corners, depth = random_faces()
        features = [torch.rand(*depth.shape, c, dtype=torch.float64, requires_grad=True)
                    for c in (1, 2)]
        normals = torch.tensor([[1., 1, -1, 0, 1, -1]] * 2)

        def render(c, *f):
            images, mask, _ = quiet(mesh.dibr_rasterization, 9, 11, depth, c, list(f), normals, 50)
            return (*images, mask)

        self.check(render, corners, *features)

    def test_prepare_vertices(self):
        torch.manual_seed(1)
        vertices = torch.rand(2, 5, 3, dtype=torch.float64, requires_grad=True)
        faces = torch.tensor([[0, 1, 2], [2, 1, 3], [3, 4, 0]])
        camera = kaolin.render.camera
        proj = camera.generate_perspective_projection(0.8, 1.5, dtype=torch.float64)
        position = torch.tensor([[2., 1, 3], [-1, 2, 3]], dtype=torch.float64, requires_grad=True)
        origin, up = torch.zeros(2, 3).double(), double([[0., 1, 0]])

        def by_transform(v, p):
            return mesh.prepare_vertices(
                v, faces, proj,
                camera_transform=camera.generate_transformation_matrix(p, origin, up))

        def by_rotation(v, p):
            rotation, translation = camera.generate_rotate_translate_matrices(p, origin, up)
            return mesh.prepare_vertices(v, faces, proj, rotation, translation)

        for a, b in zip(by_transform(vertices, position), by_rotation(vertices, position)):
            self.assertLess(float((a - b).abs().max()), 1e-12)
        self.check(by_transform, vertices, position)

    def test_the_rest(self):
        torch.manual_seed(2)
        texture = torch.rand(2, 3, 4, 5, dtype=torch.float64, requires_grad=True)
        uv = torch.rand(2, 3, 6, 2, dtype=torch.float64, requires_grad=True)
        self.check(lambda u, t: mesh.texture_mapping(u, t, "bilinear"), uv, texture)
        self.check(lambda t: mesh.texture_mapping(uv.detach(), t), texture)
        normals = torch.rand(2, 3, 4, 3, dtype=torch.float64, requires_grad=True)
        lights = torch.rand(2, 9, dtype=torch.float64, requires_grad=True)
        self.check(mesh.spherical_harmonic_lighting, normals, lights)
        self.check(kaolin.render.lighting.sh9_irradiance, lights[0].detach().requires_grad_(),
                   normals.detach()[0, 0].requires_grad_())
        masks = [torch.rand(2, 3, 4, dtype=torch.float64, requires_grad=True) for _ in range(2)]
        self.check(kaolin.metrics.render.mask_iou, *masks)
        self.check(lambda v: kaolin.ops.mesh.face_normals(v, unit=True),
                   torch.rand(1, 4, 3, 3, dtype=torch.float64, requires_grad=True))


    def test_coordinates_that_are_no_numbers(self):
        """torch reads NaN as -1, and its backward pass of it out of bounds."""
        for mode in ("nearest", "bilinear", "bicubic"):
            for shape in ((1, 40, 30, 2), (1, 900, 2)):
                uv = torch.full(shape, math.nan)
                uv[0, ..., 1:2] = 0.5
                uv[0, 0] = torch.tensor([0.3, math.inf])
                texture = torch.rand(1, 3, 64, 64, requires_grad=True)
                uv.requires_grad_()
                image = mesh.texture_mapping(uv, texture, mode)
                image.sum().backward()
                for values in (image, texture.grad, uv.grad):
                    self.assertTrue(bool(torch.isfinite(values).all()))


class Vectors(unittest.TestCase):
    """What pure Python code of Kaolin gives."""

    def test_texture_mapping(self):
        v = shared_vectors("05_texture_mapping.json")
        texture = double(v["random_texture"]).unsqueeze(0).requires_grad_()
        uv = double(v["random_uv"]).unsqueeze(0).requires_grad_()
        expected = v["clamp_align_false_border"]
        nearest = mesh.texture_mapping(uv, texture, mode="nearest")
        self.assertTrue(torch.equal(nearest, mesh.texture_mapping(uv, texture)))
        self.assertLess(relative_error(nearest[0], double(expected["nearest"])), 1e-12)
        bilinear = mesh.texture_mapping(uv, texture, mode="bilinear")
        self.assertLess(relative_error(bilinear[0], double(expected["bilinear"])), 1e-12)
        bilinear.backward(double(v["random_grad_out"]).unsqueeze(0))
        self.assertLess(relative_error(uv.grad[0], double(expected["bilinear_grad_uv"])), 1e-12)
        self.assertLess(relative_error(texture.grad[0],
                                       double(expected["bilinear_grad_texture"])), 1e-12)

    def test_texture_mapping_sparse_and_dense(self):
        v = shared_vectors("05_texture_mapping.json")
        texture = double(v["kaolin_test_texture"]).unsqueeze(1)
        for mode in ("nearest", "bilinear"):
            sparse = mesh.texture_mapping(double(v["kaolin_test_sparse_uv"]), texture, mode)
            self.assertLess(relative_error(sparse[..., 0],
                                           double(v[f"kaolin_test_sparse_{mode}"])), 1e-6)
            dense = mesh.texture_mapping(double(v["kaolin_test_dense_uv"]), texture, mode)
            expected = double(v[f"kaolin_test_dense_{mode}_both_rows"])
            for row in range(dense.shape[1]):
                self.assertLess(relative_error(dense[:, row, :, 0], expected), 1e-6)

    def test_spherical_harmonics(self):
        v = shared_vectors("06_spherical_harmonics.json")
        lighting = kaolin.render.lighting
        normals = double(v["normals"]).requires_grad_()
        lights = double(v["lights9"]).requires_grad_()
        old = mesh.spherical_harmonic_lighting(normals[None, None], lights[None])
        self.assertLess(relative_error(old[0, 0], double(v["kaolin_deprecated_lighting"])), 1e-12)
        self.assertLess(relative_error(lighting.project_onto_sh9(normals),
                                       double(v["kaolin_sh9_basis"])), 1e-12)
        irradiance = lighting.sh9_irradiance(lights, normals)
        self.assertLess(relative_error(irradiance, double(v["kaolin_sh9_irradiance"])), 1e-12)
        (irradiance * double(v["grad_weight"])).sum().backward()
        for gradient, name in ((lights.grad, "lights"), (normals.grad, "normals")):
            expected = double(v[f"kaolin_sh9_irradiance_grad_{name}_of_sum_w_irr"])
            self.assertLess(relative_error(gradient, expected), 1e-12)
        diffuse = lighting.sh9_diffuse(double(v["direction"]), normals, double(v["albedo"]))
        self.assertLess(relative_error(diffuse, double(v["kaolin_sh9_diffuse_from_direction"])),
                        1e-12)

    def test_mask_iou_and_laplacian(self):
        v = shared_vectors("09_mesh_and_mask_losses.json")
        lhs = double(v["mask_lhs"]).requires_grad_()
        loss = kaolin.metrics.render.mask_iou(lhs, double(v["mask_rhs"]))
        self.assertAlmostEqual(loss.item(), v["kaolin_mask_iou_loss"], places=12)
        loss.backward()
        self.assertLess(relative_error(lhs.grad, double(v["kaolin_mask_iou_grad_lhs"])), 1e-12)
        test = v["kaolin_uniform_laplacian_test"]
        laplacian = kaolin.ops.mesh.uniform_laplacian(test["num_vertices"],
                                                      torch.tensor(test["faces"]))
        self.assertLess(relative_error(laplacian, double(test["expected"])), 1e-6)


class Conventions(unittest.TestCase):
    def test_shapes_and_types(self):
        corners, depth = random_faces(dtype=torch.float32)
        features = [torch.rand(*depth.shape, c) for c in (2, 1)]
        images, ids = mesh.rasterize(8, 12, depth, corners, features, backend="nvdiffrast")
        self.assertIsInstance(images, tuple)
        self.assertEqual([tuple(i.shape) for i in images], [(2, 8, 12, 2), (2, 8, 12, 1)])
        self.assertEqual((tuple(ids.shape), ids.dtype), ((2, 8, 12), torch.int64))
        image, _ = mesh.rasterize(8, 12, depth, corners, torch.cat(features, dim=-1))
        self.assertTrue(torch.equal(image, torch.cat(images, dim=-1)))
        self.assertTrue((image[ids < 0] == 0).all())

    def test_row_0_is_on_top_and_the_largest_z_is_nearest(self):
        corners = torch.tensor([[[[-2., 0], [2, 0], [0, 4]], [[-8, -8], [8, -8], [0, 8]]]])
        depth = torch.tensor([[[-1.] * 3, [-2.] * 3]])
        _, ids = mesh.rasterize(2, 2, depth, corners, depth[..., None])
        self.assertEqual(ids[0].tolist(), [[0, 0], [1, 1]])
        valid = torch.tensor([[False, True]])
        _, ids = mesh.rasterize(2, 2, depth, corners, depth[..., None], valid)
        self.assertTrue((ids == 1).all())

    def test_hidden_and_invalid_faces_take_part_in_the_mask(self):
        corners, depth = random_faces(images=1, dtype=torch.float64)
        none = -torch.ones(1, 6, dtype=torch.float64)
        _, mask, ids = quiet(mesh.dibr_rasterization, 16, 16, depth, corners, depth[..., None],
                             none, 100)
        self.assertTrue((ids == -1).all())
        self.assertLess(float((mask - equation_6(corners, ids, 100)).abs().max()), 1e-11)
        self.assertGreater(float(mask.max()), 0.5)

    def test_mask_does_not_depend_on_the_order_of_faces_but_kaolins_does(self):
        corners, _ = random_faces(images=1, faces=80, size=0.1)
        ids = torch.full((1, 32, 32), -1)
        turned = corners.flip(1)

        def difference(**options):
            masks = [quiet(mesh.dibr_soft_mask, c, ids, 300, 0.1, 5, **options)
                     for c in (corners, turned)]
            return float((masks[0] - masks[1]).abs().max())

        self.assertLess(difference(), 1e-11)
        self.assertGreater(difference(exact_kaolin=True), 0.01)

    def test_max_alpha_error(self):
        corners, _ = random_faces(images=1, faces=80, size=0.1)
        ids = torch.full((1, 32, 32), -1)
        exact = equation_6(corners, ids, 300)
        for dtype in (torch.float32, torch.float64):
            for bound in (0, 1e-3):
                mask = quiet(mesh.dibr_soft_mask, corners.to(dtype), ids, 300,
                             max_alpha_error=bound)
                self.assertLess(float((mask - exact).abs().max()), bound + 1e-5)

    def test_gradient_of_part_of_the_outputs_only(self):
        corners, depth = random_faces(dtype=torch.float32)
        image, mask, _ = quiet(mesh.dibr_rasterization, 8, 8, depth, corners, depth[..., None],
                               torch.ones(2, 6))
        by_image, = torch.autograd.grad(image.sum(), corners, retain_graph=True)
        by_mask, = torch.autograd.grad(mask.sum(), corners, retain_graph=True)
        by_both, = torch.autograd.grad(image.sum() + mask.sum(), corners)
        self.assertTrue(torch.allclose(by_image + by_mask, by_both, atol=1e-5))

    def test_views_and_empty_batches(self):
        corners, depth = random_faces()
        swapped = corners.detach().transpose(0, 1).contiguous().transpose(0, 1)
        self.assertFalse(swapped.is_contiguous())
        image, _ = mesh.rasterize(8, 8, depth, swapped, depth[..., None])
        same, _ = mesh.rasterize(8, 8, depth, corners, depth[..., None])
        self.assertTrue(torch.equal(image, same))
        image, ids = mesh.rasterize(4, 4, depth[:, :0], corners[:, :0], depth[:, :0, :, None])
        self.assertTrue((ids == -1).all() and (image == 0).all())

    def test_one_warning(self):
        corners, depth = random_faces(dtype=torch.float32)
        ids = torch.full((2, 4, 4), -1)
        dibr._warned = False
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            mesh.dibr_soft_mask(corners, ids, exact_kaolin=True)
            self.assertEqual(len(caught), 0)
            mesh.dibr_soft_mask(corners, ids)
            mesh.dibr_soft_mask(corners, ids)
        self.assertEqual(len(caught), 1)
        self.assertIn("boxlen and knum are ignored", str(caught[0].message))
        self.assertEqual(caught[0].filename, __file__)


class Errors(unittest.TestCase):
    def fails(self, error, message, function, *arguments, **options):
        with self.assertRaises(error) as caught:
            quiet(function, *arguments, **options)
        self.assertIn(message, str(caught.exception))

    def test_rasterize(self):
        corners, depth = (t.detach() for t in random_faces(dtype=torch.float32))
        features = depth[..., None]

        def fails(error, message, height=8, width=8, z=depth, xy=corners, f=features, **options):
            self.fails(error, message, mesh.rasterize, height, width, z, xy, f, **options)

        fails(TypeError, "rasterize: face_vertices_image has dtype torch.float16, expected "
                         "torch.float32 or torch.float64 (.float() makes it one)", xy=corners.half())
        fails(TypeError, "rasterize: face_vertices_z has dtype torch.float64, the tensors before "
                         "it torch.float32", z=depth.double())
        fails(TypeError, "rasterize: face_features is ndarray, expected torch.Tensor",
              f=np.zeros((2, 6, 3, 1), np.float32))
        fails(ValueError, "rasterize: face_vertices_z has shape (2, 5, 3), expected (B, F, 3) with "
                          "B = 2, F = 6", z=depth[:, :5])
        fails(ValueError, "rasterize: face_features[1] has shape (2, 6, 3), expected",
              f=[features, depth])
        fails(ValueError, "rasterize: valid_faces has shape (2, 5)",
              valid_faces=torch.ones(2, 5, dtype=torch.bool))
        fails(ValueError, "rasterize: height is 0, expected 1..16384 pixels", height=0)
        fails(ValueError, "rasterize: backend is 'gl', expected one of 'cuda', 'nvdiffrast', "
                          "'nvdiffrast_fwd'", backend="gl")
        fails(ValueError, "rasterize: multiplier is 0, expected a number > 0", multiplier=0)
        fails(ValueError, "eps is -1", eps=-1e6)
        broken = corners.clone()
        broken[0, 1, 2, 0] = float("nan")
        fails(ValueError, "rasterize: face_vertices_image[10] is nan", xy=broken)
        fails(TypeError, "face_vertices_image is on meta; tilegrad renders on the CPU",
              xy=corners.to("meta"))

    def test_soft_mask(self):
        corners, _ = (t.detach() for t in random_faces(dtype=torch.float32))
        ids = torch.full((2, 4, 4), -1)

        def fails(error, message, xy=corners, i=ids, **options):
            self.fails(error, message, mesh.dibr_soft_mask, xy, i, **options)

        fails(TypeError, "selected_face_idx has dtype torch.float32, expected torch.int64",
              i=ids.float())
        fails(ValueError, "selected_face_idx has shape (3, 4, 4), expected (B, H, W) with B = 2",
              i=ids[:1].repeat(3, 1, 1))
        fails(ValueError, "outside of [-1, 6)", i=ids + 7)
        fails(ValueError, "out of int32's range", i=ids + (1 << 40))
        fails(ValueError, "sigmainv is 0", sigmainv=0)
        fails(ValueError, "max_alpha_error is 2", max_alpha_error=2)
        fails(ValueError, "knum is -1", knum=-1, exact_kaolin=True)
        fails(ValueError, "boxlen is -1", boxlen=-1, exact_kaolin=True)

    def test_gradients_that_are_not_finite(self):
        corners, depth = random_faces(dtype=torch.float32)
        image, mask, _ = quiet(mesh.dibr_rasterization, 8, 8, depth, corners, depth[..., None],
                               torch.ones(2, 6))
        for output in (image, mask):
            gradient = torch.full_like(output, float("inf"))
            self.fails(ValueError, "the gradient of", output.backward, gradient, retain_graph=True)

    def test_the_rest(self):
        self.fails(ValueError, "prepare_vertices: expected camera_transform, or camera_rot",
                   mesh.prepare_vertices, torch.rand(1, 3, 3), torch.tensor([[0, 1, 2]]),
                   torch.ones(3, 1))
        self.fails(ValueError, "texture_mapping: mode is 'cubic', expected one of 'nearest'",
                   mesh.texture_mapping, torch.rand(1, 3, 2), torch.rand(1, 3, 4, 4), "cubic")
        self.fails(ValueError, "texture_mapping: texture_maps has shape (2, 3, 4, 4)",
                   mesh.texture_mapping, torch.rand(1, 3, 2), torch.rand(2, 3, 4, 4))
        self.fails(ValueError, "mask_iou: rhs_mask has shape (1, 3, 4)",
                   kaolin.metrics.render.mask_iou, torch.rand(2, 3, 4), torch.rand(1, 3, 4))


class Extremes(unittest.TestCase):
    """Whatever finite numbers come in, finite ones come out."""

    def test_finite_in_finite_out(self):
        rng = np.random.default_rng(0)
        for trial in range(240):
            dtype = (torch.float32, torch.float64)[trial % 2]
            corners = rng.normal(size=(1, 5, 3, 2))
            if trial % 3 == 0:
                corners *= 10.0**rng.uniform(-20, 37)
            if trial % 5 == 0:
                corners = np.round(corners * 2) / 2
            if trial % 7 == 0:
                corners[:, :, 1] = corners[:, :, 0]  # two corners at one place
            if trial % 11 == 0:
                corners[:] = corners[:, :, :1]
            corners = torch.tensor(corners, dtype=dtype, requires_grad=True)
            depth = torch.tensor(rng.normal(size=(1, 5, 3)), dtype=dtype)
            features = torch.tensor(rng.normal(size=(1, 5, 3, 2)), dtype=dtype)
            image, mask, _ = quiet(mesh.dibr_rasterization, 9, 13, depth, corners, features,
                                   torch.ones(1, 5), 10.0**rng.uniform(-8, 12),
                                   exact_kaolin=trial % 4 == 0)
            self.assertTrue(torch.isfinite(image).all(), trial)
            self.assertTrue(((mask >= 0) & (mask <= 1)).all(), trial)
            (image.sum() + mask.sum()).backward()
            self.assertTrue(torch.isfinite(corners.grad).all(), trial)
