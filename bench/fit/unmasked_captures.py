#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`tilegrad fit` on pictures without masks, beside the same with true masks: six rendered captures.

    sudo apt-get install --no-install-recommends sweethome3d-furniture
    PYTHONPATH=build/release/python python3 bench/fit/unmasked_captures.py --out captures

Two objects before plain paper, two on a table with a soft shadow below them, two in a cluttered room: walls
and floor with patterns of all sizes, forty boxes around, a shadow. 24 views of 320 x 240 pixels by hand (two
rings, aimed within some per cent), blurred by up to a pixel, with noise, exposures within 5 per cent. Writes
into --out, for each capture: `images`, `transforms.json`, `truth` (the same with alpha), the two fits, and
row.json; then table.md. Captures whose row is there are not fitted again; --only-capture fits nothing.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import pathlib
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np

from tilegrad.images import load_image, save_image

LIBRARIES = pathlib.Path("/usr/share/sweethome3d/furniture")
FOV_Y = 45.0
CAPTURES = {"plain-bear": ("BlendSwap-CC-0", "blendswap-cc-0/teddyBear/teddyBear.obj"),
            "plain-chair": ("Scopia", "scopia/rattanArmchair/rattanArmchair.obj"),
            "table-shoes": ("Scopia", "scopia/sneakers/sneakers.obj"),
            "table-toaster": ("Scopia", "scopia/toaster/toaster.obj"),
            "room-toy": ("BlendSwap-CC-0", "blendswap-cc-0/woodToy/woodToy.obj"),
            "room-armchair": ("Scopia", "scopia/modern_armchair/modern_armchair.obj")}


@dataclasses.dataclass(frozen=True)
class Shots:
    """How many pictures, and their pixels."""
    count: int = 24
    width: int = 320
    height: int = 240


