# SPDX-License-Identifier: Apache-2.0
"""tilegrad.compat.kaolin.ops: values by hand, gradients, the same points from one seed."""

import importlib.util
import math
import unittest

from support import require_torch, torch
from test_kaolin import double

if torch:
    import tilegrad.compat.kaolin as kaolin
    ops = kaolin.ops
    TETRAHEDRON = torch.tensor([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])

HAS_TOOLS = importlib.util.find_spec("tilegrad._tools") is not None

setUpModule = require_torch


def tetrahedron():
    return double([[[0., 0, 0], [4, 0, 0], [0, 3, 0], [0, 0, 2]]])


class Meshes(unittest.TestCase):
    def test_areas_and_adjacency_by_hand(self):
        areas = ops.mesh.face_areas(tetrahedron(), TETRAHEDRON)[0].tolist()
        for got, expected in zip(areas, (6, 4, math.sqrt(61), 3)):
            self.assertAlmostEqual(got, expected)
        faces = torch.tensor([[0, 1, 2], [2, 1, 3]])
        expected = [[0, 1, 1, 0, 0], [1, 0, 1, 1, 0], [1, 1, 0, 1, 0], [0, 1, 1, 0, 0], 5 * [0]]
        self.assertEqual(ops.mesh.adjacency_matrix(5, faces, sparse=False).tolist(), expected)
        sparse = ops.mesh.adjacency_matrix(5, faces)
        self.assertTrue(sparse.is_sparse)
        self.assertEqual(sparse.to_dense().tolist(), expected)

    def test_vertex_normals_and_features_by_hand(self):
        faces = torch.tensor([[0, 1, 2], [0, 2, 3]])
        features = double([[[[1.], [2], [3]], [[5], [6], [7]]]])
        mean = ops.mesh.average_face_vertex_features(faces, features, num_vertices=5)
        self.assertEqual(mean[0, :, 0].tolist(), [3, 2, 4.5, 7, 0])
        normals = double([[[0., 0, 1]], [[0, 1, 0]]]).expand(2, 3, 3)[None]
        got = ops.mesh.compute_vertex_normals(faces, normals)
        self.assertEqual(got[0].tolist(), [[0, 0.5, 0.5], [0, 0, 1], [0, 0.5, 0.5], [0, 1, 0]])
        flat, index = ops.mesh.unindex_vertices_by_faces(features)
        self.assertTrue(torch.equal(ops.mesh.index_vertices_by_faces(flat, index), features))

    def test_gradients(self):
        vertices = torch.randn(2, 4, 3, dtype=torch.float64, requires_grad=True)
        alpha = torch.rand(2, 4, dtype=torch.float64, requires_grad=True)
        features = torch.randn(2, 4, 3, 2, dtype=torch.float64, requires_grad=True)
        check = torch.autograd.gradcheck
        self.assertTrue(check(lambda v: ops.mesh.face_areas(v, TETRAHEDRON), vertices))
        self.assertTrue(check(
            lambda v, a: ops.mesh.subdivide_trianglemesh(v, TETRAHEDRON, 2, a)[0],
            (vertices, alpha)))
        self.assertTrue(check(
            lambda f: ops.mesh.average_face_vertex_features(TETRAHEDRON, f), features))


class Refused(unittest.TestCase):
    def test_positions_that_are_not_finite(self):
        bad = tetrahedron() * math.nan
        mask = torch.ones(1, 2, 2)
        for call, argument in (
                (lambda: ops.mesh.face_areas(bad, TETRAHEDRON), "face_areas: vertices"),
                (lambda: kaolin.metrics.trianglemesh.average_edge_length(bad, TETRAHEDRON),
                 "average_edge_length: vertices"),
                (lambda: kaolin.metrics.render.mask_iou(mask, mask / 0), "mask_iou: rhs_mask"),
                (lambda: kaolin.render.mesh.prepare_vertices(
                    bad, TETRAHEDRON, double([[1.], [1], [-1]]), torch.eye(3).double()[None],
                    torch.zeros(1, 3).double()), "prepare_vertices: vertices")):
            self.assertRaisesRegex(ValueError, argument + " has numbers that are not finite", call)

    def test_types(self):
        for faces in (TETRAHEDRON + 0.5, TETRAHEDRON > 0):
            with self.assertRaisesRegex(TypeError, "adjacency_matrix: faces has dtype"):
                ops.mesh.adjacency_matrix(4, faces)
        with self.assertRaisesRegex(TypeError, "average_edge_length: vertices has dtype"):
            kaolin.metrics.trianglemesh.average_edge_length(tetrahedron().half(), TETRAHEDRON)

    def test_rasterize(self):
        image, z = double([[[[-1., -1], [1, -1], [0, 1]]]]), torch.ones(1, 1, 3).double()
        draw = kaolin.render.mesh.rasterize
        for valid in (256, 0.5):  # not cut to a byte, which would be 0
            face_idx = draw(4, 4, z, image, z[..., None], torch.tensor([[valid]]))[1]
            self.assertEqual(int(face_idx.max()), 0)
        with self.assertRaisesRegex(ValueError, "rasterize: face_features is empty"):
            draw(4, 4, z, image, [])
        with self.assertRaisesRegex(TypeError, "knum must be int"):
            kaolin.render.mesh.dibr_soft_mask(image, torch.zeros(1, 4, 4, dtype=torch.int64),
                                              knum=1.5, exact_kaolin=True)


