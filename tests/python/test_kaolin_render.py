# SPDX-License-Identifier: Apache-2.0
"""tilegrad.compat.kaolin.render: Camera and spherical Gaussians, by hand, by integration."""

import copy
import math
import unittest

import numpy as np

from support import require_torch, torch
from test_kaolin import double, quiet

if torch:
    import tilegrad.compat.kaolin as kaolin
    from tilegrad.compat.kaolin.render.camera import Camera, CameraFOV
    lighting = kaolin.render.lighting

setUpModule = require_torch


def camera(**changes):
    """At (0, 0, 4), towards the origin, 90 degrees, 200 x 100 pixels."""
    return Camera.from_args(**{**dict(
        eye=[0., 0, 4], at=[0., 0, 0], up=[0., 1, 0], fov=math.pi / 2, width=200, height=100,
        near=1., far=9., dtype=torch.float64), **changes})


class CameraTest(unittest.TestCase):
    def assert_near(self, got, expected, tolerance=1e-12):
        self.assertLess(float((got - double(expected)).abs().max()), tolerance)


class Constructors(CameraTest):
    def test_by_hand(self):
        c = camera()
        self.assert_near(c.view_matrix(),
                         [[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -4], [0, 0, 0, 1]]])
        self.assert_near(c.cam_pos(), [[[0], [0], [4]]])
        self.assert_near(c.focal_x, [50])
        self.assert_near(c.fov_y, [90])
        self.assert_near(c.tan_half_fov(CameraFOV.HORIZONTAL), [2])
        self.assertEqual((c.width, c.height, c.lens_type, len(c), c.dtype),
                         (200, 100, "pinhole", 1, torch.float64))
        # x / (z tan), of twice the width; near and far are -1 and 1.
        self.assert_near(c.transform(double([[8., 0, 0], [0, 2, 0], [0, 0, 3], [0, 0, -5]])),
                         [[1, 0, 0.6875], [0, 0.5, 0.6875], [0, 0, -1], [0, 0, 1]])

    def test_all_ways_are_one(self):
        c = camera(eye=[1., 2, 3])
        pose = c.inv_view_matrix()[0]
        others = [dict(cam_pos=pose[:3, 3], cam_dir=pose[:3, :3]),
                  dict(view_matrix=c.view_matrix()[0])]
        size = dict(width=200, height=100, near=1., far=9., dtype=torch.float64)
        for place in others:
            for lens in (dict(fov=math.pi / 2), dict(focal_x=50.), dict(focal_x=50., focal_y=50.),
                         dict(fov=2 * math.atan(2), fov_direction=CameraFOV.HORIZONTAL)):
                other = Camera.from_args(**place, **lens, **size)
                self.assert_near(other.view_projection_matrix(),
                                 c.view_projection_matrix().tolist())

    def test_batches(self):
        eyes = double([[0., 0, 4], [3, 0, 0]])
        both = camera(eye=eyes, fov=double([1., 2]))
        self.assertEqual((len(both), tuple(both.transform(torch.zeros(5, 3).double()).shape)),
                         (2, (2, 5, 3)))
        single = [camera(eye=eye, fov=fov) for eye, fov in zip(eyes, (1., 2.))]
        for joined in (Camera.cat(single), both):
            self.assert_near(joined.view_projection_matrix(),
                             torch.cat([c.view_projection_matrix() for c in single]).tolist())
        self.assert_near(both[-1].view_projection_matrix(),
                         single[1].view_projection_matrix().tolist())
        self.assertEqual(both.float().view_matrix().dtype, torch.float32)
        self.assertIs(both.cuda(), both)
        self.assertEqual(len(copy.deepcopy(both)), 2)

    def test_errors(self):
        with self.assertRaisesRegex(ValueError, "expected one of eye, cam_pos, view_matrix"):
            Camera.from_args(fov=1., width=8, height=8)
        with self.assertRaisesRegex(ValueError, "expected one of fov, focal_x"):
            Camera.from_args(eye=[0, 0, 1], at=[0, 0, 0], up=[0, 1, 0], fov_distance=1., width=8,
                             height=8)
        self.assertRaisesRegex(TypeError, "no_such", camera, no_such=1)
        self.assertRaisesRegex(ValueError, "near before far", camera, near=10.)
        with self.assertRaisesRegex(AttributeError, "'no_such': docs/porting.md"):
            getattr(camera(), "no_such")
        with self.assertRaisesRegex(ValueError, "extrinsics of 2 cameras, intrinsics of 1"):
            camera(eye=double([[0., 0, 4], [3, 0, 0]]), num_cameras=1)

    def test_cameras_of_a_batch(self):
        cameras = camera(eye=[[0., 0, 4], [0, 0, 5]])
        self.assertEqual([float(c.cam_pos()[0, 2]) for c in cameras], [4, 5])
        self.assertEqual(float(cameras[-2].cam_pos()[0, 2]), 4)
        for item in (2, -3):
            self.assertRaisesRegex(IndexError, f"item {item} of 2", cameras.__getitem__, item)

    def test_an_up_along_the_view_is_an_error(self):
        """Such cameras have no rotation: they would show nothing, in silence."""
        older = kaolin.render.camera
        eye = double([[0., 0, 4], [0, -3, 0]])
        for up, where in (([0., 1, 0], 1), ([0., 0, -2], 0), ([0., 0, 0], 0)):
            place = eye, torch.zeros(2, 3).double(), double([up])
            for name, make in (
                    ("from_lookat", lambda: camera(eye=eye, up=up)),
                    ("generate_rotate_translate_matrices",
                     lambda: older.generate_rotate_translate_matrices(*place)),
                    ("generate_transformation_matrix",
                     lambda: older.generate_transformation_matrix(*place))):
                with self.assertRaisesRegex(ValueError, f"{name}: camera {where}: up is 0 or along"):
                    make()
        self.assertRaisesRegex(ValueError, "along the view", camera, eye=[1., 2, 3], at=[1., 2, 3])
        almost = camera(eye=[0., 4, 1e-4])
        self.assert_near(almost.R @ almost.R.transpose(1, 2), torch.eye(3)[None].tolist())


