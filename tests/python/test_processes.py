# SPDX-License-Identifier: Apache-2.0
"""Threads and processes: whoever renders, and however many at a time, the bits are the same."""

import concurrent.futures
import gc
import importlib.util
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
import traceback
import unittest
import weakref
from pathlib import Path

import numpy as np

import tilegrad
from scenes import ALL, IMAGE, cotangents, patch
from test_errors import DlpackOnly
from tilegrad import Camera, Renderer, Scene

NAMES = ("positions", "camera", "colors", "uvs", "textures", "lights")


def step(renderer, seed=7, dtype=np.float32, count=6):
    """All bits of a render and its gradients."""
    frame = renderer.render(patch(dtype, count=count, seed=seed), outputs=ALL, **IMAGE)
    got = renderer.backward(frame, wrt=NAMES, **cotangents(frame, ALL[:-1]))
    arrays = [getattr(frame, name) for name in ALL]
    arrays += [value[0] if name == "textures" else value for name, value in got._arrays.items()]
    return b"".join(array.tobytes() for array in arrays)


def in_child(call):
    """Whether `call` returns true in a forked child, within a minute."""
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        signal.alarm(60)
        try:
            code = 0 if call() else 1
        except BaseException:
            traceback.print_exc()
            code = 2
        os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def run_python(code, **variables):
    return subprocess.run([sys.executable, "-c", code], env={**os.environ, **variables},
                          capture_output=True, text=True, timeout=60)


def rendered_by_pool(seed):
    """What a worker of a pool does: it has no renderer but the one of its module."""
    return step(POOLED, seed)


POOLED = Renderer(threads=2)


class Threads(unittest.TestCase):

    def run_at_once(self, renderers, rounds=12):
        """Each renderer on a Python thread of its own, all starting together."""
        expected = [step(Renderer(threads=1), seed) for seed in range(len(renderers))]
        start = threading.Barrier(len(renderers))

        def work(seed):
            start.wait()
            return all(step(renderers[seed], seed) == expected[seed] for _ in range(rounds))

        with concurrent.futures.ThreadPoolExecutor(len(renderers)) as pool:
            self.assertEqual(list(pool.map(work, range(len(renderers)))), [True] * len(renderers))

    def test_one_renderer_for_all(self):
        """Calls wait for each other."""
        self.run_at_once([Renderer(threads=2)] * 3)

    def test_python_goes_on_meanwhile(self):
        """The GIL is released: another thread counts while this one renders."""
        positions, faces = tilegrad.icosphere(5)
        camera = Camera.orbit(30, 20, 3, width=512, height=512)
        scene = Scene(positions, faces, camera)
        counts, stop = [0], threading.Event()

        def count():
            while not stop.is_set():
                counts[0] += 1
                time.sleep(0)  # lets the GIL go

        switch = sys.getswitchinterval()
        counter = threading.Thread(target=count)
        try:
            counter.start()
            sys.setswitchinterval(1000)  # nobody is made to give the GIL up: only who lets it go
            before = counts[0]
            Renderer(threads=1).render([scene] * 4, width=512, height=512)
            self.assertGreater(counts[0], before)
        finally:
            stop.set()
            sys.setswitchinterval(switch)
            counter.join()

    def test_daemons_do_not_disturb_the_end(self):
        """Of the interpreter, which comes while they render."""
        code = """
import threading, time
from test_processes import Renderer, step
def work():
    renderer = Renderer(threads=1)
    while True:
        step(renderer)
for _ in range(3):
    threading.Thread(target=work, daemon=True).start()
time.sleep(0.3)
"""
        done = run_python(code)
        self.assertEqual((done.returncode, done.stderr), (0, ""))


class Forks(unittest.TestCase):
    """After the parent has rendered, so that its threads exist and are gone in the child."""

    def test_children_get_the_same_bits(self):
        renderer = Renderer(threads=3)
        expected = step(renderer)
        frame = renderer.render(patch(), **IMAGE)
        pulled = cotangents(frame)
        gradient = renderer.backward(frame, **pulled).positions

        def same():
            """The parent's renderer and frame, and new ones."""
            again = renderer.backward(frame, **pulled).positions
            return (np.array_equal(again, gradient) and step(renderer) == expected
                    and step(Renderer(threads=2)) == expected)

        for _ in range(5):
            self.assertTrue(in_child(same))
            self.assertTrue(same())

    def test_children_that_leave_as_programs_do(self):
        """By the end of the script, with everything that Python and the libraries do then."""
        code = """
import os, signal
from test_processes import Renderer, step
renderer = Renderer(threads=3)
expected = step(renderer)
child = os.fork()
signal.alarm(60)
assert step(renderer) == expected
if child:
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
        done = run_python(code)
        self.assertEqual((done.stdout, done.stderr), ("0\n", ""))

    def test_a_fork_while_another_thread_renders(self):
        renderer = Renderer(threads=2)
        expected = step(renderer)
        stop = threading.Event()

        def work():
            while not stop.is_set():
                step(renderer)

        busy = threading.Thread(target=work)
        busy.start()
        try:
            for _ in range(10):
                self.assertTrue(in_child(lambda: step(renderer) == expected))
        finally:
            stop.set()
            busy.join()

    def test_two_workers_at_once(self):
        """A multiprocessing pool of forked workers, as DataLoaders have it."""
        expected = [step(POOLED, seed) for seed in range(8)]  # the parent's threads exist now
        with multiprocessing.get_context("fork").Pool(2) as pool:
            got = pool.map_async(rendered_by_pool, range(8), chunksize=1).get(timeout=120)
        self.assertEqual(got, expected)


class FewThreads(unittest.TestCase):
    """A system that refuses threads (tests/support/few_threads.c, preloaded): fewer work, and one
    warning says so."""

    def expect(self, code, output):
        """The code asks for 3 threads beside the main one."""
        library = Path(os.environ["TILEGRAD_BUILD"]) / "tests" / "base" / "libfew_threads.so"
        code = "import warnings; warnings.simplefilter('always')\n" + code
        for granted in (0, 1, 2, 3, 20):
            with self.subTest(granted=granted):
                done = run_python(code, LD_PRELOAD=str(library), OMP_NUM_THREADS="1",
                                  OPENBLAS_NUM_THREADS="1", TILEGRAD_TEST_THREADS=str(granted))
                self.assertEqual((done.returncode, done.stdout), (0, output), done.stderr)
                self.assertEqual(done.stderr.count("RuntimeWarning: the system allows fewer threads"),
                                 granted < 3, done.stderr)

    def test_renderers(self):
        self.expect("""
