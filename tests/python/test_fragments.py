# SPDX-License-Identifier: Apache-2.0
"""tilegrad.fragments and tilegrad.compat.pytorch3d: PyTorch3D's lists of faces, against numbers by
hand and against the renderer."""

import unittest
import warnings

import numpy as np

import tilegrad
from support import needs_torch, torch
from tilegrad import fragments

if torch:
    from tilegrad.compat import pytorch3d


def random_faces(count=20, seed=0, dtype=np.float64):
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-1, 1, (count, 1, 2))
    xy = centres + rng.uniform(-0.5, 0.5, (count, 3, 2))
    z = rng.uniform(0.5, 2, (count, 3, 1))
    z[::7, 0] = -1  # some reach behind the camera
    return np.concatenate([xy, z], axis=2).astype(dtype)


def blob(count=2, size=(40, 24), dtype=np.float32):
    """A scene of `count` views of a bumpy ball in a wide image."""
    positions, faces = tilegrad.icosphere(3)
    positions = np.asarray(positions, dtype) * (1 + 0.2 * np.sin(3 * positions[:, :1]))
    camera = tilegrad.Camera.orbit(np.arange(count) * 50., np.full(count, 20.),
                                   np.full(count, 3.), width=size[0], height=size[1])
    return tilegrad.Scene(positions.astype(dtype), faces, camera)


class ToFragments(unittest.TestCase):
    def test_first_layer_is_what_the_renderer_draws(self):
        scene = blob()
        renderer = tilegrad.Renderer()
        frame = renderer.render(scene, width=40, height=24, outputs=("depth", "barycentrics"))
        got = fragments.to_fragments(frame)
        self.assertEqual(got.pix_to_face.shape, (2, 24, 40, 1))
        self.assertEqual(got.pix_to_face.dtype, np.int64)
        ids = got.pix_to_face[..., 0]
        packed = np.where(frame.face_ids < 0, -1,
                          frame.face_ids + np.array([0, len(scene.faces)])[:, None, None])
        same = ids == packed
        self.assertGreater(int((ids >= 0).sum()), 300)
        self.assertLess(int((~same).sum()), 8)  # centres on edges: the rules differ there
        seen = same & (ids >= 0)
        np.testing.assert_allclose(got.zbuf[..., 0][seen], frame.depth[seen], rtol=2e-5)
        np.testing.assert_allclose(got.bary_coords[..., 0, 1][seen],
                                   frame.barycentrics[:, 0][seen], atol=2e-3)
        self.assertTrue((got.dists[ids[..., None] >= 0] <= 0).all())
        self.assertTrue((got.zbuf[ids < 0] == -1).all())

    def test_layers_and_batches(self):
        one, both = blob(1), blob(2)
        got = fragments.to_fragments([one, both], 4, width=40, height=24, blur_radius=1e-3)
        self.assertEqual(got.bary_coords.shape, (3, 24, 40, 4, 3))
        alone = fragments.to_fragments(one, 4, width=40, height=24, blur_radius=1e-3)
        np.testing.assert_array_equal(got.zbuf[:1], alone.zbuf)
        np.testing.assert_array_equal(got.pix_to_face[0], got.pix_to_face[1] - len(one.faces)
                                      * (got.pix_to_face[1] >= 0))
        depth = np.where(got.pix_to_face < 0, np.inf, got.zbuf)
        self.assertTrue((depth[..., 1:] >= depth[..., :-1]).all())
        self.assertGreater(int((got.dists > 0).sum()), 50)  # through the blur
        sums = got.bary_coords[got.pix_to_face >= 0].sum(axis=-1)
        np.testing.assert_allclose(sums, 1, atol=1e-4)

    def test_x_is_to_the_left_and_faces_are_culled(self):
        # The viewer's right half, counter-clockwise.
        scene = tilegrad.Scene(np.float32([[0, -1, 0], [1, -1, 0], [1, 1, 0], [0, 1, 0]]),
                               [[0, 1, 2], [0, 2, 3]],
                               tilegrad.Camera.look_at((0, 0, 3), width=8, height=8))
        got = fragments.to_fragments(scene, width=8, height=8, cull_backfaces=True)
        self.assertTrue((got.pix_to_face[0, :, :4] == -1).all())
        self.assertTrue((got.pix_to_face[0, 3:5, 4:6] >= 0).all())
        turned = scene.replace(faces=[[0, 2, 1], [0, 3, 2]])
        got = fragments.to_fragments(turned, width=8, height=8, cull_backfaces=True)
        self.assertTrue((got.pix_to_face == -1).all())

    def test_behind_the_camera(self):
        scene = tilegrad.Scene(np.float32([[-9, 0, 9], [9, 0, 9], [0, 0, -9]]), [[0, 1, 2]],
                               tilegrad.Camera.look_at((0, 1, 3), width=8, height=8))
        got = fragments.to_fragments(scene, width=8, height=8)
        self.assertTrue((got.pix_to_face == -1).all())

    def test_errors(self):
        scene = blob()
        scene = scene.replace(camera=scene.camera.replace(size=None))

        def fails(error, message, *arguments, **options):
            self.assertRaisesRegex(error, message, fragments.to_fragments, *arguments, **options)

        size = {"width": 8, "height": 8}
        fails(TypeError, "clip_barycentric_coords must be bool", scene, **size,
              clip_barycentric_coords="no")
        none = scene.replace(camera=tilegrad.Camera(translation=np.zeros((0, 3))))
        fails(ValueError, "source has scenes of no image", none, **size)

        fails(TypeError, "to_fragments: source must be a Frame, a Scene or a list", 3)
        fails(ValueError, "to_fragments: source has no scene", [])
        for wrong in (-1, len(scene.positions)):
            fails(ValueError, fr"to_fragments: faces\[2\] is {wrong}, outside of \[0, ",
                  scene.replace(faces=[[0, 1, wrong]]), width=8, height=8)
        fails(ValueError, "to_fragments: scenes need width and height", scene)
        fails(ValueError, "to_fragments: faces_per_pixel is 0, expected 1..1024", scene, 0,
              width=8, height=8)
        fails(ValueError, "to_fragments: height is 0, expected 1..16384", scene, width=8, height=0)
        fails(ValueError, "blur_radius is -1", scene, width=8, height=8, blur_radius=-1)
        frame = tilegrad.Renderer().render(scene, width=8, height=8)
        fails(ValueError, "to_fragments: a Frame has its own width and height", frame, width=8)


