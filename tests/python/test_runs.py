# SPDX-License-Identifier: Apache-2.0
"""tilegrad.fit and tilegrad.train: from arrays, with callbacks, stopped and continued."""

import contextlib
import fcntl
import io
import os
import pathlib
import pty
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time
import types
import unittest
import warnings
from unittest import mock

import numpy as np

import tilegrad
from file_samples import FolderTest, dataset
from tilegrad import files, runs
from tilegrad.images import save_image


def views(count=6, size=32):
    positions, faces = tilegrad.icosphere(2, 0.5)
    mesh = files.Mesh(positions * np.array([1, 0.6, 0.8], np.float32), faces)
    mesh.colors = np.clip(0.5 + positions, 0, 1)
    cameras = tilegrad.Camera.framing(mesh, azimuth=np.arange(count) * 360 / count, width=size,
                                      height=size)
    frame = tilegrad.render(mesh, cameras, width=size, height=size, lighting="none", lights=None)
    return mesh, cameras, np.stack([frame.picture(i) for i in range(count)])


MESH, CAMERAS, IMAGES = views()
SMALL = {"steps": 60, "template_level": 2, "texture_size": 32}


class Fit(FolderTest):
    def setUp(self):
        super().setUp()
        self.out = self.folder / "fit"

    def test_finds_the_shape_and_reports(self):
        told = []
        result = tilegrad.fit(IMAGES, CAMERAS, hold_out=3, truth=MESH, callback=told.append, **SMALL)
        self.assertTrue(result.finished)
        self.assertEqual(result.steps, 60)
        self.assertGreater(result.held_out["silhouette_iou"], 0.7)
        self.assertGreater(result.voxel_iou, 0.4)
        self.assertGreater(len(result.mesh.faces), 100)
        self.assertEqual(result._repr_png_()[:4], b"\x89PNG")
        self.assertIsNone(result.folder)
        self.assertEqual(told[-1].step, 60)
        self.assertLess(told[-1].values["loss"], told[0].values["loss"])

    def test_stopped_and_continued_is_the_same(self):
        whole = tilegrad.fit(IMAGES, CAMERAS, **SMALL)
        part = tilegrad.fit(IMAGES, CAMERAS, out=self.out, callback=lambda at: at.step >= 20,
                            **SMALL)
        self.assertFalse(part.finished)
        self.assertIsNone(part.mesh)
        rest = tilegrad.fit(IMAGES, CAMERAS, out=self.out, resume=True, threads=1, **SMALL)
        np.testing.assert_array_equal(rest.mesh.positions, whole.mesh.positions)
        self.assertTrue((rest.folder / "report.html").exists())

    def test_a_damaged_checkpoint_is_skipped_with_a_warning(self):
        options = {**SMALL, "checkpoint_every": 20}
        whole = tilegrad.fit(IMAGES, CAMERAS, out=self.out, **options)
        sorted((self.out / "checkpoints").iterdir())[-1].write_bytes(b"")
        with self.assertWarnsRegex(UserWarning, "^fit: skipped: .*step_00000060"):
            again = tilegrad.fit(IMAGES, CAMERAS, out=self.out, resume=True, **options)
        np.testing.assert_array_equal(whole.mesh.positions, again.mesh.positions)

    def test_a_finished_fit_goes_on_with_more_steps(self):
        tilegrad.fit(IMAGES, CAMERAS, out=self.out, **SMALL)
        more = tilegrad.fit(IMAGES, CAMERAS, out=self.out, resume=True, **{**SMALL, "steps": 90})
        self.assertEqual(more.steps, 90)
        with self.assertRaisesRegex(ValueError, "90 steps already"):
            tilegrad.fit(IMAGES, CAMERAS, out=self.out, resume=True, **SMALL)

    def test_a_plain_background_makes_masks(self):
        straight = IMAGES / 255
        before_white = straight[..., :3] * straight[..., 3:] + (1 - straight[..., 3:])
        result = tilegrad.fit(before_white, CAMERAS, background="plain", hold_out=3, **SMALL)
        self.assertGreater(result.held_out["silhouette_iou"], 0.7)

    def test_finds_cameras_of_arrays_and_of_pictures_in_a_folder(self):
        with self.assertRaisesRegex(ValueError, "6 or more are needed"):
            tilegrad.fit(IMAGES[:3], fov=40, **SMALL)
        folder = self.folder / "pictures"
        folder.mkdir()
        for i, image in enumerate(IMAGES):
            save_image(folder / f"{i}.png", image)
        with warnings.catch_warnings(record=True) as caught:  # an ellipsoid: in doubt
            warnings.simplefilter("always")
            of_arrays = tilegrad.fit(IMAGES, fov=40, out=self.out, **SMALL)
            of_folder = tilegrad.fit(folder, fov=40, **SMALL)
        self.assertTrue(all("fit: " in str(w.message) for w in caught))
        self.assertTrue((self.out / "cameras_start.json").exists())
        self.assertGreater(of_arrays.training["silhouette_iou"], 0.8)
        np.testing.assert_array_equal(of_folder.mesh.positions, of_arrays.mesh.positions)

    def test_masks_that_say_nothing_are_named(self):
        images = IMAGES.copy()
        images[2, ..., 3] = 255
        images[4, ..., 3] = 0
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            result = tilegrad.fit(images, CAMERAS, **SMALL)
        said = [str(w.message) for w in caught]
        self.assertEqual(result.training["views"], 5)
        for message in ("fit: 2: its mask is full", "fit: 4: its mask is empty"):
            self.assertTrue(any(text.startswith(message) for text in said), said)

    def test_masks_in_doubt_are_named(self):
        images = IMAGES.copy()
        images[2] = 0
        images[2, 4:12, 4:12] = 255
        with self.assertWarnsRegex(UserWarning, "^fit: mesh and masks agree to "):
            tilegrad.fit(images, CAMERAS, **SMALL)

    def test_up_turns_the_mesh(self):
        given, turned = (np.ptp(tilegrad.fit(IMAGES, CAMERAS, up=up, **SMALL).mesh.positions, axis=0)
                         for up in ("", "z"))
        np.testing.assert_allclose(turned, given[[0, 2, 1]], atol=0.08)
        self.assertGreater(abs(given[1] - given[2]), 0.1)

    def test_what_a_callback_raises_goes_on(self):
        with self.assertRaises(ZeroDivisionError):
            tilegrad.fit(IMAGES, CAMERAS, callback=lambda at: 1 / 0, **SMALL)

    def test_errors(self):
        for call, message in (
                (lambda: tilegrad.fit(IMAGES, CAMERAS, stepz=3), "did you mean steps"),
                (lambda: tilegrad.fit(IMAGES, CAMERAS, background="sky"), "plain, none or views"),
                (lambda: tilegrad.fit(IMAGES, CAMERAS, up="w"), "expected y, z or x"),
                (lambda: tilegrad.fit(IMAGES, fov=200), "5 to 150 degrees"),
                (lambda: tilegrad.fit(IMAGES[..., :3], background="none"), "cannot be found without masks"),
                (lambda: tilegrad.fit(IMAGES[:3], CAMERAS), "cameras has shape"),
                (lambda: tilegrad.fit(IMAGES, CAMERAS, optimize=["shape"]), '"shape" cannot'),
                (lambda: tilegrad.fit(IMAGES, CAMERAS, lighting="neon"), "expected one of"),
                (lambda: tilegrad.fit(IMAGES, CAMERAS, optimize="shape"), '"shape" cannot'),
                (lambda: tilegrad.fit(IMAGES, CAMERAS, hold_out=-3), "hold_out is -3"),
                (lambda: tilegrad.fit("photos", CAMERAS), "a folder has its own"),
                (lambda: tilegrad.fit(IMAGES / 100, CAMERAS), "outside of")):
            self.assertRaisesRegex(ValueError, message, call)
        self.assertRaisesRegex(OSError, "nowhere", tilegrad.fit, "nowhere")
        with self.assertRaisesRegex(TypeError, "expected a function"):
            tilegrad.fit(IMAGES, CAMERAS, callback=3)


    def test_quality_says_how_many_steps(self):
        small = {name: value for name, value in SMALL.items() if name != "steps"}
        told = []
        tilegrad.fit(IMAGES, CAMERAS, quality="fast", callback=lambda at: told.append(at) or True,
                     **small)
        self.assertEqual((told[0].step, told[0].steps, told[0].stage), (1, 300, "fitting"))
        with self.assertRaisesRegex(ValueError, "quality and steps both"):
            tilegrad.fit(IMAGES, CAMERAS, quality="fast", **SMALL)
        with self.assertRaisesRegex(ValueError, 'quality is "good", expected fast, normal or best'):
            tilegrad.fit(IMAGES, CAMERAS, quality="good", **small)

    def test_a_callback_that_wants_stages_is_told_of_all(self):
        class All(list):
            stages = True

            def __call__(self, at):
                self.append(at)

        told = All()
        tilegrad.fit(IMAGES, CAMERAS, callback=told, **SMALL)
        self.assertEqual((told[0].stage, dict(told[0].values)), ("preparing", {}))
        fitting = [at for at in told if at.stage == "fitting"]
        self.assertEqual([at.step for at in fitting], list(range(1, 61)))
        self.assertIn("loss", fitting[-1].values)

    def test_a_callback_may_stop_before_the_first_step(self):
        class Until(list):
            stages = True

            def __init__(self, last):
                super().__init__()
                self.last = last

            def __call__(self, at):
                self.append(at.stage)
                return at.stage == self.last

        folder = self.folder / "pictures"
        folder.mkdir()
        for i, image in enumerate(IMAGES):
            save_image(folder / f"{i}.png", image)
        for images, cameras, last in (
                (IMAGES, CAMERAS, "preparing"), (folder, None, "reading images"),
                (IMAGES[..., :3], CAMERAS, "looking for plain backgrounds")):
            told = Until(last)
            result = tilegrad.fit(images, cameras, callback=told, **SMALL)
            self.assertEqual((result.finished, result.mesh, result.steps), (False, None, 0))
            self.assertEqual(told[-1], last)

    def test_the_work_has_a_thread_callbacks_have_the_callers(self):
        """So a callback may draw, and use what belongs to its thread."""
        threads = []
        tilegrad.fit(IMAGES, CAMERAS, callback=lambda at: threads.append(threading.get_ident()),
                     **SMALL)
        self.assertEqual(set(threads), {threading.get_ident()})


