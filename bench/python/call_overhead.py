# SPDX-License-Identifier: Apache-2.0
"""What a call from Python costs beside the same call in C++: 64 images of 64 x 64, 1,280 faces.

    cmake --preset release && cmake --build build/release --target tilegrad_python call_server
    PYTHONPATH=build/release/python /usr/bin/python3 bench/python/call_overhead.py

A C++ program and this one render the same batch in turns, a few steps each, so that what else the
machine does meets both alike. A step in Python is what a loop writes: a batch is rendered, and for
"backward" pulled back to positions and colours, into new arrays. The batch is one scene with a
leading axis or a list of 64 scenes; scenes are kept, as by loops that change their arrays in place,
or made anew in every step, which is constructors more than a call, and does not count for the
limit. Times are of the CPU, of all threads; the ratio is the median over turns of Python / C++.
Exit code 1 if it is above the limit.
"""

import argparse
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np

import tilegrad

ROOT = pathlib.Path(__file__).resolve().parents[2]
IMAGES, SIZE = 64, 64


class Batch:
    """The arrays of a step."""

    def __init__(self):
        sphere, self.faces = tilegrad.icosphere(3, 0.5)
        numbers = np.random.default_rng(1)
        noise = numbers.uniform(-0.01, 0.01, (IMAGES, *sphere.shape))
        self.positions = (sphere + noise).astype(np.float32)
        self.colors = numbers.uniform(0.2, 0.9, sphere.shape).astype(np.float32)
        self.camera = tilegrad.Camera.orbit(np.linspace(0, 350, IMAGES), 20, 2, width=SIZE,
                                            height=SIZE)
        pixels = (IMAGES, SIZE, SIZE)
        self.d_color = numbers.uniform(-1, 1, (IMAGES, 3, SIZE, SIZE)).astype(np.float32)
        self.d_alpha = numbers.uniform(-1, 1, pixels).astype(np.float32)

    def write(self, path):
        """As call_server reads it."""
        sizes = [IMAGES, self.positions.shape[1], len(self.faces), SIZE]
        parts = [np.array(sizes, np.int32), self.positions, self.colors,
                 self.camera.numbers.astype(np.float32), self.faces, self.d_color, self.d_alpha]
        path.write_bytes(b"".join(part.tobytes() for part in parts))

    def scene(self):
        """64 images."""
        return tilegrad.Scene(self.positions, self.faces, self.camera, colors=self.colors)

    def scenes(self):
        """64 scenes of an image each."""
        return [tilegrad.Scene(self.positions[n], self.faces, self.camera[n], colors=self.colors)
                for n in range(IMAGES)]


class Python:
    """This side."""

    def __init__(self, batch, threads, scenes):
        self.batch, self.scenes = batch, scenes
        self.renderer = tilegrad.Renderer(threads)

    def step(self, backward):
        b = self.batch
        frame = self.renderer.render(self.scenes(), width=SIZE, height=SIZE)
        if backward:
            self.renderer.backward(frame, color=b.d_color, alpha=b.d_alpha,
                                   wrt=("positions", "colors"))

    def seconds(self, backward, steps):
        """Of wall clock and CPU."""
        wall, cpu = time.perf_counter(), time.process_time()
        for _ in range(steps):
            self.step(backward)
        return time.perf_counter() - wall, time.process_time() - cpu


class Cpp:
    """The other side."""

    def __init__(self, server, path, threads):
        self.process = subprocess.Popen([server, path, str(threads)], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True)

    def seconds(self, backward, steps):
        self.process.stdin.write(f"{int(backward)} {steps}\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if not line:
            sys.exit("call_server ended before it answered")
        return tuple(map(float, line.split()))


def ratios(python, cpp, backward, options):
    """Python / C++ for each turn, and the seconds of a step in C++, by CPU time."""
    out, seconds = [], []
    for turn in range(options.turns + 1):
        pair = [side.seconds(backward, options.steps)[1]
                for side in ((python, cpp) if turn % 2 else (cpp, python))]
        mine, theirs = pair if turn % 2 else reversed(pair)
        if turn:  # the first one takes memory
            out.append(mine / theirs)
            seconds.append(theirs / options.steps)
    return out, statistics.median(seconds)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--turns", type=int, default=40, help="2 or more, for quartiles")
    parser.add_argument("--steps", type=int, default=5, help="of each in a turn")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--limit", type=float, default=1.05, help="largest Python / C++")
    parser.add_argument("--server", default=str(ROOT / "build/release/bench/python/call_server"))
    options = parser.parse_args()
    if options.turns < 2:
        parser.error(f"--turns {options.turns}: quartiles take 2 or more")
    batch, worst = Batch(), 0.0
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "batch"
        batch.write(path)
        cpp = Cpp(options.server, path, options.threads)
        print("| scenes | step | C++ ms | Python / C++ | quartiles |")
        print("| --- | --- | --- | --- | --- |")
        kept = batch.scenes()
        one = batch.scene()
        kinds = {"one of 64 images, kept": lambda: one, "64 in a list, kept": lambda: kept,
                 "one of 64 images, made anew": batch.scene,
                 "64 in a list, made anew": batch.scenes}
        for kind, scenes in kinds.items():
            python = Python(batch, options.threads, scenes)
            for backward in (False, True):
                found, seconds = ratios(python, cpp, backward, options)
                low, middle, high = statistics.quantiles(found, n=4)
                if "kept" in kind:
                    worst = max(worst, middle)
                print(f"| {kind} | {'forward + backward' if backward else 'forward'} | "
                      f"{1e3 * seconds:.2f} | {middle:.3f} | {low:.3f} to {high:.3f} |", flush=True)
        cpp.process.stdin.close()
        cpp.process.wait()
    return 0 if worst <= options.limit else 1


if __name__ == "__main__":
    sys.exit(main())
