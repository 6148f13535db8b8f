# SPDX-License-Identifier: Apache-2.0
"""Fits the corners and the colours of a cube to small images, with nvdiffrast's functions.

The loop is written for nvdiffrast; the import below is all that makes it run on a CPU. A cube whose
corners and colours are random at first is seen from random sides, in images of a few pixels that
become finer, and compared with those of a cube that is right. What moves the corners is the
gradient of coverage, which antialias makes.

    python3 fit_nvdiffrast.py                     # about a minute on two cores
    python3 fit_nvdiffrast.py --svg loss.svg --pictures cubes.png
"""

from __future__ import annotations

import argparse
import time
from typing import NamedTuple

import torch

import tilegrad.compat.nvdiffrast.torch as dr
from loss_curve import loss_curve_svg

RATES = (1e-2, 1e-4)  # of Adam, at the first and the last step
BATCH = 8


class Cube(NamedTuple):
    """corners [8,3] and their faces [12,3]; colors [24,3], four for each side, and theirs [12,3]."""

    corners: torch.Tensor
    corner_faces: torch.Tensor
    colors: torch.Tensor
    color_faces: torch.Tensor


def make_cube() -> Cube:
    """Of half-extent 0.5; no two of its sides, and no two corners of a side, have the same colour."""
    corners = torch.tensor([[x, y, z] for x in (-.5, .5) for y in (-.5, .5) for z in (-.5, .5)])
    corner_faces, color_faces, colors = [], [], []
    for axis in range(3):
        for side in (-0.5, 0.5):
            a, b, c, d = torch.nonzero(corners[:, axis] == side).flatten().tolist()
            first = len(colors)
            corner_faces += [(a, b, d), (a, d, c)]
            color_faces += [(first, first + 1, first + 3), (first, first + 3, first + 2)]
            base = torch.tensor([axis == i for i in range(3)]).float() * (0.6 + side) + 0.2
            colors += [base + 0.5 * (corners[v] + 0.5) * (base < 0.5) for v in (a, b, c, d)]
    return Cube(corners, torch.tensor(corner_faces, dtype=torch.int32), torch.stack(colors),
                torch.tensor(color_faces, dtype=torch.int32))


def perspective(focal: float = 2.2, near: float = 1.0, far: float = 20.0) -> torch.Tensor:
    """The projection of OpenGL, to clip space."""
    return torch.tensor([[focal, 0, 0, 0], [0, focal, 0, 0],
                         [0, 0, (far + near) / (near - far), 2 * far * near / (near - far)],
                         [0, 0, -1, 0]])


def random_views(count: int) -> torch.Tensor:
    """Matrices [count,4,4] from the cube's space to clip space: turned at random, 3.5 away."""
    turns = torch.linalg.qr(torch.randn(count, 3, 3))[0]
    turns = turns * torch.linalg.det(turns)[:, None, None]
    views = torch.eye(4).repeat(count, 1, 1)
    views[:, :3, :3] = turns
    views[:, 2, 3] = -3.5
    return perspective() @ views


class Renderer:
    """Images of cubes that share their faces."""

    def __init__(self, cube: Cube) -> None:
        self.context = dr.RasterizeCpuContext()
        self.cube = cube

    def __call__(self, corners: torch.Tensor, colors: torch.Tensor, views: torch.Tensor,
                 size: int) -> torch.Tensor:
        """[N, size, size, 3], bottom row first."""
        homogeneous = torch.nn.functional.pad(corners, (0, 1), value=1.0)
        clip = torch.matmul(homogeneous, views.transpose(1, 2)).contiguous()
        rast, _ = dr.rasterize(self.context, clip, self.cube.corner_faces, resolution=[size, size])
        color, _ = dr.interpolate(colors[None], rast, self.cube.color_faces)
        return dr.antialias(color, rast, clip, self.cube.corner_faces)


class Fit:
    """Corners and colours, and what became of them on the way."""

    def __init__(self, cube: Cube) -> None:
        self.cube = cube
        self.render = Renderer(cube)
        self.corners = (cube.corners + 0.6 * (torch.rand(8, 3) - 0.5)).requires_grad_()
        self.colors = torch.rand_like(cube.colors).requires_grad_()
        self.optimizer = torch.optim.Adam([self.corners, self.colors], lr=RATES[0])
        self.losses: dict[str, list[float]] = {"image loss": [], "distance of corners": []}

    def step(self, size: int, share_done: float) -> None:
        """One step of Adam on images of `size` pixels; its rate falls with the share done."""
        self.optimizer.param_groups[0]["lr"] = RATES[0] * (RATES[1] / RATES[0])**share_done
        views = random_views(BATCH)
        with torch.no_grad():
            target = self.render(self.cube.corners, self.cube.colors, views, size)
        loss = (self.render(self.corners, self.colors, views, size) - target).square().mean()
        self.optimizer.zero_grad()
        loss.backward()
        self.optimizer.step()
        self.losses["image loss"].append(loss.item())
        distance = (self.corners.detach() - self.cube.corners).norm(dim=1).mean()
        self.losses["distance of corners"].append(distance.item())


def fit(sizes: tuple[int, ...] = (8, 16, 32, 64), steps: int = 500) -> Fit:
    """`steps` steps at each size of image; prints a line for each."""
    torch.manual_seed(1)
    fitted = Fit(make_cube())
    for stage, size in enumerate(sizes):
        for i in range(steps):
            fitted.step(size, (stage + i / steps) / len(sizes))
        print(f"{size:3d} x {size:<3d}  " + ", ".join(
            f"{name} {values[-1]:.2e}" for name, values in fitted.losses.items()))
    return fitted


def save_pictures(path: str, fitted: Fit) -> None:
    """The cube that is right, the start and the result, from three sides."""
    from tilegrad import files
    torch.manual_seed(1)
    start = Fit(fitted.cube)
    views = random_views(3)
    with torch.no_grad():
        rows = [torch.cat(list(fitted.render(corners, colors, views, 256)), dim=1)
                for corners, colors in ((fitted.cube.corners, fitted.cube.colors),
                                        (start.corners, start.colors),
                                        (fitted.corners, fitted.colors))]
    picture = torch.cat([row.flip(0) for row in rows])  # the bottom row is the first
    files.save_image(path, picture.numpy())


def means(values: list[float], count: int = 10) -> list[float]:
    """The mean of every `count` values: views are drawn at random, and some are harder."""
    return [sum(some) / len(some) for some in
            (values[i:i + count] for i in range(0, len(values), count))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--steps", type=int, default=500, help="at each size of images")
    parser.add_argument("--svg", help="write the loss curve there")
    parser.add_argument("--pictures", help="write images there, .png")
    options = parser.parse_args()
    begin = time.monotonic()
    fitted = fit(steps=options.steps)
    print(f"{time.monotonic() - begin:.1f} s")
    if options.svg:
        curves = {name: means(values) for name, values in fitted.losses.items()}
        with open(options.svg, "w", encoding="utf-8") as file:
            file.write(loss_curve_svg("A cube fitted with nvdiffrast's functions",
                                      "tens of steps", curves))
    if options.pictures:
        save_pictures(options.pictures, fitted)


if __name__ == "__main__":
    main()
