# SPDX-License-Identifier: Apache-2.0
"""tilegrad.compat.kaolin.metrics: values against every pair, gradients, errors."""

import importlib.util
import itertools
import unittest

from support import require_torch, torch
from test_kaolin import double

if torch:
    import tilegrad.compat.kaolin as kaolin
    pointcloud, trianglemesh = kaolin.metrics.pointcloud, kaolin.metrics.trianglemesh


def setUpModule():
    require_torch()
    if importlib.util.find_spec("tilegrad._tools") is None:
        raise unittest.SkipTest("a build without training")


class PointClouds(unittest.TestCase):
    def setUp(self):
        torch.manual_seed(0)

    def test_sided_distance_against_every_pair(self):
        for dtype, tolerance in ((torch.float32, 1e-6), (torch.float64, 1e-14)):
            a, b = torch.randn(3, 70, 3, dtype=dtype), torch.randn(3, 90, 3, dtype=dtype)
            distance, index = pointcloud.sided_distance(a, b)
            every = ((a[:, :, None] - b[:, None])**2).sum(-1)
            least, expected = every.min(dim=2)
            self.assertEqual((distance.dtype, index.dtype), (dtype, torch.int64))
            self.assertTrue(torch.equal(index, expected))
            self.assertLess(float((distance - least).abs().max()), tolerance)

    def test_the_first_of_equal_ones(self):
        same = torch.ones(1, 40, 3)
        self.assertEqual(pointcloud.sided_distance(same[:, :2], same)[1].tolist(), [[0, 0]])

    def test_chamfer_by_hand(self):
        a, b = double([[[0., 0, 0], [3, 0, 0]]]), double([[[0., 4, 0]]])
        # a's squares: 16 and 25; b's: 16. Roots: 4 and 5; 4.
        self.assertAlmostEqual(pointcloud.chamfer_distance(a, b).item(), 20.5 + 16)
        self.assertAlmostEqual(pointcloud.chamfer_distance(a, b, 2, 3).item(), 41 + 48)
        self.assertAlmostEqual(pointcloud.chamfer_distance(a, b, squared=False).item(), 4.5 + 4)
        self.assertEqual(tuple(pointcloud.chamfer_distance(a.repeat(5, 1, 1), b.repeat(5, 1, 1))
                               .shape), (5,))

    def test_gradients(self):
        a, b = (torch.randn(2, n, 3, dtype=torch.float64, requires_grad=True) for n in (6, 9))
        for squared in (True, False):
            self.assertTrue(torch.autograd.gradcheck(
                lambda a, b, s=squared: pointcloud.chamfer_distance(a, b, 1, 0.5, s), (a, b)))
        pointcloud.chamfer_distance(a, a, squared=False).sum().backward()
        self.assertTrue((a.grad == 0).all())

    def test_f_score_by_hand(self):
        truth, predicted = double([[[0., 0, 0], [1, 0, 0]]]), double([[[0., 0, 0]]])
        score = pointcloud.f_score(truth, predicted, radius=0.1)  # P = 1, R = 1/2
        self.assertAlmostEqual(score.item(), 2 / 3, places=6)
        self.assertEqual(pointcloud.f_score(truth, predicted + 5, radius=0.1).item(), 0)

    def test_errors(self):
        a = torch.zeros(1, 2, 3)
        for error, message, arguments in (
                (ValueError, "p2 has shape", (a, a.repeat(2, 1, 1))),
                (TypeError, "p2 has dtype torch.float64", (a, a.double())),
                (ValueError, "p2 has no points", (a, a[:, :0])),
                (ValueError, "p1 has a number that is not finite", (a / 0, a))):
            self.assertRaisesRegex(error, message, pointcloud.sided_distance, *arguments)


class Nothing(unittest.TestCase):
    """Metrics of nothing are errors that say so, or what their page defines; never NaN."""

    def test_errors(self):
        none, some = torch.zeros(2, 0, 3), torch.rand(2, 4, 3)
        ops = kaolin.ops
        for call, message in (
                (lambda: pointcloud.chamfer_distance(none, none), "chamfer_distance: p1 has no points"),
                (lambda: pointcloud.chamfer_distance(none, some), "chamfer_distance: p1 has no points"),
                (lambda: pointcloud.chamfer_distance(some, none), "chamfer_distance: p2 has no points"),
                (lambda: pointcloud.f_score(none, none), "f_score: gt_points has no points"),
                (lambda: pointcloud.f_score(some, none), "f_score: pred_points has no points"),
                (lambda: kaolin.metrics.render.mask_iou(torch.zeros(0, 4, 4), torch.zeros(0, 4, 4)),
                 "mask_iou: the masks have no images"),
                (lambda: ops.pointcloud.center_points(none), "center_points: points has no points"),
                (lambda: ops.conversions.pointclouds_to_voxelgrids(none, 4), "has no points"),
                (lambda: ops.conversions.trianglemeshes_to_voxelgrids(
                    none, torch.zeros(0, 3, dtype=torch.int64), 4), "has no points"),
                (lambda: ops.mesh.sample_points(some, torch.zeros(0, 3, dtype=torch.int64), 5),
                 "sample_points"),
                (lambda: ops.mesh.average_face_vertex_features(
                    torch.zeros(0, 3, dtype=torch.int64), torch.zeros(1, 0, 3, 2)),
                 "give num_vertices")):
            self.assertRaisesRegex(ValueError, message, call)

    def test_values(self):
        none, faces = torch.zeros(2, 0, 3), torch.zeros(0, 3, dtype=torch.int64)
        some = torch.rand(2, 4, 3)
        self.assertEqual(tuple(pointcloud.sided_distance(none, none)[0].shape), (2, 0))
        self.assertEqual(tuple(pointcloud.sided_distance(none, some)[0].shape), (2, 0))
        self.assertEqual(tuple(trianglemesh.point_to_mesh_distance(
            none, torch.zeros(2, 0, 3, 3))[0].shape), (2, 0))
        self.assertEqual(tuple(trianglemesh.average_edge_length(some, faces).shape), (2, 0))
        self.assertTrue(torch.equal(trianglemesh.uniform_laplacian_smoothing(some, faces), some))
        self.assertFalse(kaolin.ops.mesh.check_sign(some, faces, some).any())
        empty = torch.zeros(2, 3, 3, 3)
        self.assertEqual(kaolin.metrics.voxelgrid.iou(empty, empty).tolist(), [1, 1])
        self.assertEqual(kaolin.metrics.render.mask_iou(empty[0], empty[0]).item(), 1)
        origin, scale = torch.zeros(2, 3), torch.ones(2)
        grid = kaolin.ops.conversions.pointclouds_to_voxelgrids(none, 4, origin, scale)
        self.assertEqual(float(grid.sum()), 0)


