# SPDX-License-Identifier: Apache-2.0
"""Cameras: where a world point lands (docs/rendering.md), there and back, batches, errors."""

import json
import pickle
import unittest

import numpy as np

import tilegrad
from file_samples import FolderTest
from tilegrad import Camera, cameras

# The camera and the point of docs/rendering.md.
SIZE = {"width": 640, "height": 480}
POINT = np.array([0.4, 0.3, 0.0])
EXPECTED = Camera(translation=(-1, 0, -4), fx=500, fy=500, cx=320, cy=240)


def pixel(camera, point):
    p = camera.rotation @ point + camera.translation
    return np.array([camera.cx + camera.fx * p[0] / -p[2], camera.cy - camera.fy * p[1] / -p[2]])


class Conventions(unittest.TestCase):
    def expect(self, camera):
        np.testing.assert_allclose(pixel(camera, POINT), (245, 202.5), rtol=0, atol=1e-4)

    def test_the_point_of_the_page(self):
        self.expect(EXPECTED)
        flip = np.diag([1.0, -1, -1])
        k = [[500, 0, 319.5], [0, 500, 239.5], [0, 0, 1]]
        self.expect(Camera.from_opencv(k, flip, (-1, 0, 4)))
        k = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]
        self.expect(Camera.from_opencv(k, flip, (-1, 0, 4), pixel_centre="half"))
        self.expect(Camera.from_colmap((0, 1, 0, 0), (-1, 0, 4), 500, 500, 320, 240))
        view = np.eye(4)
        view[:3, 3] = -1, 0, -4
        projection = np.diag([1.5625, 500 / 240, 0, 0])
        projection[2, 2:], projection[3, 2] = (-1.02, -0.202), -1
        self.expect(Camera.from_opengl(projection, view, **SIZE))
        self.expect(Camera.from_kaolin(np.eye(3), (1, 0, 4), (1.5625, 500 / 240, -1), **SIZE))
        focal = 500 / 240
        self.expect(Camera.from_pytorch3d(np.diag([-1.0, 1, -1]), (1, 0, 4), (focal, focal),
                                          **SIZE))
        to_world = np.eye(4)
        to_world[:3, 3] = 1, 0, 4
        self.expect(Camera.from_nerf(to_world, 500, 500, 320, 240))
        fov = np.degrees(2 * np.arctan(240 / 500))
        self.expect(Camera.look_at((1, 0, 4), (1, 0, 0), fov_y=fov, **SIZE))

    def test_look_at_and_orbit_have_the_digits_of_float64(self):
        orbit = Camera.orbit(30, 20, 5, fov_y=40, **SIZE)
        az, el = np.radians([30, 20])
        eye = 5 * np.array([np.cos(el) * np.cos(az), np.sin(el), np.cos(el) * np.sin(az)])
        look = Camera.look_at(eye, fov_y=40, **SIZE)
        for camera in (orbit, look):  # a few roundings of numbers up to 5
            np.testing.assert_allclose(pixel(camera, np.zeros(3)), (320, 240), atol=1e-3)
            np.testing.assert_allclose(-camera.rotation.T @ camera.translation, eye, rtol=0,
                                       atol=5e-15)
            np.testing.assert_allclose(camera.rotation @ camera.rotation.T, np.eye(3), rtol=0,
                                       atol=2e-15)
            self.assertAlmostEqual(camera.fy, 240 / np.tan(np.radians(20)), delta=1e-12)
            self.assertEqual(camera.near_plane, 0.01)
        near = Camera.look_at((0, 0, 1 + 1e-9), (0, 0, 1), **SIZE)  # one point to float
        np.testing.assert_array_equal(near.rotation, np.eye(3))


class Batches(unittest.TestCase):
    def test_leading_axes_are_broadcast(self):
        cameras = Camera(translation=np.zeros((4, 3)), fx=[1, 2, 3, 4], cy=7)
        self.assertEqual(len(cameras), 4)
        self.assertEqual(cameras.rotation.shape, (4, 3, 3))
        self.assertEqual(cameras.fx.tolist(), [1, 2, 3, 4])
        self.assertEqual(cameras[1:3].fx.tolist(), [2, 3])
        self.assertEqual(cameras[3].fx, 4)
        eyes = np.array([(1.0, 0, 4), (0, 0, 3)])
        both = Camera.look_at(eyes, (0, 0, 0), **SIZE)
        for i in range(2):
            one = Camera.look_at(eyes[i], **SIZE)
            self.assertEqual(both[i].numbers.tolist(), one.numbers.tolist())
        orbits = Camera.orbit([0, 90, 180], 20, 3, **SIZE)
        self.assertEqual(len(orbits), 3)

    def test_replace_keeps_the_rest(self):
        moved = EXPECTED.replace(translation=(0, 0, -3))
        self.assertEqual(moved.translation.tolist(), [0, 0, -3])
        self.assertEqual(moved.fx, 500)
        self.assertEqual(EXPECTED.translation.tolist(), [-1, 0, -4])

    def test_views_write_through(self):
        cameras = Camera(translation=np.zeros((3, 3)), fx=[1, 2, 3])
        cameras.translation[1] += 1
        cameras.fx[2] = 9
        self.assertEqual(cameras.numbers[2, 12], 9)


