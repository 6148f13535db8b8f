# SPDX-License-Identifier: Apache-2.0
"""What callers give as arrays: shared where it may be, copied once where not, refused precisely."""

import array
import tempfile
import unittest

import numpy as np

import tilegrad
from tilegrad import _arrays, files


class DlpackOnly:
    """An array of another library, as far as tilegrad sees."""

    def __init__(self, values, device=1):
        self._values, self._device = values, device

    def __dlpack__(self, stream=None):
        return self._values.__dlpack__()

    def __dlpack_device__(self):
        return (self._device, 0)


def take(value, dtype=np.float32, shape=("V", 3), sizes=None):
    return _arrays.as_array("render", "positions", value, dtype, shape, sizes)


class Shared(unittest.TestCase):
    def setUp(self):
        tilegrad.reset_stats()

    def test_what_is_right_is_not_copied(self):
        values = np.arange(6, dtype=np.float32).reshape(2, 3)
        buffers = [values, memoryview(values), DlpackOnly(values), values.view(np.matrix)]
        for value in buffers:
            got = take(value)
            self.assertTrue(np.shares_memory(got, values))
        self.assertEqual(tilegrad.stats(), {"arrays": 4, "copies": 0, "bytes_copied": 0})

    def test_what_is_not_is_copied_once(self):
        values = np.arange(12, dtype=np.float32).reshape(2, 6)
        for wrong in (values[:, ::2], np.asfortranarray(values[:, :3]), values[:, :3].astype("f8"),
                      values[:, :3].astype("i8"), values[:, :3].astype(">f4")):
            tilegrad.reset_stats()
            got = take(wrong)
            self.assertTrue(np.array_equal(got, wrong))
            self.assertTrue(got.flags.c_contiguous)
            self.assertEqual(got.dtype, np.float32)
            self.assertEqual(tilegrad.stats(), {"arrays": 1, "copies": 1, "bytes_copied": 24})

    def test_what_is_not_aligned_is_copied(self):
        memory = np.zeros(25, np.uint8)[1:]
        values = memory.view(np.float32).reshape(2, 3)
        values[:] = np.arange(6).reshape(2, 3)
        self.assertFalse(values.flags.aligned)
        got = take(values)
        self.assertTrue(got.flags.aligned)
        self.assertTrue(np.array_equal(got, values))
        self.assertEqual(tilegrad.stats(), {"arrays": 1, "copies": 1, "bytes_copied": 24})

    def test_numbers_and_buffers(self):
        self.assertEqual(take([[1, 2, 3.5]]).dtype, np.float32)
        self.assertEqual(take(array.array("f", [1, 2, 3]), shape=(3,)).tolist(), [1, 2, 3])
        self.assertEqual(take(2, shape=()).shape, ())
        self.assertEqual(take(np.float64(2), shape=()).shape, ())
        self.assertEqual(tilegrad.stats(), {"arrays": 4, "copies": 0, "bytes_copied": 0})

    def test_dtype_to_compute_in(self):
        for value, expected in ((np.zeros(3), "f8"), (np.zeros(3, "f4"), "f4"), ([0.0], "f4"),
                                (DlpackOnly(np.zeros(3)), "f8"), (np.zeros(3, int), "f4")):
            self.assertEqual(_arrays.float_dtype("f", "a", value), np.dtype(expected))


class Refused(unittest.TestCase):
    def expect(self, error, text, *args, **kwargs):
        with self.assertRaises(error) as caught:
            take(*args, **kwargs)
        self.assertEqual(str(caught.exception), text)

    def test_shapes(self):
        self.expect(ValueError, "render: positions has shape (4, 2), expected (V, 3)",
                    np.zeros((4, 2)))
        self.expect(ValueError, "render: positions has shape (3,), expected (V, 3) with V = 7",
                    np.zeros(3), sizes={"V": 7})
        self.expect(ValueError, "render: positions has shape (2,), expected (3,)",
                    np.zeros(2), shape=(3,))

    def test_dtypes(self):
        self.expect(TypeError, "render: positions has dtype complex64, expected float32",
                    np.zeros((4, 3), np.complex64))
        self.expect(TypeError, "render: positions has dtype float32, expected int32",
                    np.zeros((4, 3), np.float32), np.int32)
        self.expect(ValueError, "render: positions has values of 0 to 2147483648, out of int32's "
                    "range", np.array([[0, 1, 2**31]]), np.int32)

    def test_no_arrays(self):
        for value in (None, "abc", {"a": 1}, [[1, 2, 3], [4, 5]], object()):
            with self.assertRaisesRegex(TypeError, "^render: positions is not an array of numbers"):
                take(value)

    def test_masked_numbers(self):
        positions = np.ma.masked_invalid(np.full((4, 3), np.nan))
        positions[1:] = 1
        for dtype in (np.float32, np.float64):
            self.expect(TypeError, "render: positions is a masked array, and 3 of its numbers are "
                        "masked; fill them first, with filled()", positions, dtype)
        row = np.ma.masked_array([0.0, 1.0, 2.0], mask=[False, True, False])
        for rows in ([row, row], (row.filled(0), row, [1.0, np.ma.masked, 2.0])):
            self.expect(TypeError, "render: positions holds masked arrays, and 2 of its numbers "
                        "are masked; fill them first, with filled()", rows, np.float32)
        endless = []
        endless.append(endless)
        with self.assertRaisesRegex(TypeError, "^render: positions is not an array of numbers"):
            take(endless)
        self.assertTrue((take(positions.filled(2))[0] == 2).all())
        whole = np.ma.masked_array(np.ones((4, 3), np.float32), mask=False)
        self.assertTrue(np.shares_memory(take(whole), whole.data))
        with tempfile.TemporaryDirectory() as folder:
            for save in (lambda: files.save_image(f"{folder}/a.png", positions),
                         lambda: files.save_image(f"{folder}/a.npy", positions),
                         lambda: files.save_weights(f"{folder}/a.npz", {"a": positions})):
                self.assertRaisesRegex(TypeError, "is a masked array", save)

    def test_other_devices(self):
        with self.assertRaisesRegex(TypeError, "^render: positions is on another device"):
            take(DlpackOnly(np.zeros((4, 3), np.float32), device=2))

    def test_choices(self):
        with self.assertRaises(ValueError) as caught:
            _arrays.check_choice("render", "culling", "front", ("none", "back"))
        self.assertEqual(str(caught.exception),
                         "render: culling is 'front', expected one of 'none', 'back'")
