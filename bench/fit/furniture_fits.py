#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`tilegrad fit` on twenty pieces of furniture, beside a plain carve: the table in docs/results.md.

    sudo apt-get install --no-install-recommends sweethome3d-furniture
    PYTHONPATH=build/release/python python3 bench/fit/furniture_fits.py --out fits

Every 19th model of data/sweethome3d_classes.tsv, from the first: 24 views of 256 x 256 pixels to fit, 8
held out (`tilegrad views`), fitted with defaults, or with what follows `--` on the command line. Writes
into --out, for each model: `views`, `carve.obj`, `fit`, `row.json`; then table.md, and worst.png: rows of
the five models with the lowest 3D IoU, four held-out views each, truth above fit. Models whose row is
there are not fitted again.

The plain carve: of a 96^3 grid over the cube in which `tilegrad views` puts the model, the cells whose
centre falls on every mask, as boxes; no gradient step.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import re
import resource
import statistics
import subprocess
import sys
import zipfile
from typing import Any

import numpy as np

from tilegrad.images import load_image, save_image

ROOT = pathlib.Path(__file__).resolve().parents[2]
LIBRARIES = pathlib.Path("/usr/share/sweethome3d/furniture")
EVERY, GRID, HALF_EXTENT = 19, 96, 0.45
WORST, SHOWN = 5, 4  # models of worst.png, and held-out views of each


def models() -> list[dict[str, str]]:
    lines = (ROOT / "data" / "sweethome3d_classes.tsv").read_text().splitlines()
    keys = lines[0].split("\t")
    return [dict(zip(keys, line.split("\t"))) for line in lines[1:]][::EVERY]


def name_of(model: dict[str, str]) -> str:
    return f"{model['class']}-{pathlib.PurePosixPath(model['model']).stem}"


def tilegrad(program: str, *arguments: Any) -> tuple[str, float]:
    """What it printed, and its processor seconds."""
    def used() -> float:
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    before = used()
    command = [program, *map(str, arguments)]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode != 0:
        raise SystemExit(f"furniture_fits: {' '.join(command)} failed:\n{done.stdout}")
    return done.stdout, used() - before


def make_views(program: str, model: dict[str, str], folder: pathlib.Path) -> None:
    inside = pathlib.PurePosixPath(model["model"])
    with zipfile.ZipFile(LIBRARIES / f"{model['library']}.sh3f") as archive:
        for name in archive.namelist():
            if name.startswith(f"{inside.parent}/") and not name.endswith("/"):
                archive.extract(name, folder / "source")
    tilegrad(program, "views", folder / "source" / inside, "--out", folder / "views")


def carve(views: pathlib.Path) -> Any:
    """[x, y, z] of bool."""
    data = json.loads((views / "transforms_train.json").read_text())
    at = (np.arange(GRID) + 0.5) / GRID * 2 * HALF_EXTENT - HALF_EXTENT
    points = np.stack(np.meshgrid(at, at, at, indexing="ij"), -1).reshape(-1, 3)
    kept = np.ones(len(points), bool)
    for frame in data["frames"]:
        mask = load_image(views / frame["file_path"])[..., 3] >= 128
        intrinsics = {**data, **frame}
        pose = np.array(frame["transform_matrix"])
        seen = (points - pose[:3, 3]) @ pose[:3, :3]
        column = intrinsics["cx"] - intrinsics["fl_x"] * seen[:, 0] / seen[:, 2]
        row = intrinsics["cy"] + intrinsics["fl_y"] * seen[:, 1] / seen[:, 2]
        x, y = np.floor(column).astype(int), np.floor(row).astype(int)
        inside = (x >= 0) & (y >= 0) & (x < mask.shape[1]) & (y < mask.shape[0])
        kept &= inside
        kept[inside] &= mask[y[inside], x[inside]]
    return kept.reshape(GRID, GRID, GRID)


def write_boxes(cells: Any, file: pathlib.Path) -> None:
    """The outside of the cells, as an OBJ."""
    padded = np.pad(cells, 1)
    lines: list[str] = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, 1):
            outer = np.roll(padded, 1 - 2 * side, axis)[1:-1, 1:-1, 1:-1]
            for cell in np.argwhere(cells & ~outer):
                corners = []
                for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1))[::1 if side else -1]:
                    corner = cell.copy()
                    corner[axis] += side
                    corner[u] += du
                    corner[v] += dv
                    corners.append(corner / GRID * 2 * HALF_EXTENT - HALF_EXTENT)
                lines += ["v {:.6f} {:.6f} {:.6f}".format(*corner) for corner in corners]
                lines.append("f -4 -3 -2 -1")
    file.write_text("\n".join(lines) + "\n")


def mesh_iou(program: str, mesh: pathlib.Path, views: pathlib.Path, scratch: pathlib.Path) -> float:
    """By the rule of `tilegrad fit --truth`: a fit whose rates are 0."""
    out, _ = tilegrad(program, "fit", views, "--mesh", mesh, "--truth", views / "truth.glb", "--out", scratch,
                      "--force", "--steps", 1, "--rate", "positions=0", "--rate", "colors=0", "--timelapse", 0)
    return number(r"3D IoU at 32 voxels a side: ([\d.]+)", out)


