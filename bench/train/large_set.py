#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Streamed training from a synthetic set of ShapeNet's size beside training from a small part of it.

    bench/train/large_set.py PROGRAM FOLDER [--models 44000] [--small 400] [--cache 104M] [--steps 20] [--turns 3] [--threads 2] [--set KEY=VALUE ...]

Writes FOLDER/net in the layout of ShapeNetCore v1 (models of 2,000 faces, each with a shape and a texture of 256 x 256 of its own), makes a dataset
of all and one of --small models, and trains configs/texture_quick.toml on both in turns, with a cache that just holds the training models of the
small one: --small / --models of the large one's. Prints peak memory, images a second, and processor time; then whether trainings on the large one
come to the same bits with a smaller cache, one thread, and after a kill. What is there is taken again; remove FOLDER afterwards (44,000 models: 11 GB).
"""
import argparse
import hashlib
import json
import math
import multiprocessing
import os
import pathlib
import random
import statistics
import struct
import subprocess
import time
import zlib

ROWS, COLUMNS, SIDE = 21, 50, 256
SYNSETS = "02958343", "03001627", "04256520", "02691156"
CONFIG = pathlib.Path(__file__).parents[2] / "configs/texture_quick.toml"


def chunk(kind, data):
    """Of a PNG file."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


# Three bits of each colour, none of what begins a row.
NOISE = int.from_bytes((b"\0" + b"\7" * (3 * SIDE)) * SIDE, "little")


