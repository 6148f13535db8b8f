#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Streamed training from a synthetic set of ShapeNet's size beside training from a small part of it.

    bench/train/large_set.py PROGRAM FOLDER [--models 44000] [--small 400] [--cache 140M] [--steps 20] [--turns 3] [--threads 2] [--set KEY=VALUE ...]

Writes FOLDER/net in the layout of ShapeNetCore v1 (models of 2,000 faces, each with a shape of its own and a texture of 256 x 256; there are 256
textures, and hard links to them), makes a dataset of all and one of --small models, and trains configs/texture_quick.toml on both in turns, with
a cache that holds all of the small one and --small / --models of the large one. Prints peak memory, images a second, and processor time. What is
there is taken again; remove FOLDER afterwards (44,000 models: 6 GB).
"""
import argparse
import json
import math
import os
import pathlib
import random
import statistics
import struct
import subprocess
import zlib

ROWS, COLUMNS, SIDE, TEXTURES = 21, 50, 256, 256
CONFIG = pathlib.Path(__file__).parents[2] / "configs/texture_quick.toml"


def chunk(kind, data):
    """Of a PNG file."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(seed):
    """Coloured stripes with some noise."""
    rng = random.Random(seed)
    base = bytes(rng.randrange(256) for _ in range(3 * 16))
    rows = b"".join(b"\0" + bytes((base[3 * ((x + y) // 16 % 16) + c] + rng.getrandbits(3)) % 256 for x in range(SIDE) for c in range(3))
                    for y in range(SIDE))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", SIDE, SIDE, 8, 2, 0, 0, 0)) + chunk(b"IDAT", zlib.compress(rows, 6))
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


def sphere(seed):
    """Vertices of a sphere with bumps and axes of its own."""
    rng = random.Random(seed)
    x, y, z, bump, waves, phase = (rng.uniform(low, high) for low, high in ((0.3, 1), (0.2, 0.7), (0.6, 1), (0, 0.3), (1, 6), (0, 6)))
    out = []
    for r in range(ROWS):
        polar = math.pi * (0.001 + 0.998 * r / (ROWS - 1))
        for c in range(COLUMNS):
            turn = 2 * math.pi * c / COLUMNS
            radius = 1 + bump * math.sin(round(waves) * turn + phase) * math.sin(polar)
            out += [x * radius * math.sin(polar) * math.cos(turn), -y * math.cos(polar), z * radius * math.sin(polar) * math.sin(turn)]
    return ("mtllib model.mtl\n" + "v %.5f %.5f %.5f\n" * (ROWS * COLUMNS)) % tuple(out)


def write_set(folder, count):
    textures = folder / "textures"
    textures.mkdir(parents=True, exist_ok=True)
    for t in range(TEXTURES):
        if not (textures / f"{t}.png").exists():
            (textures / f"{t}.png").write_bytes(png(t))
    rest = rest_of_obj()
    for m in range(count):
        model = folder / "net" / ("02958343", "03001627", "04256520", "02691156")[m % 4] / f"{m:08x}"
        if (model / "model.obj").exists():
            continue
        (model / "images").mkdir(parents=True, exist_ok=True)
        (model / "model.mtl").write_text("newmtl painted\nKd 1 1 1\nmap_Kd ./images/texture0.png\n")
        if not (model / "images/texture0.png").exists():
            os.link(textures / f"{m % TEXTURES}.png", model / "images/texture0.png")
        (model / "model.obj").write_text(sphere(m) + rest)


def run(words, log):
    """Peak memory in MB and processor seconds."""
    with open(log, "w") as out:
        child = subprocess.Popen([str(word) for word in words], stdout=out, stderr=out)
        _, status, usage = os.wait4(child.pid, 0)
    if status:
        raise SystemExit(pathlib.Path(log).read_text())
    return usage.ru_maxrss / 1024, usage.ru_utime + usage.ru_stime


def train(args, data):
    """Peak memory in MB, images a second without the first steps, and processor seconds of a step."""
    out = args.folder / "run"
    subprocess.run(["rm", "-rf", str(out)], check=True)
    words = [args.program, "train", "--config", CONFIG, "--data", data, "--out", out, "--quiet", "--threads", args.threads]
    settings = ["schedule.log_every=1", "schedule.sample_every=1000000", "schedule.checkpoint_every=1000000", f"stream.cache={args.cache}"]
    short = [word for setting in settings + args.set for word in ("--set", setting)]
    _, little = run(words + ["--steps", "1"] + short, args.folder / "log")
    subprocess.run(["rm", "-rf", str(out)], check=True)
    peak, seconds = run(words + ["--steps", args.steps + 1] + short, args.folder / "log")
    lines = [json.loads(line) for line in (out / "metrics.jsonl").read_text().splitlines()]
    steps = [b["seconds"] - a["seconds"] for a, b in zip(lines[2:], lines[3:])]
    return peak, 2 * 24 / statistics.mean(steps), (seconds - little) / args.steps


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    for name, value in {"models": 44000, "small": 400, "steps": 20, "turns": 3, "threads": 2}.items():
        parser.add_argument(f"--{name}", type=int, default=value)
    parser.add_argument("--cache", default="140M")
    parser.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE")
    args = parser.parse_args()
    write_set(args.folder, args.models)
    for name, limit in (("large", args.models), ("small", args.small)):
        peak, seconds = run([args.program, "dataset", "--source", "shapenet", "--input", args.folder / "net", "--out", args.folder / name, "--views", 1,
                             "--limit", limit, "--workers", args.threads], args.folder / "log")
        print(f"dataset of {limit} models: {peak:.0f} MB at most, {seconds:.0f} s of processor time", flush=True)
    turns = {"small": [], "large": []}
    for _ in range(args.turns):
        for name, results in turns.items():
            results.append(train(args, args.folder / name))
    for name, results in turns.items():
        peak, rate, seconds = (statistics.median(column) for column in zip(*results))
        print(f"{name}: {peak:.0f} MB at most, {rate:.1f} images a second, {seconds * 1e3:.0f} ms of processor time a step")
    for k, what in enumerate(("peak memory", "images a second", "processor time")):
        ratios = sorted(large[k] / small[k] for small, large in zip(turns["small"], turns["large"]))
        print(f"{what}, large over small: {statistics.median(ratios):.3f} ({ratios[0]:.3f} to {ratios[-1]:.3f})")


if __name__ == "__main__":
    main()