def number(pattern: str, text: str) -> float:
    found = re.search(pattern, text)
    if found is None:
        raise SystemExit(f"furniture_fits: nothing like {pattern} in:\n{text}")
    return float(found.group(1))


def shown_pairs(folder: pathlib.Path) -> list[tuple[Any, Any]]:
    """Held-out views, RGBA of [0, 255]: truth, and what `tilegrad render` made of the fit."""
    frames = json.loads((folder / "views" / "transforms_test.json").read_text())["frames"]
    files = sorted((folder / "shown").glob("*.png"))
    return [(load_image(folder / "views" / frame["file_path"]).astype(float), load_image(file).astype(float))
            for frame, file in zip(frames, files)]


def silhouette_iou(folder: pathlib.Path) -> float:
    """Per cent: the sum of minima of both alphas by that of maxima, which is 100 where they agree; for two
    equal masks with soft borders, equation 12's, which `tilegrad fit` prints, is less."""
    alphas = [(truth[..., 3], fitted[..., 3]) for truth, fitted in shown_pairs(folder)]
    return 100 * statistics.fmean(np.minimum(a, b).sum() / np.maximum(a, b).sum() for a, b in alphas)


def measure(options: argparse.Namespace, model: dict[str, str], folder: pathlib.Path) -> dict[str, Any]:
    views = folder / "views"
    if not (views / "transforms_train.json").exists():
        make_views(options.program, model, folder)
    carved = folder / "carve.json"
    if not carved.exists():
        write_boxes(carve(views), folder / "carve.obj")
        iou = mesh_iou(options.program, folder / "carve.obj", views, folder / "carve_fit")
        carved.write_text(json.dumps(iou))
    out, seconds = tilegrad(options.program, "fit", views, "--truth", views / "truth.glb", "--out", folder / "fit",
                            "--force", *options.fit)
    tilegrad(options.program, "render", folder / "fit" / "mesh.glb", "--cameras", views / "transforms_test.json",
             "--out", folder / "shown", "--format", "png", "--force")
    held_out = r"held-out views: PSNR ([\d.]+) dB, silhouette IoU ([\d.]+) %"
    return {"name": name_of(model), "carve": json.loads(carved.read_text()),
            "iou": number(r"3D IoU at 32 voxels a side: ([\d.]+)", out),
            "psnr": number(held_out, out),
            "silhouette": silhouette_iou(folder),
            "seconds": seconds}


COLUMNS = (("carve", "plain carve, 3D IoU", 1), ("iou", "3D IoU", 1), ("silhouette", "held-out silhouettes", 1),
           ("psnr", "held-out PSNR, dB", 1), ("seconds", "processor seconds", 0))


def table(rows: list[dict[str, Any]]) -> str:
    mean = {key: statistics.fmean(row[key] for row in rows) for key, _, _ in COLUMNS}
    lines = ["| model | " + " | ".join(title for _, title, _ in COLUMNS) + " |",
             "|---|" + "--:|" * len(COLUMNS)]
    for row in [*rows, {"name": "mean", **mean}]:
        cells = [f"{row[key]:.{digits}f}" for key, _, digits in COLUMNS]
        lines.append(f"| {row['name']} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def over_white(rgba: Any) -> Any:
    return 255 + rgba[..., 3:] / 255 * (rgba[..., :3] - 255)


def draw_worst(rows: list[dict[str, Any]], out: pathlib.Path) -> None:
    lines = []
    for row in sorted(rows, key=lambda row: row["iou"])[:WORST]:
        pairs = shown_pairs(out / row["name"])[:SHOWN]
        lines += [[over_white(truth) for truth, _ in pairs], [over_white(fitted) for _, fitted in pairs]]
    picture = np.concatenate([np.concatenate(line, axis=1) for line in lines])
    save_image(out / "worst.png", np.round(picture).astype(np.uint8))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", required=True, help="folder to fill")
    parser.add_argument("--program", default="build/release/src/cli/tilegrad", help="tilegrad")
    parser.add_argument("--only", help="names of models, separated by commas")
    parser.add_argument("fit", nargs="*", help="after --: options of tilegrad fit")
    options = parser.parse_args()
    if not LIBRARIES.exists():
        raise SystemExit(f"furniture_fits: {LIBRARIES} is not there: apt-get install sweethome3d-furniture")
    out, rows = pathlib.Path(options.out), []
    for model in models():
        if options.only and name_of(model) not in options.only.split(","):
            continue
        folder = out / name_of(model)
        folder.mkdir(parents=True, exist_ok=True)
        record = folder / "row.json"
        if not record.exists():
            record.write_text(json.dumps(measure(options, model, folder)))
        rows.append(json.loads(record.read_text()))
        print(rows[-1], flush=True)
    (out / "table.md").write_text(table(rows))
    draw_worst(rows, out)
    print(table(rows), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
