# SPDX-License-Identifier: Apache-2.0
"""Predictions from Python are those of `tilegrad predict`."""

import os
import pathlib
import pickle
import signal
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from file_samples import FolderTest, dataset, run, run_program
from tilegrad import files


class Predict(FolderTest):
    def setUp(self) -> None:
        super().setUp()
        self.data = files.Dataset(dataset(), "test")
        self.image = self.folder / "view.png"
        run_program("dataset-view", "--data", dataset(), "--out", self.image)

    def _program(self, *arguments: object) -> bytes:
        run_program("predict", self.image, "--run", run(), "--out", self.folder, "--force",
                    *arguments)
        return (self.folder / "view_predicted.glb").read_bytes()

    def _python(self, mesh: files.Mesh) -> bytes:
        files.save_mesh(self.folder / "python.glb", mesh)
        return (self.folder / "python.glb").read_bytes()

    def test_same_bytes_as_the_program(self) -> None:
        image = files.load_image(self.image)
        for threads in (1, 2):
            predictor = files.Predictor(run(), threads)
            self.assertEqual(self._python(predictor.predict(image, refine=10)),
                             self._program("--refine", 10))
        self.assertEqual(self._python(predictor.predict(image)), self._program())
        kept = predictor.predict(image, keep_framing=True, refine=0)
        self.assertEqual(self._python(kept), self._program("--keep-framing", "--refine", 0))
        rgb, mask = self.folder / "rgb.png", self.folder / "mask.png"
        files.save_image(rgb, image[..., :3])
        files.save_image(mask, image[..., 3])
        masked = predictor.predict(image[..., :3], image[..., 3], refine=10)
        self.image.write_bytes(rgb.read_bytes())
        self.assertEqual(self._python(masked), self._program("--mask", mask, "--refine", 10))

    def test_a_prediction_is_a_mesh_of_the_template(self) -> None:
        predictor = files.Predictor(run())
        self.assertEqual(predictor.image_size, 32)
        self.assertIn("step 3", predictor.description)
        image, template = files.load_image(self.image), predictor.template()
        mesh = predictor.predict(image, refine=0)
        np.testing.assert_array_equal(mesh.faces, template.faces)
        self.assertAlmostEqual(float(np.abs(mesh.positions).max()), 0.45, places=5)
        self.assertTrue(((mesh.colors >= 0) & (mesh.colors <= 1)).all())
        refined = predictor.predict(image, refine=10)  # 80 faces are divided once
        self.assertEqual(len(refined.faces), 4 * len(template.faces))
        self.assertAlmostEqual(float(np.abs(refined.positions).max()), 0.45, places=5)

    def test_a_signal_ends_the_refinement(self) -> None:
        """As Ctrl-C does: its handler runs within a second, and what it raises comes out."""
        def stop(*_: object) -> None:
            raise TimeoutError("the alarm")

        predictor, image = files.Predictor(run()), files.load_image(self.image)
        before = signal.signal(signal.SIGALRM, stop)
        self.addCleanup(signal.signal, signal.SIGALRM, before)
        start = time.monotonic()
        signal.setitimer(signal.ITIMER_REAL, 0.5)
        self.assertRaisesRegex(TimeoutError, "the alarm", predictor.predict, image, refine=100_000)
        self.assertLess(time.monotonic() - start, 2.5)

    def test_many_at_once_are_each_alone(self) -> None:
        predictor = files.Predictor(run())
        images = np.random.default_rng(6).integers(0, 256, (40, 4, 32, 32), np.uint8)
        many = predictor.predict_prepared(images)
        for i in (0, 33, 39):
            one = predictor.predict_prepared(images[i:i + 1])[0]
            np.testing.assert_array_equal(one.positions, many[i].positions)
            np.testing.assert_array_equal(one.colors, many[i].colors)

    def test_threads_pickle_and_fork_give_the_same(self) -> None:
        predictor = files.Predictor(run())
        image = files.load_image(self.image)
        expected = self._python(predictor.predict(image, refine=10))
        again = pickle.loads(pickle.dumps(predictor)).predict(image, refine=10)
        self.assertEqual(self._python(again), expected)
        with ThreadPoolExecutor(4) as pool:
            got = [mesh.positions for mesh in pool.map(
                lambda _: predictor.predict(image, refine=10), range(4))]
        child = os.fork()
        if child == 0:
            mesh = predictor.predict(image, refine=10)
            same = all(np.array_equal(mesh.positions, p) for p in got)
            os._exit(0 if same else 1)
        self.assertEqual(os.waitpid(child, 0)[1], 0)

    def test_checkpoint_as_arrays(self) -> None:
        checkpoint = files.load_checkpoint(run())
        self.assertEqual((checkpoint.step, checkpoint.image_size), (3, 32))
        self.assertIn("template_level = 1", checkpoint.config)
        again = files.load_weights(checkpoint.file)
        self.assertEqual(set(again), set(checkpoint.weights))
        for name, array in checkpoint.weights.items():
            np.testing.assert_array_equal(array, again[name])
        one = files.load_checkpoint(checkpoint.file)
        self.assertEqual(one.step, 3)

    def test_weights_come_along_by_name(self) -> None:
        run_program("export", "--run", run(), "--out", self.folder / "furniture.safetensors")
        self.addCleanup(os.environ.pop, "TILEGRAD_WEIGHTS")
        os.environ["TILEGRAD_WEIGHTS"] = str(self.folder)
        image = files.load_image(self.image)
        expected = self._python(files.Predictor(run()).predict(image, refine=0))
        for predictor in (files.Predictor(), files.Predictor("furniture")):
            self.assertEqual(self._python(predictor.predict(image, refine=0)), expected)
        self.assertRaisesRegex(FileNotFoundError, "there are furniture", files.Predictor,
                               "cars")

    def test_grey_images_with_alpha_are_cut_outs(self) -> None:
        image = files.load_image(self.image)
        image[..., 1] = image[..., 2] = image[..., 0]
        predictor = files.Predictor(run())
        expected = predictor.prepare(image)
        np.testing.assert_array_equal(predictor.prepare(image[..., [0, 3]]), expected)
        files.save_image(self.image, image)
        colored = self._program()
        files.save_image(self.image, image[..., [0, 3]])
        self.assertEqual(self._program(), colored)
        self.assertRaisesRegex(ValueError, "no alpha channel", predictor.prepare, image[..., :1])
        with self.assertWarnsRegex(RuntimeWarning, "prepare: image.*divide by 255"):
            predictor.prepare(image.astype(np.float32))

    def test_errors(self) -> None:
        predictor = files.Predictor(run())
        image = files.load_image(self.image)
        opaque = image.copy()
        opaque[..., 3] = 255
        for wrong, mask, message in (
                (opaque, None, "not cut out"), (image[..., :3], None, "no alpha channel"),
                (image * np.uint8(0), None, "mask is empty"),
                (image, image[:9, :9, 3], "mask is 9 x 9"), (image[0, 0], None, "image has shape")):
            self.assertRaisesRegex(ValueError, message, predictor.predict, wrong, mask)
        self.assertRaisesRegex(ValueError, "refine is -1", predictor.predict, image, refine=-1)
        for wrong in ({"refine": 1.5}, {"refine": "3"}, {"keep_framing": "no"}):
            self.assertRaisesRegex(TypeError, f"predict: {next(iter(wrong))} must be",
                                   predictor.predict, image, **wrong)
        with self.assertRaisesRegex(ValueError, r"predict_prepared: images has shape \(4, 8, 8\)"):
            predictor.predict_prepared(np.zeros((4, 8, 8), np.uint8))
        self.assertRaisesRegex(FileNotFoundError, "none", files.Predictor, self.folder / "none")
        checkpoint = self.folder / "c.safetensors"
        content = pathlib.Path(files.load_checkpoint(run()).file).read_bytes()
        for at in (0, 5, 200, len(content) // 2, len(content) - 1):
            checkpoint.write_bytes(content[:at])
            self.assertRaisesRegex(ValueError, "c.safetensors", files.Predictor, checkpoint)
