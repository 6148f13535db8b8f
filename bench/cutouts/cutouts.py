#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`tilegrad predict` on cutouts that are not of its dataset: docs/predict.md.

    sudo apt-get install --no-install-recommends tuxpaint-stamps-default ufoai-data
    PYTHONPATH=build/release/python python3 bench/cutouts/cutouts.py --run runs/mine --data datasets/mine \\
        --out cutouts

Photographs, and renders of models from one stated camera, all of objects.tsv. Writes into --out:
`inputs`; `predicted`; sheet.png, each row input, result from the same camera, and the result from two
other sides; table.md. Of models the truth is known: 3D IoU of the result and of the shape that the
nearest training picture shows. Inputs and truth that are there are kept.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile
import zipfile
from typing import Any, Optional

import numpy as np

from tilegrad.dataset import Dataset
from tilegrad.images import load_image, save_image

HERE = pathlib.Path(__file__).resolve().parent
STAMPS = pathlib.Path("/usr/share/tuxpaint/stamps")
MODELS = pathlib.Path("/usr/share/games/ufoai/base/0models.pk3")
# The azimuth from which a camera sees the axis, as of `tilegrad render`; objects of datasets face +z.
SEEN_FROM = {"+x": 0, "+z": 90, "-x": 180, "-z": 270}
AZIMUTH, ELEVATION, SIZE = 55, 20, 256  # of a dataset's object, degrees; pixels
THUMBNAIL = 16
IOU_WANTED, COLOR_WANTED = 0.90, 0.06
CELL, COLUMNS = 128, 2  # of the sheet: pixels, objects side by side
TURNED = (7, 3)  # of the turntable's eight views: 45 degrees, and the opposite side
GAP = 4  # between cells of predict's pictures


@dataclasses.dataclass
class Object:
    class_name: str
    name: str
    kind: str
    file: str
    front: str

    @property
    def turn(self) -> int:
        """Degrees from an azimuth of the dataset to one of the file."""
        return SEEN_FROM[self.front] - SEEN_FROM["+z"]


@dataclasses.dataclass
class Outcome:
    silhouette: float
    color: float
    iou: Optional[float] = None  # of models
    retrieved_iou: Optional[float] = None

    @property
    def good(self) -> bool:
        return self.silhouette >= IOU_WANTED and self.color <= COLOR_WANTED


def read_objects() -> list[Object]:
    lines = (HERE / "objects.tsv").read_text().splitlines()
    return [Object(*line.split("\t")) for line in lines if not line.startswith("#")]


def tilegrad(options: argparse.Namespace, *arguments: Any) -> None:
    command = [options.program, *map(str, arguments)]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode != 0:
        raise SystemExit(f"cutouts: {' '.join(command[:2])} failed:\n{done.stdout}")


def unpack(object_: Object, folder: pathlib.Path) -> pathlib.Path:
    """The model with all files of its folder, textures among them. Returns where it is."""
    inside = pathlib.PurePosixPath("models/objects") / object_.file
    with zipfile.ZipFile(MODELS) as archive:
        for name in archive.namelist():
            if name.startswith(f"{inside.parent}/") and not name.endswith("/"):
                archive.extract(name, folder)
    return folder / inside


