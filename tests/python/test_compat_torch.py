# SPDX-License-Identifier: Apache-2.0
"""What holds for every operation of tilegrad.losses and tilegrad.compat on torch's tape: a second
derivative is an error, never 0, and in autocast results are those of float32."""

import unittest

import numpy as np

import tilegrad
from tilegrad import losses

try:
    import torch

    import tilegrad.compat.nvdiffrast.torch as dr
    from tilegrad.compat import kaolin
except ImportError:
    torch = None


def corners():
    """[1,2,3,3], of two triangles before the camera."""
    return torch.tensor([[[[-0.8, -0.7, -2], [0.7, -0.6, -2], [0.1, 0.8, -2]],
                          [[-0.5, -0.4, -3], [0.9, -0.2, -3], [0.3, 0.6, -3]]]])


def operations():
    """name: (function of one tensor, that tensor). The functions return one image or number."""
    faces = tilegrad.icosphere(1)[1]
    sphere = torch.tensor(tilegrad.icosphere(1)[0]) + 0.05 * torch.rand(42, 3)
    cloud = torch.rand(1, 9, 3)
    image = corners()[..., :2].contiguous()
    depths = corners()[..., 2].contiguous()
    pos = torch.tensor([[[-0.8, -0.7, 0.5, 1], [0.7, -0.6, 0.5, 1.2], [0.1, 0.8, -0.5, 1]]])
    tri = torch.tensor([[0, 1, 2]], dtype=torch.int32)
    context = dr.RasterizeCpuContext()
    rast = dr.rasterize(context, pos, tri, (9, 8))[0]
    uv = torch.rand(1, 9, 8, 2)
    mesh = kaolin.render.mesh
    return {
        "edge_length": (lambda p: losses.edge_length(p, faces), sphere),
        "laplacian": (lambda p: losses.laplacian(p, faces), sphere),
        "normal_consistency": (lambda p: losses.normal_consistency(p, faces), sphere),
        "chamfer": (lambda p: losses.chamfer(p, cloud[0]), sphere),
        "iou": (lambda a: losses.iou(a, np.full((4, 5), 0.5)), torch.rand(4, 5)),
        "rasterize": (lambda x: mesh.rasterize(9, 8, depths, x, torch.rand(1, 2, 3, 2))[0], image),
        "dibr_rasterization": (lambda x: mesh.dibr_rasterization(
            9, 8, depths, x, torch.ones(1, 2, 3, 1), torch.ones(1, 2), sigmainv=50)[1], image),
        "point_to_mesh_distance": (lambda p: kaolin.metrics.trianglemesh.point_to_mesh_distance(
            p, corners())[0], cloud),
        "dr.rasterize": (lambda p: dr.rasterize(context, p, tri, (9, 8))[0][..., :2], pos),
        "dr.interpolate": (lambda a: dr.interpolate(a, rast, tri)[0], torch.rand(1, 3, 2)),
        "dr.texture": (lambda t: dr.texture(t, uv, filter_mode="linear"), torch.rand(1, 4, 4, 3)),
        "dr.antialias": (lambda p: dr.antialias(torch.rand(1, 9, 8, 3), rast, p, tri), pos)}


@unittest.skipIf(torch is None, "no torch (Debian: python3-torch)")
class Operations(unittest.TestCase):
    def test_second_derivatives_are_errors(self):
        functional = torch.autograd.functional
        for name, (function, start) in operations().items():
            torch.manual_seed(3)

            def total(value, function=function):
                return function(value).sum()

            for ask in (lambda: functional.hessian(total, start),
                        lambda: functional.jvp(total, start, torch.ones_like(start))):
                with self.subTest(name), self.assertRaisesRegex(RuntimeError,
                                                                "first derivatives only"):
                    ask()

    def test_first_derivatives_are_the_same_with_a_graph(self):
        for name, (function, start) in operations().items():
            gradients = []
            for create_graph in (False, True):
                torch.manual_seed(3)
                leaf = start.clone().requires_grad_()
                gradients += torch.autograd.grad(function(leaf).sum(), leaf,
                                                 create_graph=create_graph)
            self.assertTrue(torch.equal(*gradients), name)

    def test_autocast(self):
        """What comes as float32 gives the same bits, and what comes as bfloat16 those of its
        numbers in float32."""
        for name, (function, start) in operations().items():
            results = []
            for half in (start, start.bfloat16()):
                torch.manual_seed(3)
                with torch.autocast("cpu", dtype=torch.bfloat16):
                    mixed = function(half)
                torch.manual_seed(3)
                results.append(torch.equal(mixed, function(half.float())))
                self.assertEqual(mixed.dtype, torch.float32, name)
            self.assertEqual(results, [True, True], name)

    def test_cameras_in_autocast(self):
        camera = kaolin.render.camera
        eye, origin, up = torch.tensor([[1., 2, 3]]), torch.zeros(1, 3), torch.tensor([[0., 1, 0]])
        points = torch.rand(1, 7, 3)
        pinhole = {"eye": eye[0], "at": origin[0], "up": up[0], "fov": 0.8, "width": 64,
                   "height": 48}

        def seen():
            place = camera.generate_rotate_translate_matrices(eye, origin, up)
            matrix = camera.generate_transformation_matrix(eye, origin, up)
            lens = camera.generate_perspective_projection(0.8)
            faces = torch.tensor([[0, 1, 2], [2, 3, 4]])
            made = camera.Camera.from_args(**pinhole)
            return (*kaolin.render.mesh.prepare_vertices(points, faces, lens, *place),
                    *kaolin.render.mesh.prepare_vertices(points, faces, lens,
                                                         camera_transform=matrix),
                    made.transform(points), made.view_projection_matrix(), made.cam_pos(),
                    kaolin.render.lighting.sh9_irradiance(torch.ones(9), up))

        expected = seen()
        with torch.autocast("cpu", dtype=torch.bfloat16):
            mixed = seen()
        for one, other in zip(mixed, expected):
            self.assertTrue(torch.equal(one, other))


if __name__ == "__main__":
    unittest.main()