from test_processes import Renderer, step
one = step(Renderer(threads=1))
print([step(Renderer(threads=n)) == one for n in (4, 3, 2)])
""", "[True, True, True]\n")

    @unittest.skipIf(importlib.util.find_spec("torch") is None, "torch is absent")
    def test_ported_code(self):
        self.expect("""
import os, torch, tilegrad.compat.nvdiffrast.torch as dr
from test_nvdiffrast import triangle
os.environ["TILEGRAD_NUM_THREADS"] = "4"
rast, _ = dr.rasterize(dr.RasterizeCudaContext(), *triangle(), (16, 16))
print((rast[..., 3] > 0).sum().item() > 0)
""", "True\n")


class LittleMemory(unittest.TestCase):
    def test_a_thread_that_runs_out_says_so(self):
        """Limits of addresses that a render of many scenes meets at many places: MemoryError,
        whichever thread it is. In 8 of 48 children the process ended, "cannot allocate memory for
        thread-local data"."""
        code = """
import os, resource, tilegrad
camera = tilegrad.Camera(translation=(0, 0, -3), fx=64, fy=64, cx=32, cy=32)
scenes = [tilegrad.Scene(*tilegrad.icosphere(5), camera) for _ in range(64)]

def child(kilobytes):
    renderer = tilegrad.Renderer(threads=8)
    renderer.render(scenes[0], width=8, height=8)
    pages = int(open("/proc/self/statm").read().split()[0])
    most = pages * resource.getpagesize() + (kilobytes << 10)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    try:
        renderer.render(scenes, width=64, height=64, delta=1e-2)
    except MemoryError:
        return 3
    return 0

for kilobytes in range(5000, 100000, 4000):
    pid = os.fork()
    if pid == 0:
        os._exit(child(kilobytes))
    print(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
"""
        done = run_python(code)
        codes = done.stdout.split()
        self.assertEqual(len(codes), 24, done.stderr)
        self.assertLessEqual(set(codes), {"0", "3"}, done.stderr)
        self.assertGreater(codes.count("3"), 5)


class Environment(unittest.TestCase):
    def test_number_of_threads(self):
        code = """
import tilegrad, os
scene = tilegrad.Scene([[0, 0, -1], [1, 0, -1], [0, 1, -1]], [[0, 1, 2]], tilegrad.Camera())
renderer = tilegrad.Renderer()
before = len(os.listdir("/proc/self/task"))
renderer.render([scene] * 64)
print(renderer.threads, len(os.listdir("/proc/self/task")) - before)
"""
        self.assertEqual(run_python(code, TILEGRAD_THREADS="1", TILEGRAD_NUM_THREADS="3").stdout, "1 0\n")
        self.assertIn(run_python(code, TILEGRAD_NUM_THREADS="3").stdout, ("3 1\n", "3 2\n"))
        wrong = run_python(code, TILEGRAD_THREADS="many")
        self.assertIn("ValueError: Renderer: TILEGRAD_THREADS='many' in the environment, must "
                      "be a number in 1..1024", wrong.stderr)

    def test_instruction_set(self):
        code = "import tilegrad; print(tilegrad.simd_target())"
        here = run_python(code).stdout
        self.assertEqual(run_python(code, TILEGRAD_TARGET=here.strip()).stdout, here)
        wrong = run_python(code, TILEGRAD_TARGET="MMX")
        self.assertIn("MMX", wrong.stderr)
        self.assertNotEqual(wrong.returncode, 0)

    def test_modules_need_no_import_of_their_own(self):
        code = "import tilegrad; print(tilegrad.files.mesh_endings()[0], tilegrad.fragments.__name__)"
        self.assertEqual(run_python(code).stdout, ".glb tilegrad.fragments\n")
        self.assertIn("no attribute 'file'", run_python("import tilegrad; tilegrad.file").stderr)


# What is copied, what keeps which memory alive, and when it is released.

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
