# SPDX-License-Identifier: Apache-2.0
"""What holds for every operation of tilegrad on torch's tape: a second
derivative is an error, never 0, in autocast results are those of float32, and bits depend on no
thread."""

import concurrent.futures
import os
import unittest

import numpy as np

import tilegrad
from support import needs_torch, torch
from test_fragments import Meshes
from test_fragments import random_faces as faces_before_the_camera
from test_kaolin import quiet, random_faces
from test_nvdiffrast import random, wavy_grid
from test_processes import in_child
from test_torch import rendered, tensors
from tilegrad import losses

if torch:
    import tilegrad.compat.nvdiffrast.torch as dr
    import tilegrad.torch
    from tilegrad.compat import kaolin, pytorch3d


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
    view = tilegrad.Camera.orbit(30, 20, 3, width=9, height=8)
    return {
        "render": (lambda p: tilegrad.torch.render(p, faces, view, width=9, height=8,
                                                   delta=1e-2).alpha, sphere),
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


@needs_torch
class Determinism(unittest.TestCase):
    """Images and gradients of whole chains, large enough that several workers share them."""

    def setUp(self):
        self.kaolins = random_faces(images=3, faces=200, dtype=torch.float32, size=0.1)
        self.addCleanup(torch.set_num_threads, torch.get_num_threads())
        self.expected = self.bits()

    def nvdiffrast(self):
        pos, tri = wavy_grid(12, images=2, dtype=torch.float32)
        pos.requires_grad_()
        attr = random(1, pos.shape[1], 2, dtype=torch.float32, requires_grad=True)
        tex = random(1, 32, 32, 3, dtype=torch.float32, requires_grad=True)
        rast, rast_db = dr.rasterize(dr.RasterizeCpuContext(), pos, tri, (150, 130))
        uv, uv_da = dr.interpolate(attr, rast, tri, rast_db, diff_attrs="all")
        color = dr.antialias(dr.texture(tex, uv, uv_da), rast, pos, tri)
        color.pow(2).mean().backward()
        return color, pos.grad, attr.grad, tex.grad

    def kaolin(self):
        corners, depth = self.kaolins[0].detach().requires_grad_(), self.kaolins[1]
        images = [image for exact in (False, True) for image in quiet(
            kaolin.render.mesh.dibr_rasterization, 70, 150, depth, corners, depth[..., None],
            torch.ones(3, 200), exact_kaolin=exact)[:2]]
        sum(image.sum() for image in images).backward()
        return *images, corners.grad

    def pytorch3d(self):
        corners = torch.tensor(faces_before_the_camera(200, dtype=np.float32), requires_grad=True)
        ids, *images = pytorch3d.rasterize_meshes(Meshes(corners, 4), (70, 150), 0.01, 3)
        sum(image.sum() for image in images).backward()
        return ids, *images, corners.grad

    def render(self):
        given = tensors(np.float32)
        positions = given["positions"].requires_grad_()
        image = rendered(given, width=70, height=90).color
        return image, torch.autograd.grad(image.sum(), positions)[0]

    def bits(self):
        return b"".join(tensor.detach().numpy().tobytes() for work in (
            self.render, self.nvdiffrast, self.kaolin, self.pytorch3d) for tensor in work())

    def test_any_number_of_threads(self):
        for count in (1, 2, 7):
            torch.set_num_threads(count)
            self.assertTrue(self.bits() == self.expected, count)

    def test_small_numbers_where_the_caller_flushes_them(self):
        pos, tri = wavy_grid(2, dtype=torch.float32)
        attr = torch.full((1, 9, 1), 1e-39)
        rast, _ = dr.rasterize(dr.RasterizeCpuContext(), pos, tri, (64, 64))
        expected = dr.interpolate(attr, rast, tri)[0].numpy().view(np.int32)
        self.assertTrue(expected.any())
        if not torch.set_flush_denormal(True):
            self.skipTest("torch cannot flush on this processor")
        self.addCleanup(torch.set_flush_denormal, False)
        got = dr.interpolate(attr, rast, tri)[0].numpy().view(np.int32)
        np.testing.assert_array_equal(got, expected)

    def test_python_threads_and_a_fork(self):
        with concurrent.futures.ThreadPoolExecutor(4) as pool:
            for got in [pool.submit(self.bits) for _ in range(4)]:
                self.assertTrue(got.result() == self.expected)

        def child():
            os.environ["TILEGRAD_NUM_THREADS"] = "3"
            torch.set_num_threads(1)  # torch's own do not survive a fork
            return self.bits() == self.expected

        self.assertTrue(in_child(child))


@needs_torch
class Operations(unittest.TestCase):
    def test_second_derivatives_are_errors(self):
        functional = torch.autograd.functional
        for name, (function, start) in operations().items():
            torch.manual_seed(3)

            def linear(value, function=function):
                return function(value).sum()

            def square(value, function=function):
                return function(value).square().sum()

            ones = torch.ones_like(start)
            for loss in (linear, square):
                leaf = start.clone().requires_grad_()
                gradient, = torch.autograd.grad(loss(leaf), leaf, create_graph=True)
                for ask in (lambda loss=loss: functional.hessian(loss, start),
                            lambda loss=loss: functional.jvp(loss, start, ones),
                            lambda loss=loss: functional.hvp(loss, start, ones),
                            lambda loss=loss: functional.vhp(loss, start, ones),
                            (gradient.norm() - 1).square().backward):
                    with self.subTest(name):
                        self.assertRaisesRegex(RuntimeError, "first derivatives only", ask)

    def test_first_derivatives_are_the_same_with_a_graph(self):
        for name, (function, start) in operations().items():
            gradients = []
            for create_graph in (False, True):
                torch.manual_seed(3)
                leaf = start.clone().requires_grad_()
                gradients += torch.autograd.grad(function(leaf).sum(), leaf,
                                                 create_graph=create_graph)
            torch.manual_seed(3)
            gradients.append(torch.autograd.functional.jacobian(lambda x, f=function: f(x).sum(),
                                                                start))
            for other in gradients[1:]:
                self.assertTrue(torch.equal(gradients[0], other), name)

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