class Distances(unittest.TestCase):
    def setUp(self):
        torch.manual_seed(1)

    def test_regions_by_hand(self):
        face = double([[[[0., 0, 0], [2, 0, 0], [0, 2, 0]]]])
        points = double([[[0.5, 0.5, 3], [-1, -1, 1], [5, -1, 1], [-1, 5, 1], [1, -1, 1], [2, 2, 1],
                          [-1, 0.5, 1]]])
        distance, faces, types = trianglemesh.point_to_mesh_distance(points, face)
        self.assertEqual(types.tolist(), [[0, 1, 2, 3, 4, 5, 6]])
        for got, expected in zip(distance[0].tolist(), [9., 3, 11, 11, 2, 3, 2]):
            self.assertAlmostEqual(got, expected, places=12)
        self.assertEqual((types.dtype, faces.dtype), (torch.int32, torch.int64))

    def test_is_the_least_over_samples_of_the_surface(self):
        corners, points = torch.randn(2, 12, 3, 3).double(), 2 * torch.randn(2, 50, 3).double()
        distance, faces, _ = trianglemesh.point_to_mesh_distance(points, corners)
        steps = [(a / 30, b / 30) for a, b in itertools.product(range(31), repeat=2) if a + b <= 30]
        weights = double([[1 - a - b, a, b] for a, b in steps])
        samples = torch.einsum("sk,bfkd->bfsd", weights, corners)
        every = ((points[:, :, None, None] - samples[:, None])**2).sum(-1).amin(dim=3)
        least = every.min(dim=2)[0]
        self.assertTrue((distance <= least + 1e-12).all())
        # The nearest sample lies within a thirtieth of the longest edge.
        reach = (corners - corners.roll(1, dims=2)).norm(dim=-1).max() / 30
        self.assertTrue((least.sqrt() - distance.sqrt() < reach).all())
        of_face = every.gather(2, faces.unsqueeze(-1)).squeeze(-1)
        self.assertTrue((of_face.sqrt() - distance.sqrt() < reach).all())

    def test_gradients(self):
        corners = torch.randn(1, 8, 3, 3, dtype=torch.float64, requires_grad=True)
        points = 2 * torch.randn(1, 30, 3, dtype=torch.float64)
        types = trianglemesh.point_to_mesh_distance(points, corners)[2]
        self.assertGreater(len(set(types.flatten().tolist())), 4)
        self.assertTrue(torch.autograd.gradcheck(
            lambda p, c: trianglemesh.point_to_mesh_distance(p, c)[0],
            (points.requires_grad_(), corners)))

    def test_faces_without_area_and_errors(self):
        flat = torch.zeros(1, 1, 3, 3)
        distance, _, types = trianglemesh.point_to_mesh_distance(torch.ones(1, 1, 3), flat)
        self.assertEqual(distance.item(), 3)
        self.assertEqual(types.item(), 1)
        with self.assertRaisesRegex(ValueError, "face_vertices has no faces"):
            trianglemesh.point_to_mesh_distance(torch.ones(1, 1, 3), flat[:, :0])
        with self.assertRaisesRegex(ValueError, "face_vertices has a number that is not finite"):
            trianglemesh.point_to_mesh_distance(torch.ones(1, 1, 3), flat / 0)

    def test_edges_and_smoothing_by_hand(self):
        vertices, faces = double([[[0., 0, 0], [3, 0, 0], [0, 4, 0]]]), torch.tensor([[0, 1, 2]])
        self.assertAlmostEqual(trianglemesh.average_edge_length(vertices, faces).item(), 4)
        smooth = trianglemesh.uniform_laplacian_smoothing(vertices, faces)
        self.assertEqual(smooth.tolist(), [[[1.5, 2, 0], [0, 2, 0], [1.5, 0, 0]]])


class Voxels(unittest.TestCase):
    def test_iou_by_hand(self):
        iou = kaolin.metrics.voxelgrid.iou
        a, b = torch.zeros(3, 2, 2, 2), torch.zeros(3, 2, 2, 2)
        a[0, 0], b[0, :, 0] = 1, 0.5  # 4 and 4, 2 in both
        a[1] = 1
        self.assertEqual(iou(a, b).tolist(), [torch.tensor(2 / 6).item(), 0, 1])
        self.assertEqual(iou(a.bool(), b).tolist(), iou(a, b).tolist())
        self.assertRaisesRegex(ValueError, "iou: gt has shape", iou, a, b[:2])
