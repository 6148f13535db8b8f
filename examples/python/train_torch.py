# SPDX-License-Identifier: Apache-2.0
"""Trains a network that predicts a coloured mesh from one image, with 2D supervision only.

A PyTorch module sees an RGBA image and moves and colours the vertices of a sphere; tilegrad renders
the result from the image's own view and from another one; Adam makes the renders like the images.
The data is made on the fly, by two processes of a DataLoader that render too: ellipsoids of random
shape and colours. With --data it is a folder that `tilegrad dataset` has made.

    python3 train_torch.py                     # half a minute on two cores
    python3 train_torch.py --svg loss.svg --mesh prediction.glb
    python3 train_torch.py --data datasets/furniture --steps 3000
"""

from __future__ import annotations

import argparse
import functools
import time
from typing import Any, Iterator, NamedTuple

import numpy as np
import torch

import tilegrad
import tilegrad.torch
from loss_curve import loss_curve_svg

SIZE = 32          # pixels
VIEWS = 2          # of each object: the one that the network sees, and one more
SOFTNESS = 2e-3    # delta of alpha, NDC squared: about a pixel
IMAGE_WEIGHT, MASK_WEIGHT, SMOOTH_WEIGHT = 5.0, 1.0, 0.3
Item = dict[str, Any]


class Ellipsoids(torch.utils.data.Dataset):
    """Item i, a pure function of (seed, i): images (K, 3, H, W), masks (K, H, W) and cameras
    (K, 17) of an ellipsoid whose upper and lower half have colours of their own."""

    def __init__(self, length: int, seed: int) -> None:
        self.length, self.seed = length, seed

    def __len__(self) -> int:
        return self.length

    def __getitem__(self, index: int) -> Item:
        random = np.random.default_rng((self.seed, index))
        vertices, faces = template()
        upper, lower = random.uniform(0, 1, (2, 3)).astype(np.float32)
        scene = tilegrad.Scene(
            vertices * random.uniform(0.4, 1, 3).astype(np.float32), faces,
            cameras_at((30, random.uniform(60, 330))),
            colors=np.where(vertices[:, 1:2] > 0, upper, lower))
        frame = renderer().render(scene, width=SIZE, height=SIZE, delta=1e-4)
        return {"images": frame.color.copy(), "masks": frame.alpha.copy(),
                "cameras": scene.camera.numbers.copy()}