class Sizes(unittest.TestCase):
    """A camera knows the size of the image that it is for; an image of another size is an error."""

    def test_who_knows_it(self):
        own = (64, 48)
        wide = {"width": 64, "height": 48}
        orbit = Camera.orbit([0, 90], 20, 3, **wide)
        sphere = tilegrad.icosphere(1)
        for camera in (orbit, orbit[1], orbit[:1], orbit.replace(near_plane=0.1),
                       pickle.loads(pickle.dumps(orbit)), Camera(size=own),
                       Camera.look_at((0, 0, 3), **wide), Camera.framing(sphere, **wide),
                       Camera.from_opengl(**orbit.to_opengl(**wide, far_plane=9), **wide),
                       Camera.from_kaolin(**orbit.to_kaolin(**wide), **wide),
                       Camera.from_pytorch3d(**orbit.to_pytorch3d(**wide), **wide),
                       Camera.from_opencv(**orbit.to_opencv(), size=own),
                       Camera.from_colmap(**orbit.to_colmap(), size=own),
                       Camera.from_nerf(**orbit.to_nerf(), size=own),
                       orbit.resize(64, 48, 9, 7).resize(9, 7, 64, 48),
                       tilegrad.Scene(*sphere, orbit).camera):
            self.assertEqual(camera.size, own)
            self.assertIn("size=(64, 48)", repr(camera))
        for camera in (Camera(), orbit.replace(size=None), Camera.of_numbers(orbit.numbers),
                       Camera.from_nerf(**orbit.to_nerf())):
            self.assertIsNone(camera.size)

    def test_images_have_it_unless_told_otherwise(self):
        camera = Camera.orbit([0, 90], 20, 3, width=24, height=16)
        scene = tilegrad.Scene(*tilegrad.icosphere(1), camera)
        self.assertEqual(tilegrad.Renderer(1).render(scene).alpha.shape, (2, 16, 24))
        self.assertEqual(tilegrad.fragments.to_fragments(scene).zbuf.shape, (2, 16, 24, 1))
        frame = tilegrad.render(tilegrad.icosphere(1), camera)
        self.assertEqual(frame.alpha.shape, (2, 16, 24))

    def test_another_size_is_an_error_everywhere(self):
        camera = Camera.orbit(30, 20, 3, width=64, height=64)
        mesh = tilegrad.icosphere(1)
        scene = tilegrad.Scene(*mesh, camera)
        plain = scene.replace(camera=camera.replace(size=None))
        double = {"width": 128, "height": 128}
        view = tilegrad.files.View("a", camera, 128, 128)
        for call in (lambda: tilegrad.Renderer(1).render(scene, **double),
                     lambda: tilegrad.Renderer(1).render([plain, scene], **double),
                     lambda: tilegrad.Renderer(1).render(scene, height=128, width=64),
                     lambda: tilegrad.render(mesh, camera, **double),
                     lambda: tilegrad.fragments.to_fragments(scene, **double),
                     lambda: tilegrad.fit(np.zeros((2, 128, 128, 4), np.uint8),
                                          Camera.orbit([0, 90], 20, 3, width=64, height=64)),
                     lambda: tilegrad.files.save_cameras("unwritten.json", [view]),
                     lambda: camera.to_opengl(**double, far_plane=9),
                     lambda: camera.to_kaolin(**double), lambda: camera.to_pytorch3d(**double),
                     lambda: camera.resize(128, 128, 64, 64)):
            self.assertRaisesRegex(ValueError, "the camera is for images of 64 x 64 pixels", call)

    def test_the_same_view_of_another_size(self):
        """What the error says to do: every other pixel's corner is a pixel's corner of before."""
        camera = Camera.orbit(30, 20, 3, width=64, height=64)
        point = np.array([0.2, 0.1, -0.3])
        np.testing.assert_allclose(pixel(camera.resize(64, 64, 128, 128), point),
                                   2 * pixel(camera, point), rtol=1e-12)

    def test_no_size(self):
        for size, error in ((3, TypeError), ((1, 2, 3), TypeError), ((1.5, 2), TypeError),
                            ((0, 2), ValueError), ((2, 99999), ValueError)):
            self.assertRaises(error, Camera, size=size)