class Transforms(CameraTest):
    def test_principal_point_and_rays_agree_with_the_projection(self):
        c = camera(eye=[1., 2, 3], x0=7., y0=-5.)
        self.assert_near(torch.stack([c.cx, c.cy]), [[107], [45]])
        begin, along = c.generate_rays()
        self.assertEqual(tuple(along.shape), (200 * 100, 3))
        self.assert_near(along.norm(dim=1), 1.)
        self.assert_near(begin[0], [1, 2, 3])
        y, x = kaolin.render.camera.generate_centered_pixel_coords(200, 100)
        ndc = c.transform(begin + 5 * along)
        self.assert_near(100 + 100 * ndc[:, 0] - x.reshape(-1), 0., 1e-10)
        self.assert_near(50 - 50 * ndc[:, 1] - y.reshape(-1), 0., 1e-10)

    def test_the_same_as_the_older_functions(self):
        c = camera(eye=[1., 2, 3])
        older = kaolin.render.camera
        transform = older.generate_transformation_matrix(
            double([[1., 2, 3]]), double([[0., 0, 0]]), double([[0., 1, 0]]))
        points = torch.randn(1, 6, 3).double()
        in_camera = points @ transform[:, :3] + transform[:, 3:]
        self.assert_near(c.extrinsics.transform(points), in_camera.tolist(), 1e-9)
        projected = older.perspective_camera(
            in_camera, older.generate_perspective_projection(math.pi / 2, 2, torch.float64))
        self.assert_near(c.transform(points)[..., :2], projected.tolist(), 1e-8)

    def test_moves(self):
        c = camera(eye=[0., 0, 4])
        c.move_forward(1.)
        c.move_right(2.)
        c.move_up(3.)
        self.assert_near(c.cam_pos()[0, :, 0], [2, 3, 5])
        c.translate(double([1., 1, 1]))
        self.assert_near(c.cam_pos()[0, :, 0], [3, 4, 6])
        c = camera(eye=[0., 0, 4])
        c.rotate(yaw=math.pi / 2)  # looks along +x then: its z axis is -x
        self.assert_near(c.cam_forward()[0, :, 0].abs(), [1, 0, 0])
        c.rotate(pitch=0.3, roll=double([0.2]))
        self.assert_near(c.R[0] @ c.R[0].T, np.eye(3).tolist())
        self.assert_near(torch.cat([c.cam_right(), c.cam_up(), c.cam_forward()], -1)[0],
                         c.R[0].T.tolist())

    def test_gradients(self):
        eye = double([[1., 2, 3]]).requires_grad_()
        focal = double([60.]).requires_grad_()
        points = torch.randn(4, 3).double().requires_grad_()
        self.assertTrue(torch.autograd.gradcheck(
            lambda e, f, p: Camera.from_args(
                eye=e, at=[0., 0, 0], up=[0., 1, 0], focal_x=f, width=200, height=100,
                dtype=torch.float64).transform(p), (eye, focal, points)))

    def test_draws_with_dibr(self):
        c = camera(eye=[0., 0, 4], width=96, height=96)
        vertices = double([[-1., -1, 0], [1, -1, 0], [0, 1, 0]])
        in_camera, ndc = c.extrinsics.transform(vertices), c.transform(vertices)
        faces = torch.tensor([[0, 1, 2]])
        corners = kaolin.ops.mesh.index_vertices_by_faces(in_camera, faces)
        on_image = kaolin.ops.mesh.index_vertices_by_faces(ndc[None, :, :2], faces)
        _, mask, ids = quiet(kaolin.render.mesh.dibr_rasterization, 96, 96, corners[..., 2],
                             on_image, corners, torch.ones(1, 1))
        self.assertEqual(int((ids >= 0).sum()), 24 * 24 // 2)  # no centre is on an edge
        self.assertEqual(mask[0, 48, 48].item(), 1)


def directions(steps=400):
    """An even grid of directions on the sphere, and the solid angle of each."""
    z = (torch.arange(steps).double() + 0.5) / steps * 2 - 1
    turn = (torch.arange(2 * steps).double() + 0.5) / steps * math.pi
    z, turn = (t.reshape(-1) for t in torch.meshgrid(z, turn, indexing="ij"))
    across = torch.sqrt(1 - z**2)
    return (torch.stack([across * torch.cos(turn), across * torch.sin(turn), z], dim=1),
            4 * math.pi / len(z))


class SphericalGaussians(unittest.TestCase):
    def setUp(self):
        torch.manual_seed(0)
        self.lights = (torch.rand(3, 3).double(), self.unit(3), double([1.5, 4., 20]))
        self.normal, self.view = self.unit(5), self.unit(5)

    @staticmethod
    def unit(count):
        return torch.nn.functional.normalize(torch.randn(count, 3).double(), dim=1)

    def radiance(self, v):
        amplitude, direction, sharpness = self.lights
        return torch.exp(sharpness * (v @ direction.T - 1)) @ amplitude

    def test_inner_product_by_integration(self):
        v, solid_angle = directions()
        lobe = 1.17 * torch.exp(2.133 * (v @ self.normal.T - 1))
        expected = solid_angle * lobe.T @ self.radiance(v)
        got = lighting.sg_irradiance_inner_product(*self.lights, self.normal)
        self.assertLess(float((got - expected).abs().max()), 1e-4)  # of the grid
        diffuse = lighting.sg_diffuse_inner_product(*self.lights, self.normal, self.lights[0][:1]
                                                    .expand(5, 3))
        self.assertTrue(torch.allclose(diffuse, got * self.lights[0][:1] / math.pi))

    def test_fitted_irradiance_is_near_the_integral(self):
        v, solid_angle = directions()
        cosine = (v @ self.normal.T).clamp(min=0)
        expected = solid_angle * cosine.T @ self.radiance(v)
        got = lighting.sg_irradiance_fitted(*self.lights, self.normal)
        self.assertEqual(tuple(got.shape), (5, 3, 3))
        # Hill's fit is good to some percent of a light's integral.
        whole = lighting.approximate_sg_integral(self.lights[0], self.lights[2]).sum(dim=0)
        self.assertLess(float(((got.sum(dim=1) - expected) / whole).abs().max()), 0.03)
        diffuse = lighting.sg_diffuse_fitted(*self.lights, self.normal, torch.ones(5, 3).double())
        self.assertTrue(torch.allclose(diffuse, got.sum(dim=1).clamp(min=0) / math.pi))

    def test_specular_by_hand(self):
        """Straight from above, one light much wider than the lobe: the lobe's integral."""
        up = double([[0., 0, 1]])
        wide = (double([[2., 2, 2]]), up, double([1e-3]))
        m = 0.1
        got = lighting.sg_warp_specular_term(*wide, up, double([m]), up, double([[0.04] * 3]))
        sharpness = 2 / m**2 / 4
        lobe = 2 * math.pi / (math.pi * m**2) / sharpness  # 4: dh = dl / 4
        expected = 2 * lobe * 0.04 / 4  # two factors of visibility, 1 / 2 each
        self.assertAlmostEqual(got[0, 0].item() / expected, 1, places=2)
        self.assertTrue(torch.equal(lighting.fresnel(double([1., 0]), double([0.3, 0.3])),
                                    double([0.3, 1])))

    def test_suns_and_parameters(self):
        amplitude, direction, sharpness = lighting.sg_from_sun(
            self.normal, 3 * torch.ones(5).double(), 0.5 * torch.ones(5).double(),
            torch.ones(5, 3).double())
        self.assertTrue(torch.equal(direction, self.normal))
        rim = amplitude[0, 0] * torch.exp(sharpness[0] * (math.cos(0.25) - 1))
        self.assertAlmostEqual(rim.item(), 0.5, places=12)
        lights = lighting.SgLightingParameters.from_sun(self.normal, angle=0.5)
        self.assertTrue(torch.allclose(lights.amplitude, amplitude))
        self.assertTrue(torch.allclose(lights.sharpness, sharpness))
        plain = lighting.SgLightingParameters().cuda()
        self.assertEqual([tuple(t.shape) for t in (plain.amplitude, plain.direction,
                                                   plain.sharpness)], [(1, 3), (1, 3), (1,)])
        many = lighting.SgLightingParameters(2., torch.tensor([[0., 3, 0], [4, 0, 0]]))
        self.assertEqual(many.direction.tolist(), [[0, 1, 0], [1, 0, 0]])
        self.assertEqual(many.amplitude.tolist(), 2 * [[2, 2, 2]])
        towards = lighting.sg_direction_from_azimuth_elevation
        self.assertLess(float((towards(math.pi / 2, 0.) - torch.tensor([1., 0, 0])).abs().max()),
                        1e-6)
        self.assertLess(float((towards(0., math.pi / 6) -
                               torch.tensor([0., 0.5, 0.75**0.5])).abs().max()), 1e-6)

    def test_gradients(self):
        albedo = torch.rand(5, 3).double()
        inputs = [t.requires_grad_() for t in (*self.lights, self.normal, albedo)]
        self.assertTrue(torch.autograd.gradcheck(lighting.sg_diffuse_inner_product, inputs))
        self.assertTrue(torch.autograd.gradcheck(lighting.sg_diffuse_fitted, inputs))
        roughness = (torch.rand(5) + 0.2).double().requires_grad_()
        view = torch.nn.functional.normalize(self.normal.detach() + 0.3 * self.view, dim=1)
        self.assertTrue(torch.autograd.gradcheck(
            lighting.sg_warp_specular_term,
            (*self.lights, self.normal, roughness, view.requires_grad_(), albedo)))

    def test_lobes_that_cancel(self):
        """The integral of exp(-2 sharpness), for a light opposite the normal as sharp as the cosine
        lobe; and beside it, where the quotient is a series."""
        inputs = [t.requires_grad_() for t in (double([[1., 1, 1]]), double([[0., 0, -1]]),
                                               double([2.133]), double([[0., 0, 1]]))]
        value = lighting.sg_irradiance_inner_product(*inputs)
        self.assertAlmostEqual(value[0, 0].item(), 4 * math.pi * 1.17 * math.exp(-4.266))
        value.sum().backward()
        self.assertTrue(all(torch.isfinite(t.grad).all() for t in inputs))
        length = double([0., 1e-9, 0.99e-4, 1.01e-4, 1]).requires_grad_()
        self.assertTrue(torch.autograd.gradcheck(lighting._decay_ratio, length))

    def test_errors(self):
        with self.assertRaisesRegex(ValueError, "sg_irradiance_fitted: sharpness has shape"):
            lighting.sg_irradiance_fitted(*self.lights[:2], self.lights[2][:2], self.normal)