def camera(rng: Any, index: int, count: int) -> Any:
    """Camera to world, NeRF's axes: two rings around the object, by hand."""
    ring, around = divmod(index, count // 2)
    azimuth = 2 * np.pi * (around + 0.5 * ring) / (count // 2) + rng.normal(0, 0.04)
    elevation = np.radians((18, 45)[ring]) + rng.normal(0, 0.04)
    eye = 1.75 * (1 + rng.normal(0, 0.03)) * np.array(
        [np.cos(elevation) * np.cos(azimuth), np.sin(elevation), np.cos(elevation) * np.sin(azimuth)])
    back = eye - rng.normal(0, 0.03, 3)
    back /= np.linalg.norm(back)
    right = np.cross([0, 1, 0], back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([right, np.cross(back, right), back, eye])
    return matrix


def run(program: str, *arguments: Any) -> str:
    done = subprocess.run([program, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode != 0:
        raise SystemExit(f"unmasked_captures: {' '.join(map(str, arguments))} failed:\n{done.stdout}")
    return done.stdout


def scaled(program: str, capture: str, folder: pathlib.Path) -> float:
    """Writes object.glb, 0.9 across; the height of its feet."""
    library, inside = CAPTURES[capture]
    with zipfile.ZipFile(LIBRARIES / f"{library}.sh3f") as archive:
        for name in archive.namelist():
            if name.startswith(f"{pathlib.PurePosixPath(inside).parent}/") and not name.endswith("/"):
                archive.extract(name, folder / "source")
    run(program, "views", folder / "source" / inside, "--out", folder / "scaled", "--views", 1, "--held-out", 0,
        "--size", 8, "--force")
    shutil.move(folder / "scaled" / "truth.glb", folder / "object.glb")
    data = (folder / "object.glb").read_bytes()
    gltf = json.loads(data[20:20 + int.from_bytes(data[12:16], "little")])
    primitives = [p for mesh in gltf["meshes"] for p in mesh["primitives"]]
    return min(gltf["accessors"][p["attributes"]["POSITION"]]["min"][1] for p in primitives)


def render(program: str, mesh: pathlib.Path, folder: pathlib.Path, *shading: Any) -> list[Any]:
    """RGBA in [0, 1] from all cameras."""
    out = folder / f"of_{mesh.stem}"
    run(program, "render", mesh, "--cameras", folder / "transforms.json", "--out", out, "--force", *shading)
    return [load_image(file) / 255 for file in sorted(out.glob("*.png"))]


def stretched(values: Any, side: int) -> Any:
    """Bilinear, of [n, n, channels]."""
    at = np.linspace(0, len(values) - 1, side)
    low = np.minimum(at.astype(int), len(values) - 2)
    share = (at - low)[:, None]
    rows = values[low] * (1 - share[..., None]) + values[low + 1] * share[..., None]
    return rows[:, low] * (1 - share) + rows[:, low + 1] * share


def pattern(rng: Any, base: Any, strength: float, side: int = 512) -> Any:
    """Blots of all sizes around a colour."""
    image = np.tile(np.asarray(base, float), (side, side, 1))
    for cells in (6, 24, 96):
        image += strength * (stretched(rng.random((cells, cells, 3)), side) - 0.5)
    return image


def shaded(image: Any, extent: float, radius: float, darkness: float) -> Any:
    """A quad's texture, `extent` from its middle to its side, with a soft dark blot in the middle."""
    at = (np.arange(len(image)) + 0.5) / len(image) * 2 * extent - extent
    distance = np.hypot(at[:, None] - 0.06, at[None, :] + 0.04) / radius
    return image * (1 - darkness / (1 + np.exp(7 * (distance - 1))))[..., None]


class Scene:
    """Textured quads as an OBJ."""

    def __init__(self, folder: pathlib.Path, name: str):
        self.folder, self.name, self.lines, self.materials = folder, name, [f"mtllib {name}.mtl"], ""

    def add(self, corners: Any, image: Any) -> None:
        key = f"{self.name}{len(self.materials)}"
        save_image(self.folder / f"{key}.png", np.round(255 * image.clip(0, 1)).astype(np.uint8))
        self.materials += f"newmtl {key}\nKd 1 1 1\nmap_Kd {key}.png\n"
        self.lines += [f"usemtl {key}"] + [f"v {x} {y} {z}" for x, y, z in corners]
        self.lines += ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1", "f -4/-4 -3/-3 -2/-2 -1/-1"]

    def box(self, low: Any, high: Any, images: Any) -> None:
        for face, image in zip(range(6), images):
            axis, side = divmod(face, 2)
            u, v = (axis + 1) % 3, (axis + 2) % 3
            corners = []
            for s, t in ((0, 0), (1, 0), (1, 1), (0, 1)):
                corner = [0.0, 0.0, 0.0]
                corner[axis], corner[u], corner[v] = (low, high)[side][axis], (low, high)[s][u], (low, high)[t][v]
                corners.append(corner)
            self.add(corners, image)

    def write(self) -> pathlib.Path:
        (self.folder / f"{self.name}.mtl").write_text(self.materials)
        (self.folder / f"{self.name}.obj").write_text("\n".join(self.lines + [""]))
        return self.folder / f"{self.name}.obj"


def background(kind: str, rng: Any, feet: float, folder: pathlib.Path) -> pathlib.Path:
    scene = Scene(folder, "room")
    low, high, floor = np.array([-4.0, feet, -4.0]), np.array([4.0, 3.0, 4.0]), 4.0
    if kind == "plain":
        low[1] = -3.0
        paper = rng.uniform(0.6, 0.85, 3)
        scene.box(low, high, [pattern(rng, paper * rng.uniform(0.94, 1.06), 0.02) for _ in range(6)])
        return scene.write()
    if kind == "table":
        low[1], floor = feet - 0.8, 0.95
        scene.box(low, high, [pattern(rng, rng.uniform(0.3, 0.8, 3), 0.08) for _ in range(6)])
        wood = pattern(rng, rng.uniform(0.35, 0.75) * np.array([1.15, 0.95, 0.7]), 0.05)
        wood *= 1 + 0.08 * stretched(rng.random((64, 64, 1)) - 0.5, len(wood))[:, :1]
    else:
        scene.box(low, high, [pattern(rng, rng.uniform(0.3, 0.7, 3), 0.35, 1024) for _ in range(6)])
        for _ in range(40):
            angle, far, size = rng.uniform(0, 2 * np.pi), rng.uniform(2.1, 3.4), rng.uniform(0.1, 0.5, 3)
            middle = np.array([far * np.cos(angle), feet + rng.uniform(0, 1.4), far * np.sin(angle)])
            sides = [pattern(rng, rng.uniform(0, 1, 3), 0.2, 64) for _ in range(6)]
            scene.box(middle - size / 2, middle + size / 2, sides)
        wood = pattern(rng, rng.uniform(0.3, 0.7, 3), 0.3, 1024)
    wood = shaded(wood, floor, 0.42, 0.55)
    up = feet + (0 if kind == "table" else 0.002)
    scene.add([(-floor, up, floor), (floor, up, floor), (floor, up, -floor), (-floor, up, -floor)], wood)
    return scene.write()


def blurred(image: Any, sigma: float) -> Any:
    at = np.arange(-3, 4)
    kernel = np.exp(-at**2 / (2 * sigma**2))
    kernel /= kernel.sum()
    for axis in (0, 1):
        padded = np.pad(image, [(3, 3) if a == axis else (0, 0) for a in range(3)], mode="edge")
        image = sum(k * np.take(padded, range(3 + d, 3 + d + image.shape[axis]), axis) for k, d in zip(kernel, at))
    return image


def make(program: str, capture: str, folder: pathlib.Path, shots: Shots = Shots()) -> None:
    rng = np.random.default_rng(sorted(CAPTURES).index(capture))
    for name in ("images", "truth/images", "scene"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    scene = folder / "scene"
    feet = scaled(program, capture, scene)
    focal = shots.height / 2 / np.tan(np.radians(FOV_Y) / 2)
    frames = [{"file_path": f"images/{i:03}.png", "transform_matrix": camera(rng, i, shots.count).tolist()}
              for i in range(shots.count)]
    lens = {"fl_x": focal, "fl_y": focal, "w": shots.width, "h": shots.height}
    cameras = json.dumps({**lens, "frames": frames}, indent=1)
    for place in (folder, folder / "truth", scene):
        (place / "transforms.json").write_text(cameras)
    behind = background(capture.split("-")[0], rng, feet, scene)
    room = render(program, behind, scene, "--shading", "none", "--cull", "none")
    things = render(program, scene / "object.glb", scene, "--light", 0.3, 1, 0.5, 0.7, "--ambient", 0.4)
    for i, (thing, behind) in enumerate(zip(things, room)):
        alpha = thing[..., 3:]
        color = blurred(thing[..., :3] * alpha + behind[..., :3] * (1 - alpha), rng.uniform(0.3, 1.0))
        color = (rng.uniform(0.95, 1.05) * color + rng.normal(0, 0.012, color.shape)).clip(0, 1)
        save_image(folder / f"images/{i:03}.png", np.round(255 * color).astype(np.uint8))
        save_image(folder / f"truth/images/{i:03}.png", np.round(255 * np.dstack([color, alpha])).astype(np.uint8))


def iou(a: Any, b: Any) -> float:
    return float(np.sum(a & b) / np.sum(a | b))


def true_masks(folder: pathlib.Path) -> list[Any]:
    return [load_image(file)[..., 3] >= 128 for file in sorted((folder / "truth/images").glob("*.png"))]


def silhouettes(program: str, fit: pathlib.Path, truth: list[Any], cameras: pathlib.Path) -> float:
    """Per cent, of a fit's mesh in these cameras against the true masks."""
    run(program, "render", fit / "mesh.glb", "--cameras", cameras, "--out", fit / "shown", "--force")
    shown = [load_image(file)[..., 3] >= 128 for file in sorted((fit / "shown").glob("*.png"))]
    return 100 * float(np.mean([iou(a, b) for a, b in zip(shown, truth)]))


def measure(program: str, folder: pathlib.Path, options: list[str]) -> dict[str, Any]:
    run(program, "fit", folder, "--out", folder / "fit", "--force", *options)
    run(program, "fit", folder / "truth", "--out", folder / "fit_truth", "--force", *options)
    truth, cameras = true_masks(folder), folder / "transforms.json"
    masks = [load_image(file)[..., 0] >= 128 for file in sorted((folder / "fit/masks").glob("*.png"))]
    each = [100 * iou(a, b) for a, b in zip(masks, truth)]
    return {"capture": folder.name, "masks": float(np.mean(each)), "worst": min(each),
            "fit": silhouettes(program, folder / "fit", truth, cameras),
            "fit_truth": silhouettes(program, folder / "fit_truth", truth, cameras)}


def tabulate(out: pathlib.Path, captures: list[str], measure: Callable[[pathlib.Path], dict[str, Any]], lines: list[str],
             row: str) -> None:
    """Measures captures below `out` that have no row.json yet. Prints a row each, and writes table.md, which begins with `lines`."""
    for capture in captures:
        record = out / capture / "row.json"
        if not record.exists():
            record.write_text(json.dumps(measure(out / capture)))
        lines.append(row.format(**json.loads(record.read_text())))
        print(lines[-1], flush=True)
    (out / "table.md").write_text("\n".join(lines) + "\n")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", required=True, type=pathlib.Path, help="folder to fill")
    parser.add_argument("--program", default="build/release/src/cli/tilegrad", help="tilegrad")
    parser.add_argument("--only-capture", action="store_true", help="make the captures, fit nothing")
    parser.add_argument("fit", nargs="*", help="after --: options of tilegrad fit")
    options = parser.parse_args()
    lines = ["| capture | masks, IoU | the worst | fit, silhouettes | with true masks |", "|---|--:|--:|--:|--:|"]
    for capture in CAPTURES:
        folder = options.out / capture
        if not (folder / "transforms.json").exists():
            make(options.program, capture, folder)
    if not options.only_capture:
        tabulate(options.out, list(CAPTURES), lambda folder: measure(options.program, folder, options.fit), lines,
                 "| {capture} | {masks:.1f} | {worst:.1f} | {fit:.1f} | {fit_truth:.1f} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