@functools.lru_cache(maxsize=None)
def template() -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) and faces (F, 3) of the sphere."""
    return tilegrad.icosphere(2, radius=0.45)


@functools.lru_cache(maxsize=None)
def renderer() -> tilegrad.Renderer:
    return tilegrad.Renderer(threads=1)


def cameras_at(azimuths: tuple[float, ...]) -> tilegrad.Camera:
    return tilegrad.Camera.orbit(np.array(azimuths), 27.0, 1.45, width=SIZE, height=SIZE)


class MeshPredictor(torch.nn.Module):
    """RGBA images (B, 4, H, W) -> positions (B, V, 3) and colours (B, V, 3)."""

    def __init__(self) -> None:
        super().__init__()
        vertices, _ = template()
        self.register_buffer("sphere", torch.tensor(vertices))
        layers: list[torch.nn.Module] = []
        for channels, wider in ((4, 16), (16, 32), (32, 64)):
            layers += [torch.nn.Conv2d(channels, wider, 3, stride=2, padding=1),
                       torch.nn.BatchNorm2d(wider), torch.nn.ReLU()]
        self.encoder = torch.nn.Sequential(*layers, torch.nn.AdaptiveAvgPool2d(4),
                                           torch.nn.Flatten(), torch.nn.Linear(64 * 16, 128),
                                           torch.nn.ReLU())
        self.offsets = torch.nn.Linear(128, vertices.size)
        self.colors = torch.nn.Linear(128, vertices.size)
        torch.nn.init.zeros_(self.offsets.weight)  # begins as the sphere
        torch.nn.init.zeros_(self.offsets.bias)

    def forward(self, images: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        code = self.encoder(images)
        positions = self.sphere + 0.3 * self.offsets(code).reshape(-1, *self.sphere.shape)
        return positions, torch.sigmoid(self.colors(code).reshape(-1, *self.sphere.shape))


class Losses(NamedTuple):
    """Means over a batch: colours (L1), silhouettes (1 - IoU), roughness of the mesh."""

    image: torch.Tensor
    mask: torch.Tensor
    smooth: torch.Tensor

    def total(self) -> torch.Tensor:
        return (IMAGE_WEIGHT * self.image + MASK_WEIGHT * self.mask
                + SMOOTH_WEIGHT * self.smooth)


def render_views(positions: torch.Tensor, colors: torch.Tensor,
                 cameras: torch.Tensor) -> tilegrad.torch.Images:
    """Each of B meshes in each of its K cameras (B, K, 17): images (B * K, ...)."""
    views = cameras.shape[1]
    return tilegrad.torch.render(
        positions.repeat_interleave(views, 0), template()[1], cameras.flatten(0, 1).float(),
        colors=colors.repeat_interleave(views, 0), width=SIZE, height=SIZE, delta=SOFTNESS)


def losses_of(model: MeshPredictor, batch: Item) -> Losses:
    seen = torch.cat([batch["images"][:, 0], batch["masks"][:, :1]], 1)
    positions, colors = model(seen)
    shown = render_views(positions, colors, batch["cameras"])
    truth, mask = batch["images"].flatten(0, 1), batch["masks"].flatten(0, 1)
    common = shown.alpha * mask
    union = shown.alpha + mask - common
    return Losses((shown.color - truth).abs().mean(),
                  1 - (common.sum((1, 2)) / union.sum((1, 2))).mean(),
                  (positions - neighbours() @ positions).square().sum(-1).sqrt().mean() / 0.1)


@functools.lru_cache(maxsize=None)
def neighbours() -> torch.Tensor:
    """(V, V), which takes the mean over the neighbours of each vertex."""
    vertices, faces = template()
    matrix = torch.zeros(len(vertices), len(vertices))
    for a, b in ((0, 1), (1, 2), (2, 0)):
        matrix[faces[:, a], faces[:, b]] = 1
        matrix[faces[:, b], faces[:, a]] = 1
    return matrix / matrix.sum(1, keepdim=True)


def endless(loader: torch.utils.data.DataLoader) -> Iterator[Item]:
    while True:
        yield from loader


def train(model: MeshPredictor, data: torch.utils.data.Dataset, steps: int, batch: int = 16,
          workers: int = 2) -> dict[str, list[float]]:
    """Trains the model on batches of `batch` objects, or of all if there are fewer; the losses of
    every step by name."""
    loader = torch.utils.data.DataLoader(data, min(batch, len(data)), shuffle=True,
                                         num_workers=workers, drop_last=True,
                                         persistent_workers=workers > 0)
    optimizer = torch.optim.Adam(model.parameters())
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, max_lr=5e-3, total_steps=steps)
    curves: dict[str, list[float]] = {"image": [], "silhouette": []}
    model.train()
    for step, items in zip(range(steps), endless(loader)):
        losses = losses_of(model, items)
        optimizer.zero_grad()
        losses.total().backward()
        optimizer.step()
        schedule.step()
        curves["image"].append(float(losses.image))
        curves["silhouette"].append(float(losses.mask))
        if step % 50 == 49:
            print(f"step {step + 1}: image {losses.image:.3f}, silhouette {losses.mask:.3f}")
    return curves


@torch.no_grad()
def evaluate(model: MeshPredictor, data: torch.utils.data.Dataset) -> Losses:
    """Of objects that training has not seen."""
    model.eval()
    return losses_of(model, next(iter(torch.utils.data.DataLoader(data, batch_size=64))))


def save_prediction(model: MeshPredictor, data: torch.utils.data.Dataset, path: str) -> None:
    from tilegrad import files
    item = torch.utils.data.default_collate([data[0]])
    with torch.no_grad():
        positions, colors = model(torch.cat([item["images"][:, 0], item["masks"][:, :1]], 1))
    files.save_mesh(path, files.Mesh(positions[0].numpy(), template()[1],
                                     colors=colors[0].numpy()))


def datasets(folder: str | None) -> tuple[Any, Any]:
    """To train with, and to test with."""
    if folder is None:
        return Ellipsoids(2000, seed=1), Ellipsoids(64, seed=2)
    from tilegrad.files import Dataset
    data = Dataset(folder, views=VIEWS)
    if data.image_size != SIZE:
        raise SystemExit(f"{folder}: images are {data.image_size} pixels a side, not {SIZE}: "
                         f"make them with `tilegrad dataset --size {SIZE}`")
    return data, Dataset(folder, "test", views=VIEWS)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", help="folder that `tilegrad dataset --size 32` has made")
    parser.add_argument("--steps", type=int, default=300)
    parser.add_argument("--workers", type=int, default=2, help="processes that make the data")
    parser.add_argument("--svg", help="file for the curves of the losses")
    parser.add_argument("--mesh", help=".glb file for a prediction")
    options = parser.parse_args()
    torch.manual_seed(0)
    train_data, test_data = datasets(options.data)
    model = MeshPredictor()
    before = evaluate(model, test_data)
    print(f"before: image {before.image:.3f}, silhouette {before.mask:.3f}")
    start = time.perf_counter()
    curves = train(model, train_data, options.steps, workers=options.workers)
    after = evaluate(model, test_data)
    print(f"after {time.perf_counter() - start:.0f} s: image {after.image:.3f}, "
          f"silhouette {after.mask:.3f}")
    if options.svg:
        with open(options.svg, "w", encoding="utf-8") as file:
            file.write(loss_curve_svg("a mesh from one image", "step", curves))
    if options.mesh:
        save_prediction(model, test_data, options.mesh)


if __name__ == "__main__":
    main()
