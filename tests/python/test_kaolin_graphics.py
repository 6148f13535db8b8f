# SPDX-License-Identifier: Apache-2.0
"""tilegrad.compat.kaolin.graphics, Kaolin 0.1's interface: shading by hand, cameras, gradients."""

import math
import unittest

import numpy as np

from support import require_torch, torch
from test_kaolin import double, quiet

if torch:
    import tilegrad.compat.kaolin as kaolin
    from tilegrad.compat.kaolin.graphics import DIBRenderer as Renderer
    from tilegrad.compat.kaolin.graphics.dib_renderer.rasterizer import linear_rasterizer
    from tilegrad.compat.kaolin.graphics.dib_renderer.utils import (
        lookatnp, perspectiveprojectionnp, sphericalcoord)

SIZE = 17

setUpModule = require_torch


def quad():
    """In the plane x = 0, z from -1 to 1 and y from -1 to 1, seen from +x: its corners counted from
    the lower left; and its uvs."""
    vertices = torch.tensor([[[0., -1, 1], [0, -1, -1], [0, 1, -1], [0, 1, 1]]])
    return ([vertices, torch.tensor([[0, 1, 2], [0, 2, 3]])],
            torch.tensor([[[0., 0], [1, 0], [1, 1], [0, 1]]]))


def draw(mode, *arguments, **options):
    """From (4, 0, 0); the quad covers half of the image, and so the pixel in the middle."""
    renderer = Renderer(SIZE, SIZE, mode=mode, camera_fov_y=2 * math.atan(0.5))
    renderer.set_look_at_parameters([0], [0], [4])
    return quiet(renderer, quad()[0], *arguments, **options)


