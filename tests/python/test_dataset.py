# SPDX-License-Identifier: Apache-2.0
"""Datasets: what is in items, order, pickling, workers, damage."""

import pickle
import shutil
import subprocess
import unittest

import numpy as np

import tilegrad
from file_samples import FolderTest, dataset, run_program
from support import needs_torch, torch
from tilegrad import files


def assert_same(test: unittest.TestCase, a: dict, b: dict) -> None:
    test.assertEqual(set(a), set(b))
    for key in a:
        np.testing.assert_array_equal(a[key], b[key], err_msg=key)


class Items(FolderTest):
    def test_what_is_in_an_item(self) -> None:
        data = files.Dataset(dataset())
        self.assertEqual(len(data), 5)
        self.assertEqual(data.classes, ["car", "chair", "lamp", "plane", "table"])
        self.assertEqual(data.image_size, 32)
        item = data[1]
        for name, shape, dtype in (("images", (4, 3, 32, 32), np.float32),
                                   ("masks", (4, 32, 32), np.float32),
                                   ("cameras", (4, 17), np.float32), ("views", (4,), np.int64)):
            self.assertEqual((item[name].shape, item[name].dtype), (shape, dtype), name)
        self.assertEqual(data.models[item["model"]].class_index, item["class"])
        self.assertEqual(data.models[item["model"]].split, "train")
        self.assertTrue((item["images"] <= item["masks"][:, None] + 1e-6).all())  # over black
        self.assertGreater(item["masks"].mean(), 0.02)
        self.assertEqual(item["masks"].max(), 1)
        np.testing.assert_array_equal(item["cameras"], data.cameras.numbers.astype(np.float32))
        assert_same(self, data[-1], data[4])
        self.assertRaises(IndexError, lambda: data[5])
        self.assertEqual(len(list(data)), 5)

    def test_images_are_those_of_the_program(self) -> None:
        data = files.Dataset(dataset(), "test")
        model = data.models[data[2]["model"]]
        name = f"{data.classes[model.class_index]}/{model.id}"
        run_program("dataset-view", "--data", dataset(), "--model", name, "--view", 1, "--out",
                    self.folder / "view.png")
        straight = files.load_image(self.folder / "view.png").astype(np.float64) / 255
        np.testing.assert_allclose(data[2]["masks"][1], straight[..., 3], atol=1e-6)
        over_black = np.moveaxis(straight[..., :3] * straight[..., 3:], -1, 0)
        np.testing.assert_allclose(data[2]["images"][1], over_black, atol=1.01 / 255)  # 8 bits

    def test_the_program_shows_the_class_that_is_asked_for(self) -> None:
        data = files.Dataset(dataset(), "test")
        for item in data:
            name = data.classes[item["class"]]
            run_program("dataset-view", "--data", dataset(), "--class", name, "--force", "--out",
                        self.folder / "view.png")
            shown = files.load_image(self.folder / "view.png")[..., 3] / 255
            np.testing.assert_allclose(item["masks"][0], shown, atol=1e-6)
        with self.assertRaises(subprocess.CalledProcessError) as raised:
            run_program("dataset-view", "--data", dataset(), "--class", "boat")
        self.assertIn(b"there are car, chair, lamp", raised.exception.stderr)

    def test_truth_renders_to_the_images(self) -> None:
        data = files.Dataset(dataset())
        truth = data.truth(0)
        self.assertEqual(truth.occupancy.shape, (32, 32, 32))
        self.assertGreater(truth.occupancy.sum(), 50)
        self.assertEqual(truth.points.shape, (2500, 3))
        scene = truth.mesh.scene(data.cameras)
        frame = tilegrad.Renderer().render(scene, width=32, height=32)
        inside = frame.alpha > 0.99
        both = (inside & (data[0]["masks"] > 0.5)).sum()
        self.assertGreater(both / (inside | (data[0]["masks"] > 0.5)).sum(), 0.85)  # of pixels

    def test_splits(self) -> None:
        parts = [files.Dataset(dataset(), split) for split in ("train", "validation", "test")]
        shown = sorted(item["model"] for part in parts for item in part)
        self.assertEqual(shown, list(range(15)))
        every = files.Dataset(dataset(), None)
        self.assertEqual(len(every), 15)
        for number, part in enumerate(parts):
            self.assertEqual({item["split"] for item in part}, {number})
        self.assertEqual(sorted(item["split"] for item in every), 5 * [0] + 5 * [1] + 5 * [2])

    def test_views_follow_seed_and_epoch(self) -> None:
        data = files.Dataset(dataset(), views=2, seed=3)
        first = [item["views"].tolist() for item in data]
        self.assertTrue(all(len(set(views)) == 2 for views in first))
        self.assertEqual(first, [item["views"].tolist() for item in data])
        data.set_epoch(1)
        self.assertNotEqual(first, [item["views"].tolist() for item in data])
        item, every = data[0], files.Dataset(dataset())[0]
        np.testing.assert_array_equal(item["images"], every["images"][item["views"]])
        np.testing.assert_array_equal(item["cameras"], every["cameras"][item["views"]])

    def test_in_memory_is_the_same(self) -> None:
        slow = files.Dataset(dataset(), views=3)
        for threads in (1, 3):
            fast = files.Dataset(dataset(), views=3, in_memory=True, threads=threads)
            for a, b in zip(slow, fast, strict=True):
                assert_same(self, a, b)