class Meshes:
    """What rasterize_meshes asks of PyTorch3D's class: N images of the same number of faces."""

    def __init__(self, corners, images=1):
        self.corners, self.images = corners, images

    def verts_packed(self):
        return self.corners.reshape(-1, 3)

    def faces_packed(self):
        return torch.arange(3 * len(self.corners)).reshape(-1, 3)

    def num_faces_per_mesh(self):
        return torch.full((self.images,), len(self.corners) // self.images)

    def mesh_to_faces_packed_first_idx(self):
        return torch.arange(self.images) * (len(self.corners) // self.images)


def triangle():
    return torch.tensor([[[0.5, -0.5, 1], [-0.5, -0.5, 2], [0, 0.5, 4]]]).double()


@needs_torch
class RasterizeMeshes(unittest.TestCase):
    def test_numbers_by_hand(self):
        """What each option changes, at one pixel under a triangle of sides 1; all else of it is
        tests/compat/pytorch3d_raster_test.cc's."""
        corners = triangle()

        def pixel(height=1, width=1, **options):
            got = pytorch3d.rasterize_meshes(Meshes(corners), (height, width), faces_per_pixel=2,
                                             **options)
            self.assertEqual(got[0][0, 0, 0].tolist(), [0, -1])
            for missing in got[1:]:
                self.assertTrue((missing[0, 0, 0, 1] == -1).all())
            self.assertAlmostEqual(got[3][0, 0, 0, 0].item(), distance, delta=1e-12)
            return [got[1][0, 0, 0, 0].item(), *got[2][0, 0, 0, 0].tolist()]

        distance = -0.05  # its square, to a side, inside
        np.testing.assert_allclose(pixel(), [2.75, 0.25, 0.25, 0.5], rtol=1e-7)
        np.testing.assert_allclose(pixel(perspective_correct=True), [2, 0.5, 0.25, 0.25], rtol=1e-7)
        corners[..., 1] -= 0.75  # the pixel is as far above
        distance, outside = 0.0625, {"blur_radius": 0.07}
        np.testing.assert_allclose(pixel(**outside), [4.625, -0.125, -0.125, 1.25], rtol=1e-7)
        np.testing.assert_allclose(pixel(clip_barycentric_coords=True, **outside), [4, 0, 0, 1],
                                   rtol=1e-12, atol=1e-12)

    def test_images_have_rows_columns_and_faces_of_their_own(self):
        meshes = Meshes(torch.cat([triangle(), triangle() + torch.tensor([2., 0, 0])]), 2)
        ids = pytorch3d.rasterize_meshes(meshes, (1, 3), faces_per_pixel=1)[0]
        self.assertEqual(ids[..., 0].tolist(), [[[-1, 0, -1]], [[1, -1, -1]]])
        ids = pytorch3d.rasterize_meshes(meshes, (3, 1), faces_per_pixel=1)[0]
        self.assertEqual(ids[..., 0].tolist(), [[[-1], [0], [-1]], [[-1]] * 3])

    def test_gradcheck(self):
        corners = torch.from_numpy(random_faces(8, seed=2)).requires_grad_()
        for perspective, clip in ((True, True), (False, False)):
            def render(c):
                return pytorch3d.rasterize_meshes(Meshes(c), (7, 9), 0.01, 3,
                                                  perspective_correct=perspective,
                                                  clip_barycentric_coords=clip)[1:]
            self.assertTrue(torch.autograd.gradcheck(render, (corners,)))

    def test_float32_and_defaults(self):
        corners = torch.from_numpy(random_faces(dtype=np.float32)).requires_grad_()
        ids, z, bary, dists = pytorch3d.rasterize_meshes(Meshes(corners), 16)
        self.assertEqual(tuple(bary.shape), (1, 16, 16, 8, 3))
        self.assertEqual((ids.dtype, z.dtype), (torch.int64, torch.float32))
        dists[ids >= 0].sum().backward()
        self.assertGreater(float(corners.grad.abs().sum()), 0)

    def test_faces_that_cross_z_clip_value_are_left_out(self):
        corners = torch.from_numpy(random_faces())
        corners[..., 2].clamp_(min=0.5)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            ids = pytorch3d.rasterize_meshes(Meshes(corners), 16, z_clip_value=0.1)[0]
            self.assertEqual(len(caught), 0)
            cut = pytorch3d.rasterize_meshes(Meshes(corners), 16, z_clip_value=1.0)[0]
            self.assertEqual(len(caught), 1)
        near = (corners[..., 2] < 1).any(dim=1)
        self.assertTrue(near[ids[ids >= 0]].any())
        self.assertFalse(near[cut[cut >= 0]].any())

    def test_to_fragments(self):
        scene = blob(size=(16, 16))
        got = pytorch3d.to_fragments(scene, 2, width=16, height=16)
        self.assertIsInstance(got.zbuf, torch.Tensor)
        np.testing.assert_array_equal(
            got.zbuf, fragments.to_fragments(scene, 2, width=16, height=16).zbuf)

    def test_errors(self):
        corners = torch.from_numpy(random_faces())
        with self.assertRaisesRegex(TypeError, "rasterize_meshes: meshes.verts_packed.. has dtype "
                                               "torch.float16"):
            pytorch3d.rasterize_meshes(Meshes(corners.half()))
        with self.assertRaisesRegex(ValueError, "rasterize_meshes: width is 0"):
            pytorch3d.rasterize_meshes(Meshes(corners), (4, 0))
        with self.assertRaisesRegex(ValueError, "rasterize_meshes: z_clip_value"):
            pytorch3d.rasterize_meshes(Meshes(corners), z_clip_value=float("nan"))
        with self.assertRaisesRegex(ValueError, r"image_size is \(1, 2, 3\), expected pixels or"):
            pytorch3d.rasterize_meshes(Meshes(corners), (1, 2, 3))
        meshes = Meshes(corners)
        for wrong in (-1, meshes.verts_packed().shape[0]):
            faces = meshes.faces_packed().clone()
            faces[0, 1] = wrong
            meshes.faces_packed = lambda faces=faces: faces
            with self.assertRaisesRegex(ValueError, fr"faces_packed\(\)\[1\] is {wrong}, outside"):
                pytorch3d.rasterize_meshes(meshes)
        corners[3, 1, 0] = float("nan")
        with self.assertRaisesRegex(ValueError, r"face_vertices\[30\] is nan"):
            pytorch3d.rasterize_meshes(Meshes(corners))
