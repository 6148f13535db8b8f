# SPDX-License-Identifier: Apache-2.0
"""Shape and colours from images, by the interface of Kaolin 0.1: TriangleMesh, DIBRenderer.

Written for Kaolin; the import below is all that makes it run on a CPU.

    python3 kaolin_0_1_renderer.py          # about ten seconds
"""

from __future__ import annotations

import pathlib
import tempfile

import torch

import tilegrad.compat.kaolin as kal
from kaolin_files import write_sphere

ALPHA_WEIGHT, SMOOTH_WEIGHT, FLAT_WEIGHT = 1.0, 0.5, 2e-4


def smoothness(mesh: kal.rep.TriangleMesh, offsets: torch.Tensor) -> torch.Tensor:
    """How far offsets [1,V,3] are from the mean of their neighbours."""
    return torch.mean((torch.matmul(mesh.adj, offsets) - offsets)**2) * len(mesh.vertices)


def flatness(mesh: kal.rep.TriangleMesh, normals: torch.Tensor) -> torch.Tensor:
    """How far the normals [F,3] of adjacent faces are from each other."""
    loss = 0.
    for i in range(3):
        cosine = torch.sum(normals * normals[mesh.ff[:, i]], dim=1)
        loss = loss + torch.mean((cosine - 1)**2)
    return loss * len(mesh.faces) / 2


def target_of(mesh: kal.rep.TriangleMesh) -> tuple[torch.Tensor, torch.Tensor]:
    """Vertices and colours [1,V,3] to be found."""
    x, y, z = mesh.vertices.unbind(dim=1)
    bent = torch.stack([x * (0.6 + 0.3 * y), 0.9 * y, z * 0.5 + 0.2 * y**2], dim=1)
    return 0.8 * bent[None], (mesh.vertices[None] + 1) / 2


def fit(path: pathlib.Path, steps: int = 200, size: int = 64) -> list[tuple[float, float]]:
    """The losses of image and silhouette, step by step."""
    torch.manual_seed(0)
    mesh = kal.rep.TriangleMesh.from_obj(str(path), enable_adjacency=True)
    mesh.cuda()
    neighbours = mesh.compute_adjacency_matrix_full() - torch.eye(len(mesh.vertices))
    mesh.adj = neighbours / neighbours.sum(dim=1, keepdim=True)
    renderer = kal.graphics.DIBRenderer(size, size, mode="VertexColor")
    true_vertices, true_colors = target_of(mesh)
    offsets = torch.zeros(1, len(mesh.vertices), 3, requires_grad=True)
    colors = torch.full_like(true_colors, 0.5).requires_grad_()
    optimizer = torch.optim.Adam([offsets, colors], lr=2e-2)
    losses = []
    for step in range(steps):
        renderer.set_look_at_parameters([90 - 47 * step], [30 * (step % 3 - 1)], [3])
        vertices = 0.6 * mesh.vertices + offsets
        with torch.no_grad():
            image_gt, alpha_gt, _ = renderer.forward(points=[true_vertices, mesh.faces],
                                                     colors_bxpx3=true_colors)
        image, alpha, normals = renderer.forward(points=[vertices, mesh.faces],
                                                 colors_bxpx3=colors)
        image_loss = torch.mean(torch.abs(image - image_gt))
        both = alpha * alpha_gt
        alpha_loss = 1 - both.sum() / (alpha + alpha_gt - both).sum()
        loss = (image_loss + ALPHA_WEIGHT * alpha_loss
                + SMOOTH_WEIGHT * smoothness(mesh, offsets)
                + FLAT_WEIGHT * flatness(mesh, normals[0]))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append((image_loss.item(), alpha_loss.item()))
    return losses


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        losses = fit(write_sphere(pathlib.Path(folder)))
    for name, first, last in zip(("image", "silhouette"), losses[0], losses[-1]):
        print(f"{name} loss {first:.4f} -> {last:.4f}")


if __name__ == "__main__":
    main()