class Subdivision(unittest.TestCase):
    def test_closed_by_hand(self):
        vertices, faces = ops.mesh.subdivide_trianglemesh(tetrahedron(), TETRAHEDRON, 1)
        self.assertEqual((tuple(vertices.shape), tuple(faces.shape)), ((1, 10, 3), (16, 3)))
        # Three neighbours: 9/16 of their mean. (4, 3, 2) * 9/16 / 3 for the origin.
        self.assertEqual(vertices[0, 0].tolist(), [4 * 3 / 16, 3 * 3 / 16, 2 * 3 / 16])
        # Edge 0-1, the first in order: 3/8 of 0 and 1, 1/8 of 2 and 3.
        self.assertEqual(vertices[0, 4].tolist(), [4 * 3 / 8, 3 / 8, 2 / 8])
        area = ops.mesh.face_normals(ops.mesh.index_vertices_by_faces(vertices, faces)).sum(dim=1)
        self.assertLess(float(area.abs().max()), 1e-12)  # closed, and turned alike

    def test_border_and_alpha_by_hand(self):
        corners, face = double([[[0., 0, 0], [4, 0, 0], [0, 4, 0]]]), torch.tensor([[0, 1, 2]])
        vertices, faces = ops.mesh.subdivide_trianglemesh(corners, face, 1, double([[0., 0, 1]]))
        self.assertEqual(vertices[0].tolist(),
                         [[0, 0, 0], [4, 0, 0], [2, 0, 0], [2, 0, 0], [0, 2, 0], [2, 2, 0]])
        self.assertEqual(faces.tolist(), [[1, 5, 3], [0, 3, 4], [2, 4, 5], [4, 3, 5]])
        twice = ops.mesh.subdivide_trianglemesh(corners, face, 2)
        self.assertEqual((tuple(twice[0].shape), tuple(twice[1].shape)), ((1, 15, 3), (16, 3)))
        alone = double([[[0., 0, 0], [4, 0, 0], [0, 4, 0], [9, 9, 9]]])  # a vertex without faces
        self.assertEqual(ops.mesh.subdivide_trianglemesh(alone, face, 1)[0][0, 3].tolist(),
                         [9, 9, 9])