def make_inputs(options: argparse.Namespace, objects: list[Object], out: pathlib.Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    for one in objects:
        picture = out / f"{one.name}.png"
        if picture.exists():
            continue
        if one.kind == "photo":
            picture.write_bytes((STAMPS / one.file).read_bytes())
            continue
        with tempfile.TemporaryDirectory() as folder:
            tilegrad(options, "render", unpack(one, pathlib.Path(folder)), "--out", picture, "--size", SIZE,
                     "--azimuth", (AZIMUTH + one.turn) % 360, "--elevation", ELEVATION)


def voxels(options: argparse.Namespace, meshes: dict[str, pathlib.Path], out: pathlib.Path) -> dict[str, Any]:
    """Occupancy [x, y, z] of meshes by the dataset's rule, each filling its cube."""
    with tempfile.TemporaryDirectory() as folder:
        for name, mesh in meshes.items():
            place = pathlib.Path(folder) / "thing" / f"{name}{mesh.suffix}"
            place.parent.mkdir(exist_ok=True)
            place.symlink_to(mesh.resolve())
        tilegrad(options, "dataset", "--source", "folder", "--input", folder, "--out", out, "--views", 1,
                 "--size", 16, "--test-share", 0)
    data = Dataset(out, split=None)
    return {model.id: data.truth(i).occupancy for i, model in enumerate(data.models)}


def turned(occupancy: Any, degrees: int) -> Any:
    """From the axes of a file to those of datasets."""
    return np.rot90(occupancy, k=-degrees // 90, axes=(0, 2))


def true_voxels(options: argparse.Namespace, objects: list[Object], out: pathlib.Path) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        meshes = {one.name: unpack(one, pathlib.Path(folder) / one.name) for one in objects
                  if one.kind == "model"}
        found = voxels(options, meshes, out)
    return {one.name: turned(found[one.name], one.turn) for one in objects if one.kind == "model"}


def iou(a: Any, b: Any) -> float:
    return float(np.logical_and(a, b).sum() / np.logical_or(a, b).sum())


def thumbnail(rgba: Any) -> Any:
    """(H, W, 4) bytes, RGB over black: the object's square, averaged; numbers [0, 1]."""
    rows, columns = (np.flatnonzero((rgba[..., 3] >= 128).any(axis=axis)) for axis in (1, 0))
    if len(rows) == 0:
        return np.zeros((THUMBNAIL, THUMBNAIL, 4), np.float32)
    side = max(np.ptp(rows), np.ptp(columns)) + 1
    height, width = rgba.shape[:2]
    # Sums over areas from a table of sums, at places between pixels too.
    table = np.zeros((height + 1, width + 1, 4))
    table[1:, 1:] = rgba.astype(np.float64).cumsum(0).cumsum(1)

    def edges(first: int, last: int, size: int) -> tuple[Any, Any, Any]:
        at = 0.5 * (first + last + 1 - side) + side * np.arange(THUMBNAIL + 1) / THUMBNAIL
        at = np.clip(at, 0, size)
        low = np.minimum(np.floor(at).astype(int), size - 1)
        return low, low + 1, at - low

    y0, y1, fy = edges(rows[0], rows[-1], height)
    x0, x1, fx = edges(columns[0], columns[-1], width)
    lines = table[y0] * (1 - fy)[:, None, None] + table[y1] * fy[:, None, None]
    sums = lines[:, x0] * (1 - fx)[:, None] + lines[:, x1] * fx[:, None]
    areas = np.diff(np.diff(sums, axis=0), axis=1)
    return (areas / (side / THUMBNAIL) ** 2 / 255).astype(np.float32)


class Retrieval:
    """The training model one of whose pictures, framed as the input, is nearest to it."""

    def __init__(self, folder: pathlib.Path) -> None:
        self._data = Dataset(folder, split="train")
        thumbnails = []
        for item in self._data:
            planes = np.concatenate([item["images"], item["masks"][:, None]], axis=1)
            thumbnails.append([thumbnail(np.round(255 * view.transpose(1, 2, 0))) for view in planes])
        self._thumbnails = np.array(thumbnails)

    def occupancy(self, picture: pathlib.Path) -> Any:
        image = load_image(picture)
        rgba = image.astype(np.float64)
        rgba[..., :3] *= rgba[..., 3:] / 255
        gaps = ((self._thumbnails - thumbnail(rgba)) ** 2).sum(axis=(2, 3, 4))
        return self._data.truth(int(gaps.min(axis=1).argmin())).occupancy


def cells_of(picture: pathlib.Path, columns: int) -> list[Any]:
    """The square cells of a picture that predict has tiled, row by row, in the sheet's size."""
    image = load_image(picture)[..., :3]
    side = (image.shape[1] - GAP * (columns - 1)) // columns
    corners = [(y, x) for y in range(0, image.shape[0], side + GAP) for x in range(0, image.shape[1], side + GAP)]
    step = side // CELL
    return [image[y:y + side, x:x + side].reshape(CELL, step, CELL, step, 3).mean(axis=(1, 3))
            for y, x in corners]


def draw_sheet(objects: list[Object], predicted: pathlib.Path, file: pathlib.Path) -> None:
    rows = []
    for one in objects:
        seen, _, match = cells_of(predicted / f"{one.name}_match.png", 3)
        around = cells_of(predicted / f"{one.name}_turntable.png", 4)
        rows.append(np.concatenate([seen, match, *(around[i] for i in TURNED)], axis=1))
    length = -(-len(rows) // COLUMNS)
    rows += [np.full_like(rows[0], 255)] * (COLUMNS * length - len(rows))
    gap = np.full((length * CELL, CELL // 8, 3), 255.0)
    columns: list[Any] = []
    for i in range(COLUMNS):
        columns += [gap] * (i > 0) + [np.concatenate(rows[i * length:(i + 1) * length])]
    save_image(file, np.round(np.concatenate(columns, axis=1)).astype(np.uint8))


def outcomes(options: argparse.Namespace, objects: list[Object], out: pathlib.Path) -> dict[str, Outcome]:
    found = {}
    for one in objects:
        record = json.loads((out / "predicted" / f"{one.name}_match.json").read_text())
        found[one.name] = Outcome(record["silhouette_iou"][1], record["color_l1"][1])
    if not options.data:
        return found
    truth = true_voxels(options, objects, out / "truth")
    with tempfile.TemporaryDirectory() as folder:
        meshes = {name: out / "predicted" / f"{name}_predicted.glb" for name in truth}
        shapes = voxels(options, meshes, pathlib.Path(folder) / "data")
    retrieval = Retrieval(options.data)
    for name, occupancy in truth.items():
        found[name].iou = iou(shapes[name], occupancy)
        found[name].retrieved_iou = iou(retrieval.occupancy(out / "inputs" / f"{name}.png"), occupancy)
    return found


def percent(value: Optional[float]) -> str:
    return "" if value is None else f"{100 * value:.1f}"


def table(objects: list[Object], found: dict[str, Outcome]) -> str:
    lines = ["| object | class | from | silhouette IoU | colour L1 | 3D IoU | of the nearest picture | |",
             "|---|---|---|--:|--:|--:|--:|---|"]
    for one in objects:
        got = found[one.name]
        lines.append(f"| {one.name} | {one.class_name} | {one.kind} | {percent(got.silhouette)} | "
                     f"{got.color:.3f} | {percent(got.iou)} | {percent(got.retrieved_iou)} | "
                     f"{'' if got.good else 'missed'} |")
    all_ = list(found.values())
    means = [statistics.fmean(one.silhouette for one in all_), statistics.fmean(one.color for one in all_)]
    known = [one for one in all_ if one.iou is not None]
    volumes = [percent(statistics.fmean(value)) if known else "" for value in
               ([one.iou for one in known], [one.retrieved_iou for one in known])]
    lines.append(f"| mean | | | {percent(means[0])} | {means[1]:.3f} | {volumes[0]} | {volumes[1]} | "
                 f"{sum(one.good for one in all_)} of {len(all_)} |")
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", required=True, help="run folder")
    parser.add_argument("--out", required=True, help="folder to fill")
    parser.add_argument("--data", help="dataset that the run was trained on; without it no 3D IoU")
    parser.add_argument("--keep", action="store_true", help="predictions that are there: only score and draw")
    parser.add_argument("--program", default="build/release/src/cli/tilegrad", help="tilegrad")
    options = parser.parse_args()
    out = pathlib.Path(options.out)
    objects = read_objects()
    for place in (STAMPS, MODELS):
        if not place.exists():
            raise SystemExit(f"cutouts: {place} is not there: apt-get install tuxpaint-stamps-default ufoai-data")
    make_inputs(options, objects, out / "inputs")
    pictures = [out / "inputs" / f"{one.name}.png" for one in objects]
    if not options.keep:
        tilegrad(options, "predict", "--run", options.run, "--out", out / "predicted", *pictures)
    found = outcomes(options, objects, out)
    draw_sheet(objects, out / "predicted", out / "sheet.png")
    text = table(objects, found)
    (out / "table.md").write_text(text)
    print(text, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