class Batches(unittest.TestCase):
    def test_every_epoch_shows_each_model_once(self) -> None:
        data = files.Dataset(dataset(), views=2)
        batches = list(data.batches(2, steps=5))  # two epochs of five
        models = np.concatenate([batch["model"] for batch in batches])
        for epoch in (models[:5], models[5:]):
            self.assertEqual(sorted(epoch), sorted(item["model"] for item in data))
        self.assertNotEqual(models[:5].tolist(), models[5:].tolist())
        self.assertEqual(batches[0]["images"].shape, (2, 2, 3, 32, 32))

    def test_a_step_depends_on_seed_and_step_only(self) -> None:
        data = files.Dataset(dataset(), views=2, seed=1)
        for late, batch in zip(data.batches(3, first_step=2, steps=2),
                               list(data.batches(3, steps=4))[2:], strict=True):
            assert_same(self, late, batch)
        other = files.Dataset(dataset(), views=2, seed=2)
        self.assertFalse(np.array_equal(
            np.stack([b["model"] for b in data.batches(5, steps=4)]),
            np.stack([b["model"] for b in other.batches(5, steps=4)])))

    def test_errors(self) -> None:
        data = files.Dataset(dataset())
        self.assertRaisesRegex(ValueError, "batches: size is 0", data.batches, 0)
        self.assertRaisesRegex(ValueError, "batches: steps is -1", data.batches, 1, steps=-1)
        self.assertRaisesRegex(ValueError, "threads is -1", files.Dataset, dataset(), threads=-1)
        self.assertRaisesRegex(TypeError, "in_memory must be bool", files.Dataset, dataset(),
                               in_memory="no")
        with self.assertRaisesRegex(ValueError, "views is 5, the dataset has 4"):
            files.Dataset(dataset(), views=5)
        self.assertRaisesRegex(ValueError, "split is 'dev'", files.Dataset, dataset(), "dev")
        with self.assertRaisesRegex(ValueError, "^set_epoch: epoch is -1, must be >= 0"):
            data.set_epoch(-1)
        with self.assertRaisesRegex(ValueError, "^Dataset: seed is -1, must be >= 0"):
            files.Dataset(dataset(), views=2, seed=-1)
        with self.assertRaisesRegex(TypeError, r"^Dataset: item must be int, got 1.0 \(float\)"):
            data[1.0]
        self.assertRaisesRegex(IndexError, "^Dataset: item 99 of ", data.truth, 99)


class Workers(unittest.TestCase):
    def test_pickle(self) -> None:
        data = files.Dataset(dataset(), views=2, seed=3)
        data.set_epoch(4)
        again = pickle.loads(pickle.dumps(data))
        assert_same(self, data[2], again[2])

    @needs_torch
    def test_torch_loader_with_forked_workers(self) -> None:
        for in_memory in (False, True):
            data = files.Dataset(dataset(), views=2, in_memory=in_memory)
            loader = torch.utils.data.DataLoader(data, batch_size=2, num_workers=2,
                                                 multiprocessing_context="fork")
            batches = list(loader)
            self.assertEqual([len(batch["model"]) for batch in batches], [2, 2, 1])
            for i, item in enumerate(data):
                got = {key: value[i % 2].numpy() for key, value in batches[i // 2].items()}
                assert_same(self, item, got)


class Damage(FolderTest):
    def test_errors_name_the_file(self) -> None:
        self.assertRaisesRegex(FileNotFoundError, "none", files.Dataset, self.folder / "none")
        copy = self.folder / "copy"
        shutil.copytree(dataset(), copy)
        data = files.Dataset(copy)
        path = copy / "models" / "car" / (data.models[data[0]["model"]].id + ".npz")
        content = path.read_bytes()
        for at in range(0, len(content), len(content) // 20):
            path.write_bytes(content[:at])
            with self.assertRaisesRegex(ValueError, path.name):
                data[0]
        path.unlink()
        with self.assertRaisesRegex(FileNotFoundError, path.name):
            data[0]
        (copy / "models.jsonl").write_text("{}\n")
        self.assertRaisesRegex(ValueError, "models.jsonl.*line 1", files.Dataset, copy)
        (copy / "models.jsonl").unlink()
        self.assertRaisesRegex(FileNotFoundError, "not complete", files.Dataset, copy)
