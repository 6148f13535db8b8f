# SPDX-License-Identifier: Apache-2.0
"""`python -m tilegrad.selftest`, and that it would notice."""

import contextlib
import io
import subprocess
import sys
import unittest
from unittest import mock

import numpy as np

from tilegrad import _core, selftest


def run():
    """The exit code of the checks in this process, and what they print."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        code = selftest.main()
    return code, out.getvalue()


class Selftest(unittest.TestCase):
    def test_the_installation_is_sound(self):
        done = subprocess.run([sys.executable, "-m", "tilegrad.selftest"], capture_output=True,
                              text=True, timeout=120)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertRegex(done.stdout.splitlines()[-1], r"^all 12 checks hold \(\d+\.\d s\)$")
        self.assertEqual(done.stdout.count("\nok  "), 12)

    def test_wrong_images_are_noticed(self):
        """Alpha that is off by 1e-4 in one pixel."""
        original = _core.Frame32.view

        def off(frame, name, writeable=False):
            image = np.array(original(frame, name))
            if name == "alpha":
                image[0, 5, 5] += 1e-4
            return image

        with mock.patch.object(_core.Frame32, "view", off):
            code, text = run()
        self.assertEqual(code, 1)
        self.assertIn("FAIL  alpha of a triangle, float32", text)
        self.assertIn("1 of 12 checks FAILED", text)

    def test_wrong_gradients_are_noticed(self):
        """One number that is 1 % too large."""
        original = _core.Renderer.backward

        def off(renderer, frame, cotangents, gradients, add=False):
            original(renderer, frame, cotangents, gradients, add)
            for arrays in gradients:
                values = arrays["positions"].reshape(-1)
                values[np.argmax(np.abs(values))] *= 1.01

        with mock.patch.object(_core.Renderer, "backward", off):
            code, text = run()
        self.assertEqual(code, 1)
        for lighting in ("lambert", "phong", "spherical_harmonics"):
            self.assertIn(f"FAIL  gradients, {lighting}", text)

    def test_an_exception_is_a_failure(self):
        with mock.patch.object(_core.Renderer, "render", side_effect=RuntimeError("broken")):
            code, text = run()
        self.assertEqual(code, 1)
        self.assertEqual(text.count("FAIL"), 12 + 1)


if __name__ == "__main__":
    unittest.main()
