# SPDX-License-Identifier: Apache-2.0
"""tilegrad.compat.kaolin: what public code hands over, and what it asks for."""

import importlib
import unittest

from support import require_torch, torch
from test_kaolin import double, quiet, random_faces

if torch:
    import tilegrad.compat.kaolin as kaolin
    mesh = kaolin.render.mesh

setUpModule = require_torch


class Callers(unittest.TestCase):
    """What public code hands over."""

    def test_prepare_vertices_of_one_mesh_for_all_cameras(self):
        vertices, faces = torch.rand(5, 3).double(), torch.tensor([[0, 1, 2], [2, 3, 4]])
        camera = kaolin.render.camera
        position = double([[2., 1, 3], [-1, 2, 3]])
        origin, up = torch.zeros(2, 3).double(), double([[0., 1, 0]])
        proj = camera.generate_perspective_projection(0.8, dtype=torch.float64)
        transform = camera.generate_transformation_matrix(position, origin, up)
        rotation, translation = camera.generate_rotate_translate_matrices(position, origin, up)
        for given in ({"camera_transform": transform},
                      {"camera_rot": rotation, "camera_trans": translation}):
            one = mesh.prepare_vertices(vertices, faces, proj, **given)
            two = mesh.prepare_vertices(vertices.expand(2, 5, 3), faces, proj, **given)
            self.assertEqual([tuple(t.shape) for t in one], [(2, 2, 3, 3), (2, 2, 3, 2), (2, 2, 3)])
            for a, b in zip(one, two):
                self.assertTrue(torch.equal(a, b))

    def test_masks_of_any_dtype(self):
        torch.manual_seed(0)
        soft, hard = torch.rand(2, 3, 4), torch.rand(2, 3, 4) > 0.5
        iou = kaolin.metrics.render.mask_iou
        expected = iou(soft, hard.float())
        for other in (hard, hard.int(), hard.to(torch.uint8), hard.half(), hard.double()):
            with self.subTest(dtype=other.dtype):
                self.assertAlmostEqual(iou(soft, other).item(), expected.item(), places=6)
                self.assertAlmostEqual(iou(other, soft).item(), expected.item(), places=6)
        self.assertEqual(iou(soft, hard.double()).dtype, torch.float64)
        self.assertEqual(iou(hard, ~hard).item(), 1)
        self.assertLess(abs(iou(hard, hard).item()), 1e-6)  # and no overflow of uint8
        soft.requires_grad_()
        iou(soft, hard).backward()
        self.assertGreater(float(soft.grad.abs().max()), 0)

    def test_textures_without_texels(self):
        uv = torch.rand(1, 3, 2)
        for size in ((0, 2), (2, 0), (0, 0)):
            for mode in ("nearest", "bilinear", "bicubic"):
                with self.assertRaisesRegex(ValueError, "texture_maps has no texels"):
                    mesh.texture_mapping(uv, torch.rand(1, 4, *size), mode)

    def test_normals_with_an_axis_more(self):
        corners, depth = random_faces(dtype=torch.float32)
        normals = torch.tensor([[1., 1, -1, 0, 1, -1]] * 2)
        flat, column = (quiet(mesh.dibr_rasterization, 9, 11, depth, corners, depth[..., None], n)
                        for n in (normals, normals[..., None]))
        for a, b in zip(flat, column):
            self.assertTrue(torch.equal(a, b))
        with self.assertRaisesRegex(ValueError, "face_normals_z has shape"):
            mesh.dibr_rasterization(9, 11, depth, corners, depth[..., None], normals[:, :5, None])

    def test_features_of_a_list_may_be_written_to(self):
        corners, depth = random_faces()
        features = [torch.rand(*depth.shape, c).double().requires_grad_() for c in (2, 1)]
        (image, mask), ids = mesh.rasterize(9, 11, depth, corners, features)
        other = mask.detach().clone()
        image *= 2
        self.assertTrue(torch.equal(mask, other))
        mask.clamp_(0, 0.5)
        (image.sum() + mask.sum()).backward()
        expected, = torch.autograd.grad(
            2 * mesh.rasterize(9, 11, depth, corners, features[0])[0].sum(), features[0])
        self.assertTrue(torch.allclose(features[0].grad, expected))
        single = mesh.rasterize(9, 11, depth, corners, features[:1])[0][0]
        single += 1

    def test_exact_kaolin_for_the_whole_program(self):
        corners, _ = random_faces(images=1, faces=80, size=0.1)
        ids = torch.full((1, 32, 32), -1)

        def mask(**options):
            return quiet(mesh.dibr_soft_mask, corners, ids, 300, 0.1, 5, **options).detach()

        ours, kaolins = mask(), mask(exact_kaolin=True)
        self.addCleanup(kaolin.use_exact_kaolin, False)
        kaolin.use_exact_kaolin()
        self.assertTrue(torch.equal(mask(), kaolins))
        self.assertTrue(torch.equal(mask(exact_kaolin=False), ours))
        features, normals = torch.rand(1, 80, 3, 1).double(), torch.ones(1, 80)
        depth = -torch.ones(1, 80, 3).double()
        self.assertTrue(torch.equal(
            *(quiet(mesh.dibr_rasterization, 32, 32, depth, corners, features, normals, 300, 0.1, 5,
                    **options)[1] for options in ({}, {"exact_kaolin": True}))))
        kaolin.use_exact_kaolin(False)
        self.assertTrue(torch.equal(mask(), ours))

    def test_missing_names_point_to_the_porting_page(self):
        for module in (kaolin, kaolin.ops, kaolin.ops.mesh, kaolin.render, kaolin.render.mesh,
                       kaolin.render.camera, kaolin.metrics, kaolin.metrics.render):
            with self.subTest(module=module.__name__), \
                    self.assertRaisesRegex(AttributeError, "'no_such_name': .*docs/porting.md"):
                getattr(module, "no_such_name")
            self.assertFalse(hasattr(module, "no_such_name"))
        self.assertIs(kaolin.ops, importlib.import_module("tilegrad.compat.kaolin.ops"))