FIT = """
import numpy as np, tilegrad
from test_runs import CAMERAS, IMAGES, SMALL
"""


class Watched(unittest.TestCase):
    """The line that a terminal and a notebook show, and Ctrl-C."""

    def on_terminal(self, code, columns):
        """What is written to a terminal of that width."""
        ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        done = subprocess.Popen([sys.executable, "-c", FIT + code], stderr=theirs,
                                stdout=subprocess.DEVNULL)
        os.close(theirs)
        text = b""
        while True:
            try:
                part = os.read(ours, 4096)
            except OSError:  # the other end is closed
                break
            if not part:
                break
            text += part
        os.close(ours)
        self.assertEqual(done.wait(60), 0, text)
        return text.decode().replace("\r\n", "\n")

    def test_a_terminal_shows_the_stages(self):
        text = self.on_terminal("tilegrad.fit(IMAGES, CAMERAS, **SMALL)", 120)
        self.assertTrue(text.startswith("\rpreparing"), text)
        self.assertRegex(text, r"\rfitting  60/60  100%  loss \d")
        self.assertTrue(text.endswith("\n"))

    def test_a_line_never_reaches_the_edge(self):
        text = self.on_terminal("tilegrad.fit(IMAGES, CAMERAS, **SMALL)", 20)
        drawn = [part for line in text.split("\n") for part in line.split("\r")]
        self.assertEqual(max(map(len, drawn)), 19)

    def test_nobody_watches(self):
        for code in ("tilegrad.fit(IMAGES, CAMERAS, **SMALL)",
                     "import sys; sys.stderr = None; tilegrad.fit(IMAGES, CAMERAS, **SMALL)"):
            done = subprocess.run([sys.executable, "-c", FIT + code], capture_output=True, text=True,
                                  timeout=60)
            self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "", ""))

    def test_a_callback_of_ones_own_stands_alone(self):
        text = self.on_terminal("tilegrad.fit(IMAGES, CAMERAS, callback=lambda at: None, **SMALL)",
                                80)
        self.assertEqual(text, "")

    def test_a_notebook(self):
        kernel = types.SimpleNamespace(get_ipython=lambda: types.SimpleNamespace(kernel=1))
        out = io.StringIO()
        with mock.patch.dict(sys.modules, IPython=kernel), contextlib.redirect_stdout(out):
            tilegrad.fit(IMAGES, CAMERAS, **SMALL)
        self.assertIn("\rfitting  60/60  100%", out.getvalue())

    def test_ctrl_c_ends_it_within_a_second_and_it_goes_on(self):
        code = FIT + """
import sys, time
class Begun:
    stages = True
    def __call__(self, at):
        if at.stage == "fitting":
            print("begun", flush=True)
try:
    tilegrad.fit(IMAGES, CAMERAS, out=sys.argv[1], callback=Begun(), **{**SMALL, "steps": 100000})
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""
        with tempfile.TemporaryDirectory() as folder:
            out = pathlib.Path(folder) / "fit"
            fit = subprocess.Popen([sys.executable, "-c", code, out], stdout=subprocess.PIPE,
                                   text=True)
            self.assertEqual(fit.stdout.readline(), "begun\n")
            fit.send_signal(signal.SIGINT)
            start = time.monotonic()
            lines = fit.communicate(timeout=60)[0].split()
            self.assertEqual(fit.returncode, 0)
            self.assertLess(time.monotonic() - start, 2)  # one, and the end of a process
            self.assertEqual(lines[-1], "interrupted")
            done = tilegrad.fit(IMAGES, CAMERAS, out=out, resume=True,
                                callback=lambda at: True, **{**SMALL, "steps": 100000})
            self.assertGreater(done.steps, 1)


class Train(unittest.TestCase):
    def test_names_a_configuration_and_stops(self):
        self.assertIn("quick", runs.config_names())
        changes = {"schedule.steps": 4, "schedule.batch": 2, "network.channels": 4,
                   "network.code": 8, "network.hidden1": 8, "network.hidden2": 8,
                   "schedule.log_every": 1}
        with tempfile.TemporaryDirectory() as folder:
            out = pathlib.Path(folder) / "run"
            told = []
            part = tilegrad.train("quick", data=dataset(), out=out, set=changes,
                                  callback=lambda at: told.append(at) or at.step >= 2)
            self.assertFalse(part.finished)
            done = tilegrad.train("quick", data=dataset(), out=out, set=changes, resume=True)
            self.assertTrue(done.finished)
            self.assertEqual(done.steps, 4)
            changes["schedule.steps"] = 6
            more = tilegrad.train("quick", data=dataset(), out=out, set=changes, resume=True)
            self.assertEqual(more.steps, 6)
            self.assertIn("loss", told[0].values)
            self.assertEqual(done.predictor().image_size, IMAGES.shape[1])

    def test_errors(self):
        with self.assertRaisesRegex(OSError, "there are best, "):
            tilegrad.train("qick", data="x", out="y")
        for error, message, changes in (
                (ValueError, "max_minutes is nan", {"max_minutes": float("nan")}),
                (ValueError, "max_minutes is -1", {"max_minutes": -1}),
                (TypeError, "train: resume must be bool", {"resume": "no"}),
                (TypeError, "train: set must be a mapping", {"set": ["a"]})):
            self.assertRaisesRegex(error, message, tilegrad.train, data="x", out="y", **changes)