@unittest.skipUnless(HAS_TOOLS, "a build without training")
class Surfaces(unittest.TestCase):
    def test_sample_points(self):
        vertices = torch.cat([tetrahedron(), 2 * tetrahedron()]).requires_grad_()
        corners = ops.mesh.index_vertices_by_faces(vertices, TETRAHEDRON)
        torch.manual_seed(3)
        points, faces, features = ops.mesh.sample_points(vertices, TETRAHEDRON, 2000,
                                                         face_features=corners)
        self.assertTrue(torch.equal(points, features))
        distance, _, _ = kaolin.metrics.trianglemesh.point_to_mesh_distance(points, corners)
        self.assertLess(float(distance.max()), 1e-24)
        areas = ops.mesh.face_areas(vertices, TETRAHEDRON)
        share = areas[0] / areas[0].sum()
        for image in faces:
            for face in range(4):
                p = float(share[face])  # five standard deviations
                self.assertLess(abs(int((image == face).sum()) - 2000 * p),
                                5 * math.sqrt(2000 * p * (1 - p)))
        points.sum().backward()
        self.assertAlmostEqual(float(vertices.grad.sum()), 2 * 3 * 2000, places=6)
        torch.manual_seed(3)
        again = ops.mesh.sample_points(vertices, TETRAHEDRON, 2000)
        self.assertTrue(torch.equal(again[0], points) and len(again) == 2)
        self.assertFalse(torch.equal(points[0] * 2, points[1]))
        only = ops.mesh.sample_points(vertices, TETRAHEDRON, 50, double([[0., 0, 1, 0]] * 2))[1]
        self.assertTrue((only == 2).all())

    def test_sample_points_errors(self):
        flat = torch.zeros(1, 4, 3)
        with self.assertRaisesRegex(ValueError, "sample_points: the surface has no area"):
            ops.mesh.sample_points(flat, TETRAHEDRON, 5)
        with self.assertRaisesRegex(ValueError, "sample_points: the number of points"):
            ops.mesh.sample_points(tetrahedron(), TETRAHEDRON, -1)
        self.assertEqual(tuple(ops.mesh.sample_points(flat[:0], TETRAHEDRON, 5)[0].shape),
                         (0, 5, 3))

    def test_check_sign(self):
        for dtype in (torch.float32, torch.float64):
            vertices = torch.cat([tetrahedron(), tetrahedron() + 10]).to(dtype)
            inside = torch.tensor([[0.5, 0.5, 0.5], [1, 1, 0.25], [3, 0.1, 0.1]], dtype=dtype)
            outside = torch.tensor([[4, 3, 2], [-0.1, 1, 0.5], [1, 1, 5]], dtype=dtype)
            points = torch.cat([inside, outside])
            got = ops.mesh.check_sign(vertices, TETRAHEDRON, torch.stack([points, points + 10]))
            self.assertEqual(got.tolist(), 2 * [[True] * 3 + [False] * 3])
            self.assertEqual(ops.mesh.check_sign(vertices, TETRAHEDRON,
                                                 torch.stack([points, points]), 64)[1].tolist(),
                             6 * [False])

    def test_surface_voxels_by_hand(self):
        square = double([[[0., 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]])
        faces = torch.tensor([[0, 1, 2], [0, 2, 3]])
        grid = ops.conversions.trianglemeshes_to_voxelgrids(square, faces, 5)
        self.assertEqual((tuple(grid.shape), grid.dtype), ((1, 5, 5, 5), torch.float64))
        self.assertTrue((grid[0, :, :, 0] == 1).all() and (grid[0, :, :, 1:] == 0).all())
        placed = ops.conversions.trianglemeshes_to_voxelgrids(
            square, faces, 5, double([[-1., 0, -0.5]]), double([2.]), return_sparse=True)
        self.assertTrue(placed.is_sparse)
        self.assertEqual(sorted(map(tuple, placed.indices().T.tolist())),
                         [(0, x, y, 1) for x in (2, 3, 4) for y in (0, 1, 2)])
        with self.assertRaisesRegex(ValueError, "resolution is 513"):
            ops.conversions.trianglemeshes_to_voxelgrids(square, faces, 513)
        with self.assertRaisesRegex(ValueError, "the scale is 0"):
            ops.conversions.trianglemeshes_to_voxelgrids(square * 0, faces, 5)


class Voxels(unittest.TestCase):
    def test_points_by_hand(self):
        points = double([[[0., 0, 0], [1, 1, 1], [2, 2, 2], [2, 0.4, 1.6]]])
        grid = ops.conversions.pointclouds_to_voxelgrids(points, 3)
        self.assertEqual(grid.nonzero().tolist(),
                         [[0, 0, 0, 0], [0, 1, 1, 1], [0, 2, 0, 2], [0, 2, 2, 2]])
        outside = ops.conversions.pointclouds_to_voxelgrids(points, 3, double([[0., 0, 0]]),
                                                            double([1.]), return_sparse=True)
        self.assertEqual(outside.indices().T.tolist(), [[0, 0, 0, 0], [0, 2, 2, 2]])

    def test_cubes(self):
        grids = torch.zeros(2, 2, 3, 3)
        grids[0, 0, 0, 0] = grids[1, 0, 1, 1] = grids[1, 1, 1, 1] = 1
        vertices, faces = ops.conversions.voxelgrids_to_cubic_meshes(grids)
        self.assertEqual([(len(v), len(f)) for v, f in zip(vertices, faces)], [(8, 12), (12, 20)])
        for v, f, volume in zip(vertices, faces, (1, 2)):
            a, b, c = v[f].unbind(dim=1)
            self.assertAlmostEqual(float((a * torch.cross(b, c, dim=1)).sum()) / 6, volume, 5)
        quads = ops.conversions.voxelgrids_to_cubic_meshes(grids, is_trimesh=False)[1]
        self.assertEqual([tuple(q.shape) for q in quads], [(6, 4), (10, 4)])
        empty = ops.conversions.voxelgrids_to_cubic_meshes(torch.zeros(1, 2, 2, 2))
        self.assertEqual([tuple(t[0].shape) for t in empty], [(0, 3), (0, 3)])


class Coordinates(unittest.TestCase):
    def test_by_hand_and_back(self):
        angle = double([0., math.pi / 2, math.pi / 6])
        x, y, z = ops.coords.spherical2cartesian(angle, double([0., 0, math.pi / 6]), 2.)
        expected = double([[2., 0, 0], [0, 2, 0], [1.5, math.sqrt(3) / 2, 1]])
        self.assertLess(float((torch.stack([x, y, z], 1) - expected).abs().max()), 1e-15)
        back = ops.coords.cartesian2spherical(x, y, z)
        for got, wanted in zip(back, (angle, double([0., 0, math.pi / 6]), double([2., 2, 2]))):
            self.assertLess(float((got - wanted).abs().max()), 1e-15)
        self.assertEqual(ops.coords.spherical2cartesian(angle, angle)[2].tolist(),
                         torch.sin(angle).tolist())
