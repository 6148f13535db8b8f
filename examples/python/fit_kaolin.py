# SPDX-License-Identifier: Apache-2.0
"""Fits the shape and the texture of a sphere to images, with Kaolin's DIB-R functions.

The loop is written for Kaolin; the import below is all that makes it run on a CPU. Images of an
object that is made here (a lobed body with coloured checks) are taken from several cameras; the
vertices and the texture of a sphere follow, by the silhouette (mask_iou), the colours (L1) and a
Laplacian that keeps the surface smooth.

    python3 fit_kaolin.py                     # about a minute on two cores
    python3 fit_kaolin.py --svg loss.svg --pictures views.png
"""

from __future__ import annotations

import argparse
import math
import time
from typing import NamedTuple

import torch

import tilegrad.compat.kaolin as kal
from loss_curve import loss_curve_svg

IMAGE_WEIGHT, MASK_WEIGHT, LAPLACIAN_WEIGHT = 1.0, 1.0, 0.03
VERTEX_RATE, TEXTURE_RATE = 1e-2, 5e-2
TEXTURE_SIZE = 256
BATCH = 4


class Sphere(NamedTuple):
    """vertices [V,3], faces [F,3], and the texture coordinates of their corners [F,3,2]."""

    vertices: torch.Tensor
    faces: torch.Tensor
    face_uvs: torch.Tensor


class Views(NamedTuple):
    """image [N,H,W,3], mask [N,H,W], camera [N,4,3]."""

    image: torch.Tensor
    mask: torch.Tensor
    camera: torch.Tensor


def make_sphere(rings: int = 20, segments: int = 32) -> Sphere:
    """Of radius 1, in rings from the north pole (+y) to the south pole."""
    def vertex(ring: int, segment: int) -> int:
        if ring in (0, rings):
            return 0 if ring == 0 else 1
        return 2 + (ring - 1) * segments + segment % segments

    vertices = [(0., 1., 0.), (0., -1., 0.)]
    for ring in range(1, rings):
        for segment in range(segments):
            polar, turn = math.pi * ring / rings, 2 * math.pi * segment / segments
            vertices.append((math.sin(polar) * math.cos(turn), math.cos(polar),
                             -math.sin(polar) * math.sin(turn)))
    corners = []
    for ring in range(rings):
        for segment in range(segments):
            a, b = (ring, segment), (ring + 1, segment)
            c, d = (ring + 1, segment + 1), (ring, segment + 1)
            corners += [(a, b, d)] if ring == rings - 1 else [(a, b, c)]
            corners += [] if ring in (0, rings - 1) else [(a, c, d)]
    return Sphere(torch.tensor(vertices),
                  torch.tensor([[vertex(*c) for c in face] for face in corners]),
                  torch.tensor([[(s / segments, 1 - r / rings) for r, s in face]
                                for face in corners]))


