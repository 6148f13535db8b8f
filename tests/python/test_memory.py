# SPDX-License-Identifier: Apache-2.0
"""What is copied, what keeps which memory alive, and when it is released."""

import gc
import unittest
import weakref

import numpy as np

import tilegrad
from scenes import ALL, IMAGE, cotangents, patch
from test_arrays import DlpackOnly
from tilegrad import Renderer, Scene


class Copies(unittest.TestCase):
    def test_a_step_copies_nothing(self):
        renderer = Renderer()
        for dtype in (np.float32, np.float64):
            for count in (None, 3):
                kept = patch(dtype, count=count)
                tilegrad.reset_stats()
                scene = Scene(**kept._arguments)
                frame = renderer.render(scene, **IMAGE)
                renderer.backward(frame, **cotangents(frame))
                counts = tilegrad.stats()
                self.assertEqual((counts["copies"], counts["bytes_copied"]), (0, 0))
                self.assertGreater(counts["arrays"], 8)
                for name in ("positions", "faces", "colors", "uvs", "attributes"):
                    self.assertIs(scene[name], kept._arguments[name])

    def test_what_must_be_copied_is_counted(self):
        scene = patch()
        tilegrad.reset_stats()
        scene.replace(faces=scene.faces.astype(np.int64))
        self.assertEqual(tilegrad.stats()["copies"], 1)
        self.assertEqual(tilegrad.stats()["bytes_copied"], scene.faces.nbytes)
        scene.replace(colors=np.asfortranarray(scene["colors"]))
        scene.replace(colors=scene["colors"].astype(np.float64))
        scene.replace(positions=np.asfortranarray(scene.positions))
        self.assertEqual(tilegrad.stats()["copies"], 4)
        frame = Renderer().render(scene, **IMAGE)
        Renderer().backward(frame, alpha=np.ones(frame.alpha.shape))
        self.assertEqual(tilegrad.stats()["copies"], 5)

    def test_changes_in_place_are_seen(self):
        """Scenes are views: moving the array moves the mesh."""
        renderer, scene = Renderer(), patch()
        before = np.array(renderer.render(scene, **IMAGE).alpha)
        scene.positions[:, 0] += 0.2
        self.assertFalse(np.array_equal(before, renderer.render(scene, **IMAGE).alpha))

    def test_other_arrays(self):
        """The buffer protocol and DLPack, for scenes and cotangents."""
        plain = patch()
        wrapped = plain.replace(positions=DlpackOnly(plain.positions),
                                faces=memoryview(plain.faces), colors=memoryview(plain["colors"]))
        self.assertTrue(np.shares_memory(wrapped.positions, plain.positions))
        self.assertTrue(np.shares_memory(wrapped.faces, plain.faces))
        renderer = Renderer()
        frame = renderer.render(wrapped, **IMAGE)
        expected = renderer.render(plain, **IMAGE)
        self.assertTrue(np.array_equal(frame.color, expected.color))
        weights = np.array(frame.alpha)
        got = renderer.backward(frame, alpha=DlpackOnly(weights))
        self.assertTrue(np.array_equal(got.positions,
                                       renderer.backward(frame, alpha=weights).positions))


class Memory(unittest.TestCase):
    def test_views_keep_their_frame(self):
        """Whatever is deleted and rendered after: an image stays what it was."""
        renderer = Renderer()
        scene = patch()
        frame = renderer.render(scene, outputs=ALL, **IMAGE)
        kept = {name: (getattr(frame, name), np.array(getattr(frame, name)))
                for name in (*ALL, "face_ids")}
        shared = frame.shared("color")
        del frame
        gc.collect()
        for _ in range(8):
            other = renderer.render(patch(seed=3), outputs=ALL, **IMAGE)
            del other
        del renderer, scene
        gc.collect()
        for name, (view, copy) in kept.items():
            self.assertTrue(np.array_equal(view, copy), name)
        self.assertTrue(np.array_equal(shared, kept["color"][1]))

    def test_frames_are_independent(self):
        renderer = Renderer()
        frames = [renderer.render(patch(seed=seed), **IMAGE) for seed in range(5)]
        for seed, frame in enumerate(frames):
            self.assertTrue(np.array_equal(frame.color,
                                           Renderer().render(patch(seed=seed), **IMAGE).color))

    def test_a_frame_keeps_its_scene(self):
        """backward reads the scene's arrays, long after anybody else has forgotten them."""
        renderer = Renderer()
        expected = renderer.render(patch(), **IMAGE)
        pulled = cotangents(expected)
        expected = renderer.backward(expected, **pulled).positions
        frame = renderer.render(patch(), **IMAGE)
        gc.collect()
        junk = [np.full((16, 3), np.nan, np.float32) for _ in range(100)]
        self.assertTrue(np.array_equal(renderer.backward(frame, **pulled).positions, expected))
        del junk

    def test_memory_is_reused_and_released(self):
        renderer = Renderer()
        scene, places = patch(), set()
        for _ in range(10):
            frame = renderer.render(scene, **IMAGE)
            places.add(frame.color.ctypes.data)
        self.assertLessEqual(len(places), 3)
        gone = weakref.ref(scene.positions)
        del frame, scene
        gc.collect()
        self.assertIsNone(gone())

    def test_shared_arrays_can_be_written_to(self):
        frame = Renderer().render(patch(), **IMAGE)
        self.assertTrue(frame.shared("color").flags.writeable)
        self.assertTrue(np.shares_memory(frame.shared("color"), frame.color))
        self.assertRaisesRegex(AttributeError, "uv was not rendered", frame.shared, "uv")
