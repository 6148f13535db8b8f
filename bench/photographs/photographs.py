#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A set of pictures as a phone would take them, of a mesh whose shape is known.

    bench/photographs/photographs.py MESH --out DIR [--program build/release/src/cli/tilegrad]

The object stands on a patterned cloth before a grey wall. The camera goes around it by hand, in two rings,
and nothing about it is written where COLMAP or a fit could see it. Imperfections: exposures from 0.75 to 1.25,
blur of up to one pixel, noise, JPEG, masks that are a pixel too wide or too narrow and have a bite taken out.

    DIR/images/000.jpg ...          DIR/masks/000.jpg.png ...
    DIR/truth/transforms.json       cameras as they were, with the exposures; DIR/truth/truth.glb
Needs python3-numpy, python3-pil.
"""
import argparse
import json
import pathlib
import subprocess

import numpy as np
from PIL import Image, ImageFilter

WIDTH, HEIGHT, FOV_Y = 640, 480, 45.0
HALF_EXTENT = 0.45  # what `tilegrad views` scales meshes to


def camera(rng, index, count):
    """Camera to world (NeRF's axes) of a person who walks around twice, and shakes a little."""
    ring, around = divmod(index, count // 2)
    azimuth = 2 * np.pi * (around + 0.5 * ring) / (count // 2) + rng.normal(0, 0.04)
    elevation = np.radians((22, 48)[ring]) + rng.normal(0, 0.04)
    distance = 1.7 * (1 + rng.normal(0, 0.04))
    eye = distance * np.array([np.cos(elevation) * np.cos(azimuth), np.sin(elevation), np.cos(elevation) * np.sin(azimuth)])
    back = eye - rng.normal(0, 0.03, 3)
    back /= np.linalg.norm(back)
    right = np.cross([np.sin(rng.normal(0, 0.03)), 1, 0], back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([right, np.cross(back, right), back, eye])
    return matrix


def cloth(folder, rng, bottom):
    """A square of cloth below the object, as OBJ: blots and lines of all sizes, for features."""
    size, image = 1024, np.full((1024, 1024, 3), 0.5)
    for cells in (8, 32, 128, 512):
        noise = Image.fromarray((255 * rng.random((cells, cells, 3))).astype(np.uint8)).resize((size, size), Image.BICUBIC)
        image += 0.35 * (np.asarray(noise) / 255 - 0.5)
    Image.fromarray((255 * image.clip(0, 1)).astype(np.uint8)).save(folder / "cloth.png")
    (folder / "cloth.mtl").write_text("newmtl cloth\nKd 1 1 1\nmap_Kd cloth.png\n")
    corners = ((-1.2, 1.2), (1.2, 1.2), (1.2, -1.2), (-1.2, -1.2))
    lines = ["mtllib cloth.mtl", "usemtl cloth"] + [f"v {x} {bottom} {z}" for x, z in corners]
    (folder / "cloth.obj").write_text("\n".join(lines + ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1", "f 1/1 2/2 3/3 4/4", ""]))


def render(program, mesh, folder, extra):
    """RGBA pictures of a mesh from the true cameras, in the cameras' order."""
    out = folder / mesh.stem
    subprocess.run([program, "render", mesh, "--cameras", folder / "transforms.json", "--size", f"{WIDTH}x{HEIGHT}",
                    "--out", out, "--force", *extra], check=True, stdout=subprocess.DEVNULL)
    return [np.asarray(Image.open(f)) / 255 for f in sorted(out.glob("*.png"))]


def over(top, below):
    return top[..., :3] * top[..., 3:] + below * (1 - top[..., 3:])


def photograph(rng, color, gain):
    """What a phone makes of it."""
    picture = Image.fromarray((255 * (gain * color).clip(0, 1)).astype(np.uint8))
    blurred = np.asarray(picture.filter(ImageFilter.GaussianBlur(rng.uniform(0.2, 1.0)))) / 255
    return Image.fromarray((255 * (blurred + rng.normal(0, 0.012, blurred.shape)).clip(0, 1)).astype(np.uint8))


def mask(rng, alpha):
    """A cut-out by hand: a pixel off, with a bite on its edge."""
    image = Image.fromarray((255 * alpha).astype(np.uint8)).point(lambda v: 255 * (v > 127))
    image = image.filter(ImageFilter.MaxFilter(3) if rng.random() < 0.5 else ImageFilter.MinFilter(3))
    values = np.array(image)
    ys, xs = np.nonzero(values)
    edge = rng.integers(len(ys))
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    values[(y - ys[edge]) ** 2 + (x - xs[edge]) ** 2 < rng.uniform(2, 6) ** 2] = 0
    return Image.fromarray(values)


def lowest(program, mesh, truth):
    """The mesh as `tilegrad views` scales it, and the height of its feet."""
    subprocess.run([program, "views", mesh, "--out", truth / "views", "--views", "1", "--held-out", "0", "--size", "8",
                    "--force"], check=True, stdout=subprocess.DEVNULL)
    (truth / "views" / "truth.glb").rename(truth / "truth.glb")
    data = (truth / "truth.glb").read_bytes()
    length = int.from_bytes(data[12:16], "little")
    gltf = json.loads(data[20:20 + length])
    return min(gltf["accessors"][p["attributes"]["POSITION"]]["min"][1] for m in gltf["meshes"] for p in m["primitives"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--program", type=pathlib.Path, default="build/release/src/cli/tilegrad")
    parser.add_argument("--count", type=int, default=30)
    args = parser.parse_args()
    rng = np.random.default_rng(1)
    truth = args.out / "truth"
    for folder in (args.out / "images", args.out / "masks", truth):
        folder.mkdir(parents=True, exist_ok=True)
    cloth(truth, rng, lowest(args.program, args.mesh, truth))
    gains = rng.uniform(0.75, 1.25, args.count)
    frames = [{"file_path": f"../images/{i:03}.jpg", "transform_matrix": camera(rng, i, args.count).tolist(),
               "exposure_gain": gains[i]} for i in range(args.count)]
    focal = HEIGHT / 2 / np.tan(np.radians(FOV_Y) / 2)
    (truth / "transforms.json").write_text(json.dumps(
        {"fl_x": focal, "fl_y": focal, "w": WIDTH, "h": HEIGHT, "frames": frames}, indent=1))
    objects = render(args.program, truth / "truth.glb", truth, ["--shading", "lambert", "--light", "0.3", "1", "0.5", "1", "--ambient", "0.5"])
    grounds = render(args.program, truth / "cloth.obj", truth, ["--shading", "none"])
    for i, (thing, ground) in enumerate(zip(objects, grounds)):
        photograph(rng, over(thing, over(ground, np.full(3, 0.7))), gains[i]).save(args.out / f"images/{i:03}.jpg", quality=93)
        mask(rng, thing[..., 3]).save(args.out / f"masks/{i:03}.jpg.png")


if __name__ == "__main__":
    main()