class Modes(unittest.TestCase):
    def middle(self, images):
        return images[0][0, SIZE // 2, SIZE // 2].tolist()

    def assert_near(self, got, expected):
        for a, b in zip(got, expected):
            self.assertAlmostEqual(a, b, places=5)

    def test_vertex_colors(self):
        y = quad()[0][0][..., 1:2]
        image, mask, normals = draw("VertexColor", (y + 1) / 2 * torch.ones(3))
        self.assertEqual([tuple(t.shape) for t in (image, mask, normals)],
                         [(1, SIZE, SIZE, 3), (1, SIZE, SIZE, 1), (1, 2, 3)])
        self.assert_near(normals[0].flatten().tolist(), 2 * [0, 0, 1])
        self.assert_near(image[0, SIZE // 2, SIZE // 2].tolist(), 3 * [0.5])
        self.assertGreater(image[0, SIZE // 2 - 3, SIZE // 2, 0].item(), 0.6)  # up is up
        self.assertEqual((image[0, 0].abs().max().item(), mask[0, SIZE // 2, SIZE // 2].item()),
                         (0, 1))
        again, _, _ = draw("VertexColor", colors_bxpx3=(y + 1) / 2 * torch.ones(3))
        self.assertTrue(torch.equal(again, image))

    def test_texture(self):
        texture = torch.zeros(1, 3, 2, 2)
        texture[0, 0, 0, 1], texture[0, 1, 1, 0] = 1, 1  # red: upper right; green: lower left
        image, _, _ = draw("Lambertian", uv_bxpx2=quad()[1], texture_bx3xthxtw=texture)
        near, far = SIZE // 2 - 2, SIZE // 2 + 2
        self.assertEqual(image[0, near, far].tolist(), [1, 0, 0])
        self.assertEqual(image[0, far, near].tolist(), [0, 1, 0])
        self.assertEqual(image[0, near, near].tolist(), [0, 0, 0])
        shifted, _, _ = draw("Lambertian", quad()[1] * 0.5 + 0.26, texture)
        wrapped, _, _ = draw("Lambertian", quad()[1] * 0.5 - 2.74, texture)
        self.assertTrue(torch.allclose(shifted, wrapped, atol=1e-5))
        faces = torch.tensor([[0, 0, 0], [0, 0, 0]])
        lower, _, _ = draw("Lambertian", quad()[1] + 0.25, texture, faces)
        self.assertEqual(self.middle([lower]), [0, 1, 0])

    def test_spherical_harmonics_by_hand(self):
        light = torch.tensor([[1., 5, 0.5, 5, 5, 5, 2, 5, 5]])
        texture = torch.full((1, 3, 2, 2), 0.5)
        expected = 0.5 * (0.2820948 + 0.5 * 0.325735 + 2 * (0.1365686 - 0.0788479))
        self.assert_near(self.middle(draw("SphericalHarmonics", quad()[1], texture, light)),
                         3 * [expected])

    def test_phong_by_hand(self):
        texture = torch.full((1, 3, 2, 2), 0.5)
        material = torch.tensor([[[0.1, 0.1, 0.1], [0.4, 0.2, 0], [0.3, 0, 0]]])
        for angle in (0., 0.5):
            light = torch.tensor([[0., 3 * math.sin(angle), 3 * math.cos(angle)]])
            got = self.middle(draw("Phong", quad()[1], texture, light, material,
                                   torch.tensor([[4.]])))
            facing = math.cos(angle)
            self.assert_near(got, [(0.1 + 0.4 * facing) * 0.5 + 0.3 * facing**4,
                                   (0.1 + 0.2 * facing) * 0.5, 0.05])

    def test_smooth_normals(self):
        renderer = Renderer(SIZE, SIZE, mode="SphericalHarmonics")
        renderer.set_look_at_parameters([0], [0], [4])
        points, uv = quad()
        points[0][0, 3, 0] = -2  # a fold
        arguments = (points, uv, torch.ones(1, 3, 2, 2), torch.tensor([[0., 0, 1] + 6 * [0]]))
        flat = quiet(renderer, *arguments)[0]
        renderer.renderer.set_smooth(np.array([[0.5, 0.5], [1, 0], [0.5, 0.5], [0, 1]]))
        smooth = quiet(renderer, *arguments)[0]
        self.assertEqual(len(set(flat[flat > 0].round(decimals=4).tolist())), 2)
        self.assertGreater(len(set(smooth[smooth > 0].round(decimals=4).tolist())), 10)


class Interface(unittest.TestCase):
    def test_the_same_as_the_later_functions(self):
        torch.manual_seed(0)
        corners, on_image = torch.rand(2, 5, 3, 3), 2 * torch.rand(2, 5, 3, 2) - 1
        colors, normals = torch.rand(2, 5, 3, 4), torch.rand(2, 5, 1) - 0.3
        got = quiet(linear_rasterizer, 8, 12, corners.reshape(2, 5, 9), on_image.reshape(2, 5, 6),
                    normals, colors.reshape(2, 5, 12), None, None, None, 500)
        image, mask, _ = quiet(kaolin.render.mesh.dibr_rasterization, 8, 12, corners[..., 2],
                               on_image, colors, normals, 500)
        self.assertTrue(torch.equal(got[0], image))
        self.assertTrue(torch.equal(got[1][..., 0], mask))

    def test_gradients(self):
        renderer = Renderer(9, 9, mode="Lambertian")
        renderer.set_camera_parameters([
            torch.eye(3).double()[None], double([[0., 0, 4]]),
            torch.from_numpy(perspectiveprojectionnp(1.)).double()])
        faces = torch.tensor([[0, 1, 2], [0, 2, 3]])
        vertices = double([[[-1.1, -1, 0.1], [1.2, -1, 0], [1, 1.1, 0], [-1, 1, 0.2]]])
        uv = quad()[1].double() * 0.9 + 0.05
        texture = torch.rand(1, 3, 4, 4).double()
        for tensor in (vertices, uv, texture):
            tensor.requires_grad_()
        renderer.renderer.filtering = "bilinear"
        self.assertTrue(torch.autograd.gradcheck(
            lambda v, t, x: quiet(renderer, [v, faces], t, x), (vertices, uv, texture)))

    def test_cameras(self):
        renderer = Renderer(8, 8)
        renderer.set_look_at_parameters([90, 0], [0, 30], [2, 4])
        rotation, position, projection = renderer.camera_params
        expected = [[0, 0, 2], [4 * math.cos(math.pi / 6), 2, 0]]
        self.assertLess(float((position - torch.tensor(expected)).abs().max()), 1e-6)
        self.assertAlmostEqual(projection[1, 0].item(),
                               1 / math.tan(math.radians(49.13434207744484) / 2), places=5)
        forward = rotation @ (position / position.norm(dim=1, keepdim=True)).unsqueeze(-1)
        self.assertLess(float((forward[..., 0] - torch.tensor([0., 0, 1])).abs().max()), 1e-6)
        with self.assertRaisesRegex(ValueError, "camera 0: up is 0 or along the view"):
            renderer.set_look_at_parameters([0], [90], [2])
        view, shift = lookatnp(*(np.reshape(v, (3, 1)) for v in ([1., 2, 3], [0, 0, 0], [0, 1, 0])))
        self.assertTrue(np.allclose(view @ view.T, np.eye(3), atol=1e-6))
        self.assertTrue(np.allclose(view @ np.zeros((3, 1)) + shift, [[0], [0], [-14**0.5]],
                                    atol=1e-6))

    def test_spherical_coordinates_by_hand(self):
        points = np.array([[1., 0, 0], [0, 2, 0], [0, 0, 3]])
        self.assertTrue(np.allclose(sphericalcoord.get_spherical_coords_x(points),
                                    [[-1, 0], [0, 0], [0, 0.5]]))
        self.assertTrue(np.allclose(sphericalcoord.get_spherical_coords_z(points),
                                    [[0, 0], [0.5, 0], [0, -1]]))

    def test_errors(self):
        renderer = Renderer(8, 8)
        with self.assertRaisesRegex(ValueError, "Renderer: 1 cameras, but points for 2 images"):
            renderer([torch.zeros(2, 3, 3), torch.tensor([[0, 1, 2]])], torch.zeros(2, 3, 3))
        with self.assertRaisesRegex(ValueError, "mode is 'Gouraud', expected one of 'VertexColor'"):
            Renderer(8, 8, mode="Gouraud")
        with self.assertRaisesRegex(AttributeError, "'SoftRenderer': .*docs/porting.md"):
            getattr(kaolin.graphics, "SoftRenderer")