def render(vertices: torch.Tensor, texture: torch.Tensor, sphere: Sphere, camera: torch.Tensor,
           size: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Images [B,H,W,3], soft masks [B,H,W] and hard masks [B,H,W] in the cameras [B,4,3]."""
    batch, faces = len(camera), len(sphere.faces)
    projection = kal.render.camera.generate_perspective_projection(math.radians(40))
    corners, corners_image, normals = kal.render.mesh.prepare_vertices(
        vertices.repeat(batch, 1, 1), sphere.faces, projection, camera_transform=camera)
    features = [sphere.face_uvs.repeat(batch, 1, 1, 1), torch.ones(batch, faces, 3, 1)]
    (uv, hard), soft, _ = kal.render.mesh.dibr_rasterization(
        size, size, corners[..., 2], corners_image, features, normals[..., 2])
    color = kal.render.mesh.texture_mapping(uv, texture.repeat(batch, 1, 1, 1), mode="bilinear")
    return torch.clamp(color * hard, 0, 1), soft, hard[..., 0]


def make_views(sphere: Sphere, count: int, size: int) -> Views:
    """What the fit is to reproduce."""
    x, y, z = sphere.vertices.unbind(dim=1)
    lobes = 0.65 + 0.2 * torch.cos(3 * torch.atan2(z, x)) * (1 - y**2) + 0.15 * y
    checks = torch.arange(TEXTURE_SIZE) * 8 // TEXTURE_SIZE
    pattern = (checks[:, None] + checks[None, :]) % 2
    ramp = torch.linspace(0.2, 0.9, TEXTURE_SIZE)
    texture = torch.stack([ramp[None, :] * torch.ones(TEXTURE_SIZE, 1), 0.3 + 0.5 * pattern,
                           ramp.flip(0)[:, None] * torch.ones(1, TEXTURE_SIZE)])
    turns = 2 * math.pi * torch.arange(count) / count
    heights = 1.2 * torch.sin(2.4 * torch.arange(count))
    position = torch.stack([3 * torch.cos(turns), heights, 3 * torch.sin(turns)], dim=1)
    camera = kal.render.camera.generate_transformation_matrix(
        position, torch.zeros(1, 3), torch.tensor([[0., 1, 0]]))
    image, _, mask = render(sphere.vertices * lobes[:, None], texture.unsqueeze(0), sphere, camera,
                            size)
    return Views(image, mask, camera)


class Fit:
    """Vertices and texture, and the losses on the way."""

    def __init__(self, sphere: Sphere, size: int) -> None:
        self.sphere, self.size = sphere, size
        self.start = 0.6 * sphere.vertices
        self.vertices = self.start.clone().requires_grad_()
        self.texture = torch.full((1, 3, TEXTURE_SIZE, TEXTURE_SIZE), 0.5, requires_grad=True)
        self.laplacian = kal.ops.mesh.uniform_laplacian(len(self.start), sphere.faces)
        self.optimizer = torch.optim.Adam([{"params": [self.vertices], "lr": VERTEX_RATE},
                                           {"params": [self.texture], "lr": TEXTURE_RATE}])
        self.losses: dict[str, list[float]] = {"loss": [], "silhouette": [], "image": []}

    def step(self, views: Views) -> None:
        self.optimizer.zero_grad()
        image, soft_mask, _ = render(self.vertices, self.texture, self.sphere, views.camera,
                                     self.size)
        image_loss = torch.mean(torch.abs(image - views.image))
        mask_loss = kal.metrics.render.mask_iou(soft_mask, views.mask)
        moved = self.laplacian @ (self.vertices - self.start)
        loss = (IMAGE_WEIGHT * image_loss + MASK_WEIGHT * mask_loss
                + LAPLACIAN_WEIGHT * torch.mean(moved**2) * len(self.start))
        loss.backward()
        self.optimizer.step()
        for name, value in (("loss", loss), ("silhouette", mask_loss), ("image", image_loss)):
            self.losses[name].append(value.item())


def fit(epochs: int = 40, views: int = 16, size: int = 256) -> tuple[Fit, Views]:
    """Runs the loop; prints a line for each epoch."""
    torch.manual_seed(0)
    sphere = make_sphere()
    data = make_views(sphere, views, size)
    fitted = Fit(sphere, size)
    schedule = torch.optim.lr_scheduler.StepLR(fitted.optimizer, max(epochs // 3, 1), 0.5)
    for epoch in range(epochs):
        for batch in torch.randperm(views).split(BATCH):
            fitted.step(Views(*(t[batch] for t in data)))
        schedule.step()
        print(f"epoch {epoch:3d}  loss {fitted.losses['loss'][-1]:.4f}")
    return fitted, data


def save_pictures(path: str, fitted: Fit, views: Views) -> None:
    """A row of what was given, and one of what came out."""
    from tilegrad import files
    with torch.no_grad():
        image, _, _ = render(fitted.vertices, fitted.texture, fitted.sphere, views.camera[:6],
                             fitted.size)
    rows = [torch.cat(list(row), dim=1) for row in (views.image[:6], image)]
    files.save_image(path, torch.cat(rows).numpy())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--epochs", type=int, default=40)
    parser.add_argument("--size", type=int, default=256, help="of the images, pixels")
    parser.add_argument("--svg", help="write the loss curve there")
    parser.add_argument("--pictures", help="write images there, .png")
    options = parser.parse_args()
    begin = time.monotonic()
    fitted, views = fit(options.epochs, size=options.size)
    print(f"{time.monotonic() - begin:.1f} s; loss {fitted.losses['loss'][0]:.3f} -> "
          f"{fitted.losses['loss'][-1]:.4f}, silhouette IoU "
          f"{1 - fitted.losses['silhouette'][-1]:.4f}")
    if options.svg:
        with open(options.svg, "w", encoding="utf-8") as file:
            file.write(loss_curve_svg("A sphere fitted with Kaolin's functions", "step",
                                      fitted.losses))
    if options.pictures:
        save_pictures(options.pictures, fitted, views)


if __name__ == "__main__":
    main()
