# SPDX-License-Identifier: Apache-2.0
"""Files of cameras."""

import json

import numpy as np

import tilegrad
from file_samples import FolderTest
from tilegrad import cameras

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