class Errors(unittest.TestCase):
    def expect(self, error, text, call):
        with self.assertRaises(error) as caught:
            call()
        self.assertRegex(str(caught.exception), text)

    def test_they_name_function_and_argument(self):
        k, eye = np.diag([500.0, 500, 1]), np.eye(3)
        self.expect(ValueError, r"^Camera: rotation has shape \(2, 2\), expected \(3, 3\)",
                    lambda: Camera(rotation=np.eye(2)))
        self.expect(ValueError, r"^Camera: fx has shape \(3,\), expected \(2,\)",
                    lambda: Camera(translation=np.zeros((2, 3)), fx=[1, 2, 3]))
        self.expect(ValueError, r"^Camera.from_opencv: k has shape \(2, 2\), expected \(3, 3\) or "
                    r"\(N, 3, 3\)", lambda: Camera.from_opencv(np.eye(2), eye, (0, 0, 0)))
        self.expect(ValueError, "^Camera.from_opencv: translation has 3 cameras, expected 2",
                    lambda: Camera.from_opencv(k, np.stack([eye] * 2), np.zeros((3, 3))))
        self.expect(ValueError, "^Camera.from_opencv: .*rotation",
                    lambda: Camera.from_opencv(k, np.ones((3, 3)), (0, 0, 0)))
        self.expect(ValueError, "^Camera.look_at: ",
                    lambda: Camera.look_at((np.nan, 0, 1), **SIZE))
        self.expect(ValueError, "^Camera.look_at: eye and target coincide",
                    lambda: Camera.look_at((1, 2, 3), (1, 2, 3), **SIZE))
        self.expect(ValueError, "^Camera.look_at: .*fov_y",
                    lambda: Camera.look_at((0, 0, 1), fov_y=200, **SIZE))
        self.expect(ValueError, "^Camera.orbit: .*distance", lambda: Camera.orbit(0, 0, 0, **SIZE))
        self.expect(ValueError, "^Camera.to_kaolin: ",
                    lambda: EXPECTED.replace(cx=3).to_kaolin(**SIZE))
        self.expect(TypeError, "^Camera.replace: no part 'focal'",
                    lambda: EXPECTED.replace(focal=3))
        self.expect(TypeError, "^Camera: a single record has no length", lambda: len(EXPECTED))
        self.expect(TypeError, "^Camera.look_at: width must be int",
                    lambda: Camera.look_at((0, 0, 1), width=3.5, height=2))


# Files of cameras.

WIDTH, HEIGHT = 640, 480


def some_cameras(count: int) -> tilegrad.Camera:
    random = np.random.default_rng(5)
    q, _ = np.linalg.qr(random.normal(size=(count, 3, 3)))
    q *= np.sign(np.linalg.det(q))[:, None, None]
    offset = random.normal(size=(2, count)) * 10
    return tilegrad.Camera(q, random.normal(size=(count, 3)), *random.uniform(300, 700, (2, count)),
                           *(np.array([[WIDTH / 2], [HEIGHT / 2]]) + offset))


class CameraFiles(FolderTest):
    def test_there_and_back(self) -> None:
        views = [cameras.View(f"{i:02}.png", camera, WIDTH, HEIGHT)
                 for i, camera in enumerate(some_cameras(3))]
        for name, kind in (("a.json", "opencv"), ("b.json", "nerf"), ("colmap", "colmap")):
            cameras.save_cameras(self.folder / name, views, format=kind)
            got = cameras.load_cameras(self.folder / name)
            for view, expected in zip(got, views, strict=True):
                self.assertEqual((view.width, view.height), (WIDTH, HEIGHT))
                self.assertEqual(view.camera.size, (WIDTH, HEIGHT))
                np.testing.assert_allclose(view.camera.numbers, expected.camera.numbers, atol=1e-9)
        cameras.save_cameras(self.folder / "c.json", views)
        self.assertIn("K", json.loads((self.folder / "c.json").read_text())["frames"][0])

    def test_models_of_colmap_that_are_left_out_are_named(self) -> None:
        views = [cameras.View(f"{i}.png", camera, WIDTH, HEIGHT)
                 for i, camera in enumerate(some_cameras(3))]
        for name, count in (("0", 2), ("1", 3)):
            cameras.save_cameras(self.folder / "p/sparse" / name, views[:count], format="colmap")
        with self.assertWarnsRegex(UserWarning, r"sparse/1: taken for its 3 images.*: 0 \(2\)"):
            self.assertEqual(len(cameras.load_cameras(self.folder / "p")), 3)

    def test_rotation_vector(self) -> None:
        np.testing.assert_allclose(cameras.rotation_from_vector((0, 0, np.pi / 2)),
                                   [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
        with self.assertRaisesRegex(ValueError, r"rotation_from_vector: rvec has shape \(2,\)"):
            cameras.rotation_from_vector((1, 2))

    def test_errors_name_the_file(self) -> None:
        with self.assertRaisesRegex(FileNotFoundError, "none.json"):
            cameras.load_cameras(self.folder / "none.json")
        bad = self.folder / "bad.json"
        for text in ("{", '{"frames": 3}', '{"K": [[1, 2], [3]], "frames": []}', "[]", ""):
            bad.write_text(text)
            self.assertRaisesRegex(ValueError, "bad.json", cameras.load_cameras, bad)
        stretched = some_cameras(1)[0].replace(rotation=2 * np.eye(3))
        with self.assertRaisesRegex(ValueError, "save_cameras: a.png: .*rotation"):
            cameras.save_cameras(bad, [cameras.View("a.png", stretched, WIDTH, HEIGHT)])
        with self.assertRaisesRegex(TypeError, "single Camera"):
            cameras.save_cameras(bad, [cameras.View("a.png", some_cameras(2), WIDTH, HEIGHT)])
