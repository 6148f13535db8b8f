# SPDX-License-Identifier: Apache-2.0
"""examples/python/train_torch.py: a training loop with two forked workers that render too."""

import contextlib
import io
import sys
import unittest

import numpy as np

from file_samples import FolderTest, dataset, run_program
from support import SOURCE, long_test
from tilegrad import files

try:
    import torch
except ImportError:
    torch = None
else:
    sys.path.insert(0, str(SOURCE / "examples" / "python"))
    import train_torch

needs_torch = unittest.skipIf(torch is None, "no torch (Debian: python3-torch)")


def trained(steps, data=None, workers=2):
    """The model, its curves, and losses on unseen objects before and after."""
    torch.manual_seed(0)
    train_data, test_data = train_torch.datasets(data)
    model = train_torch.MeshPredictor()
    before = train_torch.evaluate(model, test_data)
    with contextlib.redirect_stdout(io.StringIO()):
        curves = train_torch.train(model, train_data, steps, batch=16 if data is None else 4,
                                   workers=workers)
    return model, curves, before, train_torch.evaluate(model, test_data)


@needs_torch
class TrainTorch(FolderTest):
    def test_a_short_run_learns(self):
        """Seen: silhouette 0.59 -> 0.19, image 0.144 -> 0.057."""
        model, curves, before, after = trained(60)
        self.assertEqual(len(curves["image"]), 60)
        self.assertLess(float(after.mask), 0.5 * float(before.mask))
        self.assertLess(float(after.image), 0.6 * float(before.image))
        path = self.folder / "prediction.glb"
        train_torch.save_prediction(model, train_torch.datasets(None)[1], path)
        mesh = files.load_mesh(path)
        self.assertEqual(len(mesh.faces), 320)
        self.assertGreater(np.abs(mesh.positions - train_torch.template()[0]).max(), 0.05)

    def test_items_do_not_depend_on_the_worker(self):
        data = train_torch.Ellipsoids(4, seed=5)
        loader = torch.utils.data.DataLoader(data, 2, num_workers=2)
        for i, item in enumerate(item for batch in loader for item in zip(*batch.values())):
            for got, expected in zip(item, data[i].values()):
                np.testing.assert_array_equal(got.numpy(), expected)

    def test_data_of_a_folder(self):
        _, curves, _, after = trained(3, dataset(), workers=1)
        self.assertTrue(all(np.isfinite(values).all() for values in curves.values()))
        self.assertTrue(torch.isfinite(after.mask))

    def test_data_of_another_size(self):
        folder = self.folder / "small"
        run_program("dataset", "--source", "procedural", "--per-class", 1, "--size", 16, "--views",
                    4, "--out", folder)
        with self.assertRaisesRegex(SystemExit, "16 pixels a side, not 32"):
            train_torch.datasets(str(folder))

    def test_fewer_objects_than_a_batch(self):
        """Full batches only would be none, and their loop would have no end."""
        with contextlib.redirect_stdout(io.StringIO()):
            curves = train_torch.train(train_torch.MeshPredictor(),
                                       train_torch.Ellipsoids(3, seed=6), steps=2, workers=0)
        self.assertEqual(len(curves["image"]), 2)


@needs_torch
@long_test
class TrainTorchLong(unittest.TestCase):
    def test_converges(self):
        """Seen after 400 steps: silhouette 0.064, image 0.033."""
        _, _, before, after = trained(400)
        self.assertGreater(float(before.mask), 0.5)
        self.assertLess(float(after.mask), 0.1)
        self.assertLess(float(after.image), 0.045)


if __name__ == "__main__":
    unittest.main()