def png(rng):
    """Slanted stripes in sixteen colours, with noise."""
    stripes = b"".join(bytes(rng.randrange(248) for _ in range(3)) * (SIDE // 16) for _ in range(16))
    flat = b"".join(b"\0" + stripes[3 * y:] + stripes[:3 * y] for y in range(SIDE))
    rows = (int.from_bytes(flat, "little") + (rng.getrandbits(8 * len(flat)) & NOISE)).to_bytes(len(flat), "little")
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", SIDE, SIDE, 8, 2, 0, 0, 0)) + chunk(b"IDAT", zlib.compress(rows, 1))
            + chunk(b"IEND", b""))


def corner(row, column):
    """A vertex and its texture coordinates, counted from 1."""
    return f"{row * COLUMNS + column % COLUMNS + 1}/{row * (COLUMNS + 1) + column + 1}"


def rest_of_obj():
    """Texture coordinates and the 2,000 faces of a sphere of rings; only vertices differ between models."""
    lines = [f"vt {c / COLUMNS:.4f} {r / (ROWS - 1):.4f}" for r in range(ROWS) for c in range(COLUMNS + 1)] + ["usemtl painted"]
    for r in range(ROWS - 1):
        for c in range(COLUMNS):
            here, far = corner(r, c), corner(r + 1, c + 1)
            lines += [f"f {here} {corner(r, c + 1)} {far}", f"f {here} {far} {corner(r + 1, c)}"]
    return "\n".join(lines) + "\n"


POLARS = [math.pi * (0.001 + 0.998 * r / (ROWS - 1)) for r in range(ROWS)]
TURNS = [2 * math.pi * c / COLUMNS for c in range(COLUMNS)]
VERTICES = "mtllib model.mtl\n" + "v %.5f %.5f %.5f\n" * (ROWS * COLUMNS)
REST = rest_of_obj()


def sphere(rng):
    """Vertices of a sphere with bumps and axes of its own."""
    x, y, z, bump, waves, phase = (rng.uniform(low, high) for low, high in ((0.3, 1), (0.2, 0.7), (0.6, 1), (0, 0.3), (1, 6), (0, 6)))
    bumps = [bump * math.sin(round(waves) * turn + phase) for turn in TURNS]
    across = [(x * math.cos(turn), z * math.sin(turn)) for turn in TURNS]
    out = []
    for polar in POLARS:
        ring, height = math.sin(polar), -y * math.cos(polar)
        for b, (u, v) in zip(bumps, across):
            radius = (1 + b * ring) * ring
            out += (u * radius, height, v * radius)
    return VERTICES % tuple(out)


def write_model(job):
    net, m = job
    model = net / SYNSETS[m % len(SYNSETS)] / f"{m:08x}"
    if (model / "model.obj").exists():
        return
    rng = random.Random(m)
    (model / "images").mkdir(parents=True, exist_ok=True)
    (model / "model.mtl").write_text("newmtl painted\nKd 1 1 1\nmap_Kd ./images/texture0.png\n")
    (model / "images/texture0.png").write_bytes(png(rng))
    (model / "model.obj").write_text(sphere(rng) + REST)


def write_set(net, count, processes):
    with multiprocessing.Pool(processes) as pool:
        for _ in pool.imap_unordered(write_model, ((net, m) for m in range(count)), chunksize=100):
            pass


def run(words, log):
    """Peak memory in MB and processor seconds."""
    with open(log, "w") as out:
        child = subprocess.Popen([str(word) for word in words], stdout=out, stderr=out)
        _, status, usage = os.wait4(child.pid, 0)
    if status:
        raise SystemExit(pathlib.Path(log).read_text())
    return usage.ru_maxrss / 1024, usage.ru_utime + usage.ru_stime


def training(args, data, out, settings):
    """The words of a training whose folder is new."""
    subprocess.run(["rm", "-rf", str(out)], check=True)
    words = [args.program, "train", "--config", CONFIG, "--data", data, "--out", out, "--quiet"]
    return words + [word for setting in ["schedule.sample_every=1000000"] + settings + args.set for word in ("--set", setting)]


def train(args, data):
    """Peak memory in MB, images a second without the first steps, and processor seconds of a step."""
    out = args.folder / "run"
    settings = ["schedule.log_every=1", "schedule.checkpoint_every=1000000", f"stream.cache={args.cache}"]
    steps = ["--threads", args.threads, "--steps"]
    _, little = run(training(args, data, out, settings) + steps + [1], args.folder / "log")
    peak, seconds = run(training(args, data, out, settings) + steps + [args.steps + 1], args.folder / "log")
    lines = [json.loads(line) for line in (out / "metrics.jsonl").read_text().splitlines()]
    times = [b["seconds"] - a["seconds"] for a, b in zip(lines[2:], lines[3:])]
    return peak, 2 * 24 / statistics.mean(times), (seconds - little) / args.steps


def compare_speed(args):
    turns = {"small": [], "large": []}
    for _ in range(args.turns):
        for name, results in turns.items():
            results.append(train(args, args.folder / name))
    for name, results in turns.items():
        peak, rate, seconds = (statistics.median(column) for column in zip(*results))
        print(f"{name}: {peak:.0f} MB at most, {rate:.1f} images a second, {seconds * 1e3:.0f} ms of processor time a step")
    for k, what in enumerate(("peak memory", "images a second", "processor time")):
        ratios = sorted(large[k] / small[k] for small, large in zip(turns["small"], turns["large"]))
        print(f"{what}, large over small: {statistics.median(ratios):.3f} ({ratios[0]:.3f} to {ratios[-1]:.3f})", flush=True)


CHECKED_STEPS, KILLED_AFTER = 6, 2


def checkpoint(out, step):
    return out / f"checkpoints/step_{step:08}.safetensors"


def fingerprint(out):
    """Of all tensors of the last checkpoint; its header has times, too."""
    content = checkpoint(out, CHECKED_STEPS).read_bytes()
    return hashlib.sha256(content[8 + struct.unpack("<Q", content[:8])[0]:]).hexdigest()[:16]


def killed_training(args, words, out):
    """Kills it once it has a checkpoint, and resumes."""
    child = subprocess.Popen([str(word) for word in words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while child.poll() is None and not checkpoint(out, KILLED_AFTER).exists():
        time.sleep(0.05)
    child.kill()
    child.wait()
    if checkpoint(out, CHECKED_STEPS).exists():
        raise SystemExit("the training ended before it was killed")
    run([args.program, "train", "--resume", out, "--quiet"], args.folder / "log")


def compare_bits(args):
    found = {}
    for cache, threads, killed in ((args.cache, 2, False), ("8M", 2, False), ("8M", 1, False), (args.cache, 2, True)):
        out = args.folder / "run"
        settings = [f"schedule.checkpoint_every={KILLED_AFTER}", f"stream.cache={cache}"]
        words = training(args, args.folder / "large", out, settings) + ["--threads", threads, "--steps", CHECKED_STEPS]
        if killed:
            killed_training(args, words, out)
        else:
            run(words, args.folder / "log")
        found[f"cache {cache}, {threads} threads" + (", killed" if killed else "")] = fingerprint(out)
    for name, bits in found.items():
        print(f"{name}: {bits}")
    if len(set(found.values())) > 1:
        raise SystemExit("the bits differ")


def parse():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    for name, value in {"models": 44000, "small": 400, "steps": 20, "turns": 3, "threads": 2}.items():
        parser.add_argument(f"--{name}", type=int, default=value)
    parser.add_argument("--cache", default="104M")
    parser.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE")
    return parser.parse_args()


def main():
    args = parse()
    write_set(args.folder / "net", args.models, args.threads)
    for name, limit in (("large", args.models), ("small", args.small)):
        words = [args.program, "dataset", "--source", "shapenet", "--input", args.folder / "net", "--out", args.folder / name, "--views", 1, "--limit",
                 limit, "--workers", args.threads]
        peak, seconds = run(words, args.folder / "log")
        print(f"dataset of {limit} models: {peak:.0f} MB at most, {seconds:.0f} s of processor time", flush=True)
    compare_speed(args)
    compare_bits(args)


if __name__ == "__main__":
    main()
