#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`tilegrad fit` on pictures alone: cameras by COLMAP, masks, mesh, in one command, against the truth.

    sudo apt-get install --no-install-recommends sweethome3d-furniture colmap
    PYTHONPATH=build/release/python python3 bench/fit/pictures_alone.py --out alone

The captures of unmasked_captures.py, 32 views of 640 x 480 pixels. Writes into --out, for each capture:
the capture, `pictures` (nothing but its pictures), `fit`, log.txt, and row.json; then table.md. The true
cameras come into the fit's world by the similarity that brings theirs nearest, and the fit's silhouettes
there are compared with the true masks. Captures whose row is there are not fitted again.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import re
import shutil
import sys
import time
from typing import Any

import numpy as np
from unmasked_captures import CAPTURES, Shots, make, run, silhouettes, tabulate, true_masks

SHOTS = Shots(32, 640, 480)
PLACED = re.compile(r"COLMAP placed (\d+) of \d+ images")


def poses(file: pathlib.Path) -> dict[str, Any]:
    """Camera to world by the name of the picture."""
    frames = json.loads(file.read_text())["frames"]
    return {pathlib.PurePosixPath(frame["file_path"]).name: np.array(frame["transform_matrix"]) for frame in frames}


def nearest_rotation(matrix: Any) -> Any:
    u, _, v = np.linalg.svd(matrix)
    return u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v


def similarity(old: list[Any], new: list[Any]) -> tuple[Any, float, Any]:
    """Rotation, scale and offset that bring cameras `old` nearest to `new`."""
    turn = nearest_rotation(sum(b[:3, :3] @ a[:3, :3].T for a, b in zip(old, new)))
    a, b = np.array([m[:3, 3] for m in old]), np.array([m[:3, 3] for m in new])
    turned = (a - a.mean(0)) @ turn.T
    scale = float(np.sum(turned * (b - b.mean(0))) / np.sum(turned**2))
    return turn, scale, b.mean(0) - scale * turn @ a.mean(0)


def moved(pose: Any, by: tuple[Any, float, Any]) -> Any:
    turn, scale, offset = by
    out = np.eye(4)
    out[:3, :3] = turn @ pose[:3, :3]
    out[:3, 3] = scale * turn @ pose[:3, 3] + offset
    return out


def degrees(a: Any, b: Any) -> float:
    return float(np.degrees(np.arccos(np.clip((np.trace(a[:3, :3].T @ b[:3, :3]) - 1) / 2, -1, 1))))


def measure(program: str, folder: pathlib.Path, options: list[str]) -> dict[str, Any]:
    pictures, fit = folder / "pictures", folder / "fit"
    shutil.rmtree(pictures, ignore_errors=True)
    shutil.copytree(folder / "images", pictures)
    start = time.monotonic()
    log = run(program, "fit", pictures, "--out", fit, "--force", *options)
    seconds = time.monotonic() - start
    (folder / "log.txt").write_text(log)
    truth, fitted = poses(folder / "transforms.json"), poses(fit / "transforms_fitted.json")
    names = sorted(fitted)
    by = similarity([truth[name] for name in names], [fitted[name] for name in names])
    aligned = {name: moved(pose, by) for name, pose in truth.items()}
    cameras = json.loads((folder / "transforms.json").read_text())
    for frame in cameras["frames"]:
        frame["transform_matrix"] = aligned[pathlib.PurePosixPath(frame["file_path"]).name].tolist()
    (folder / "aligned.json").write_text(json.dumps(cameras))
    placed = PLACED.search(log)
    return {"capture": folder.name, "placed": int(placed.group(1)) if placed else 0,
            "degrees": float(np.mean([degrees(aligned[name], fitted[name]) for name in names])),
            "silhouettes": silhouettes(program, fit, true_masks(folder), folder / "aligned.json"),
            "seconds": seconds}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", required=True, type=pathlib.Path, help="folder to fill")
    parser.add_argument("--program", default="build/release/src/cli/tilegrad", help="tilegrad")
    parser.add_argument("--only", default=",".join(CAPTURES), help="captures, separated by commas")
    parser.add_argument("fit", nargs="*", help="after --: options of tilegrad fit")
    options = parser.parse_args()
    lines = [f"| capture | placed, of {SHOTS.count} | cameras, degrees off | silhouettes, IoU | seconds |",
             "|---|--:|--:|--:|--:|"]
    captures = options.only.split(",")
    for capture in captures:
        if not (options.out / capture / "transforms.json").exists():
            make(options.program, capture, options.out / capture, SHOTS)
    tabulate(options.out, captures, lambda folder: measure(options.program, folder, options.fit), lines,
             "| {capture} | {placed} | {degrees:.2f} | {silhouettes:.1f} | {seconds:.0f} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
