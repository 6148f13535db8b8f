# SPDX-License-Identifier: Apache-2.0
"""A mesh that follows a score of its pictures, as text-to-mesh programs for Kaolin 0.15 and later do
it: SurfaceMesh, Camera, spherical Gaussians, random views.

Where those ask a network how well a picture fits a text, this asks a small fixed one how well it
fits pictures of a hidden mesh. Written for Kaolin; the import below is all that makes it run on a
CPU.

    python3 kaolin_0_15_text_to_mesh.py     # about half a minute
"""

from __future__ import annotations

import math
import pathlib
import tempfile
from typing import NamedTuple

import torch

import tilegrad.compat.kaolin as kal
from kaolin_files import write_sphere


class Losses(NamedTuple):
    """score: of each step's pictures, 0 is a perfect fit. chamfer: of the shape, before and after.
    """

    score: list[float]
    chamfer: tuple[float, float]


class Score(torch.nn.Module):
    """Features of pictures [B,4,H,W]: their pixels, coarse and fine, and fixed filters of them."""

    def __init__(self) -> None:
        super().__init__()
        self.filters = torch.nn.Conv2d(4, 24, 5, stride=2)
        self.requires_grad_(False)

    def forward(self, picture: torch.Tensor, wanted: torch.Tensor) -> torch.Tensor:
        pairs = [(torch.relu(self.filters(p)), torch.nn.functional.avg_pool2d(p, 4), p)
                 for p in (picture, wanted)]
        return sum(torch.mean(torch.abs(a - b)) for a, b in zip(*pairs))


def random_cameras(count: int, size: int) -> kal.render.camera.Camera:
    """On a sphere around the origin, which they look at."""
    azimuth = 2 * math.pi * torch.rand(count)
    x, z, y = kal.ops.coords.spherical2cartesian(azimuth, torch.rand(count) - 0.5, 3.)
    return kal.render.camera.Camera.from_args(
        eye=torch.stack([x, y, z], dim=1), at=torch.zeros(3), up=torch.tensor([0., 1., 0.]),
        fov=math.radians(45), width=size, height=size)


def render(mesh: kal.rep.SurfaceMesh, camera: kal.render.camera.Camera,
           lights: kal.render.lighting.SgLightingParameters) -> torch.Tensor:
    """Pictures [B,4,H,W]: lit colours of vertices, and alpha."""
    in_camera = camera.extrinsics.transform(mesh.vertices)
    on_image = camera.intrinsics.transform(in_camera)[..., :2]
    corners, corners_image = (kal.ops.mesh.index_vertices_by_faces(v, mesh.faces)
                              for v in (in_camera, on_image))
    facing = kal.ops.mesh.face_normals(corners, unit=True)[..., 2]
    features = [t.expand(len(camera), *t.shape[1:])
                for t in (mesh.face_colors, mesh.face_normals)]
    (albedo, normals), alpha, ids = kal.render.mesh.dibr_rasterization(
        camera.height, camera.width, corners[..., 2], corners_image, features, facing)
    normals = torch.nn.functional.normalize(normals, dim=-1)
    shown = ids >= 0
    color = torch.zeros_like(albedo)
    color[shown] = kal.render.lighting.sg_diffuse_inner_product(
        lights.amplitude, lights.direction, lights.sharpness, normals[shown], albedo[shown])
    return torch.cat([color.clamp(max=1), alpha.unsqueeze(-1)], dim=-1).permute(0, 3, 1, 2)


def chamfer(a: kal.rep.SurfaceMesh, b: kal.rep.SurfaceMesh) -> float:
    """Between samples of two surfaces."""
    with torch.no_grad():
        points = [kal.ops.mesh.sample_points(m.vertices, m.faces, 2000)[0] for m in (a, b)]
        return kal.metrics.pointcloud.chamfer_distance(*points).item()


def fit(path: pathlib.Path, steps: int = 120, size: int = 64) -> Losses:
    """Runs the loop."""
    torch.manual_seed(0)
    mesh = kal.io.import_mesh(str(path)).to_batched().cuda()
    mesh.normals = mesh.face_normals_idx = None  # those of the file are a sphere's
    hidden = kal.rep.SurfaceMesh(mesh.vertices * torch.tensor([0.5, 0.9, 0.7]), mesh.faces,
                                 vertex_colors=(mesh.vertices + 1) / 2)
    start = 0.6 * mesh.vertices
    lights = kal.render.lighting.SgLightingParameters.from_sun(
        torch.tensor([[1., 1, 1], [-1, 0.5, 0]]), strength=4., angle=1.5)
    laplacian = kal.ops.mesh.uniform_laplacian(start.shape[1], mesh.faces)
    offsets = torch.zeros_like(start).requires_grad_()
    colors = torch.zeros_like(start).requires_grad_()
    optimizer = torch.optim.Adam([offsets, colors], lr=2e-2)
    score, losses = Score(), []
    mesh.vertices = start
    before = chamfer(mesh, hidden)
    for _ in range(steps):
        mesh.vertices, mesh.vertex_colors = start + offsets, torch.sigmoid(4 * colors)
        camera = random_cameras(3, size)
        with torch.no_grad():
            wanted = render(hidden, camera, lights)
        loss = score(render(mesh, camera, lights), wanted)
        smooth = torch.mean((laplacian @ offsets)**2) * start.shape[1]
        optimizer.zero_grad()
        (loss + 0.3 * smooth).backward()
        optimizer.step()
        losses.append(loss.item())
    return Losses(losses, (before, chamfer(mesh, hidden)))


def main() -> None:
    kal.use_exact_kaolin()  # the pictures that Kaolin's users know
    with tempfile.TemporaryDirectory() as folder:
        losses = fit(write_sphere(pathlib.Path(folder)))
    print(f"score {losses.score[0]:.4f} -> {losses.score[-1]:.4f}, Chamfer distance "
          f"{losses.chamfer[0]:.4f} -> {losses.chamfer[1]:.4f}")


if __name__ == "__main__":
    main()
