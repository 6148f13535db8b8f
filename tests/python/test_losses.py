# SPDX-License-Identifier: Apache-2.0
"""Losses with gradients: against differences in float64, and on torch's tape."""

import unittest

import numpy as np

import tilegrad
from support import needs_torch, torch
from tilegrad import losses


FACES = tilegrad.icosphere(1)[1]
RANDOM = np.random.default_rng(3)
POSITIONS = tilegrad.icosphere(1)[0].astype(np.float64) + 0.05 * RANDOM.normal(size=(42, 3))
POINTS = RANDOM.normal(size=(30, 3))
TRUTH = RANDOM.uniform(size=(2, 6, 5))
STEP = 1e-6

# Each a loss of one array, and that array.
CASES = {"edge_length": (lambda p: losses.edge_length(p, FACES), POSITIONS),
         "normal_consistency": (lambda p: losses.normal_consistency(p, FACES), POSITIONS),
         "laplacian": (lambda p: losses.laplacian(p, FACES), POSITIONS),
         "laplacian of a movement": (lambda p: losses.laplacian(p, FACES, start=POSITIONS[::-1]),
                                     POSITIONS),
         "chamfer a": (lambda p: losses.chamfer(p, POINTS), POSITIONS),
         "iou": (lambda a: losses.iou(a, TRUTH), RANDOM.uniform(size=(2, 6, 5)))}


class Gradients(unittest.TestCase):
    def test_are_those_of_differences(self):
        """Central differences err by the third derivative times STEP^2 and by rounding over STEP:
        1e-9 here, of values near 1."""
        for name, (loss, at) in CASES.items():
            with self.subTest(name):
                gradient = loss(at)[1]
                self.assertEqual(gradient.shape, at.shape)
                for i in RANDOM.integers(at.size, size=12):
                    moved = [at.copy(), at.copy()]
                    for array, sign in zip(moved, (1, -1)):
                        array.flat[i] += sign * STEP
                    difference = (loss(moved[0]).value - loss(moved[1]).value) / (2 * STEP)
                    self.assertAlmostEqual(gradient.flat[i], difference, delta=1e-7)

    def test_chamfer_has_both(self):
        forward, back = losses.chamfer(POSITIONS, POINTS), losses.chamfer(POINTS, POSITIONS)
        self.assertAlmostEqual(forward.value, back.value, delta=1e-12)
        np.testing.assert_allclose(forward.gradient_a, back.gradient_b, atol=1e-12)

    def test_float32_is_close(self):
        for name, (loss, at) in CASES.items():
            small = loss(at.astype(np.float32)) if "movement" not in name else loss(at)
            self.assertAlmostEqual(small.value, loss(at).value, delta=1e-4, msg=name)


@needs_torch
class Torch(unittest.TestCase):
    def test_tensors_give_the_same(self):
        for name, (loss, at) in CASES.items():
            with self.subTest(name):
                tensor = torch.tensor(at, requires_grad=True)
                value = loss(tensor)
                (3 * value).backward()
                self.assertAlmostEqual(value.item(), loss(at).value, delta=1e-12)
                np.testing.assert_allclose(tensor.grad.numpy(), 3 * loss(at)[1], atol=1e-12)


class Nothing(unittest.TestCase):
    def test_meshes_without_edges_and_extent_lose_nothing(self):
        none = np.zeros((0, 3), np.int32)
        for positions, faces in ((POSITIONS[:0], none), (POSITIONS, none),
                                 (np.zeros((42, 3)), FACES)):
            for loss in (losses.edge_length, losses.normal_consistency, losses.laplacian):
                value, gradient = loss(positions, faces)
                self.assertEqual(value, 0)
                self.assertEqual(gradient.shape, positions.shape)
                self.assertFalse(gradient.any())

    def test_images_without_pixels_and_clouds_without_points(self):
        self.assertEqual(losses.iou(np.zeros((0, 4, 4)), np.zeros((0, 4, 4))).value, 0)
        self.assertEqual(losses.iou(np.zeros((2, 4, 4)), np.zeros((2, 4, 4))).value, 1)
        for a, b, name in ((POINTS[:0], POINTS[:0], "a"), (POINTS, POINTS[:0], "b")):
            with self.assertRaisesRegex(ValueError, f"chamfer: {name} has no points"):
                losses.chamfer(a, b)

    def test_faces_out_of_int32(self):
        with self.assertRaisesRegex(ValueError, "out of int32's range"):
            losses.edge_length(POSITIONS, FACES.astype(np.int64) + 2**32)


class Errors(unittest.TestCase):
    def test_name_what_is_wrong(self):
        for call, message in (
                (lambda: losses.edge_length(POSITIONS, [[0, 1, 99]]), r"faces\[0,2\] is 99"),
                (lambda: losses.edge_length(POSITIONS[:, :2], FACES), "positions has shape"),
                (lambda: losses.laplacian(POSITIONS * np.nan, FACES), "not finite"),
                (lambda: losses.iou(TRUTH, TRUTH[:1]), "expected the same")):
            self.assertRaisesRegex(ValueError, message, call)
        with self.assertRaisesRegex(TypeError, "faces has dtype float32, expected int32"):
            losses.edge_length(POSITIONS, FACES.astype(np.float32))

    def test_arrays_that_would_be_misread(self):
        masked = np.ma.masked_less(POSITIONS, 0)
        for call, error, message in (
                (lambda: losses.iou(TRUTH, np.uint8(255 * TRUTH)), ValueError, "iou: truth.*255"),
                (lambda: losses.iou(-TRUTH, TRUTH), ValueError, "iou: alpha has numbers outside"),
                (lambda: losses.laplacian(POSITIONS, FACES, POSITIONS[:, :1]), ValueError,
                 r"laplacian: start has shape \(42, 1\)"),
                (lambda: losses.laplacian(POSITIONS, FACES, 1), ValueError, "laplacian: start"),
                (lambda: losses.laplacian(POSITIONS, FACES, masked), TypeError, "start.*masked"),
                (lambda: losses.chamfer(POSITIONS, POINTS * 1j), TypeError, "b has dtype complex"),
                (lambda: losses.chamfer(POSITIONS, masked), TypeError, "b is a masked array"),
                (lambda: losses.chamfer(POSITIONS, "a"), TypeError, "chamfer: b is not an array"),
                (lambda: losses.edge_length(np.float32(1e20 * POSITIONS), FACES), ValueError,
                 "edge_length: positions.*overflows")):
            self.assertRaisesRegex(error, message, call)

    @needs_torch
    def test_tensors(self):
        p = torch.tensor(POSITIONS)
        for call, message in (
                (lambda: losses.chamfer(p, "a"), "chamfer: b is not an array"),
                (lambda: losses.chamfer(p, p.float()), "a and b have dtypes torch.float64 and"),
                (lambda: losses.chamfer(p, p.bfloat16()), "b has dtype torch.bfloat16"),
                (lambda: losses.iou(p.bfloat16(), p), "iou: alpha has dtype torch.bfloat16")):
            self.assertRaisesRegex(TypeError, message, call)
        mask = torch.ones(4, 4)
        self.assertAlmostEqual(losses.iou(mask, mask > 0).item(), 0, places=6)
