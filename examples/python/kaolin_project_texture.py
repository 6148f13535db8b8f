# SPDX-License-Identifier: Apache-2.0
"""Photographs projected onto the texture of a mesh, with Kaolin's functions.

The texture is drawn as an image whose faces are the uvs and whose features are the places of the
texels in the world; each photograph then gives the texels that it sees their colours. Written for
Kaolin; the import below is all that makes it run on a CPU.

    python3 kaolin_project_texture.py       # a few seconds
"""

from __future__ import annotations

import pathlib
import tempfile

import torch

import tilegrad.compat.kaolin as kal
from kaolin_files import write_sphere

DEPTH_SLACK = 0.02  # how far behind the surface that a photograph shows a texel may be


def places_of_texels(mesh: kal.rep.SurfaceMesh, size: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Where texels are in the world [1,S,S,3], and which of them a face has [1,S,S]."""
    on_texture = 2 * mesh.face_uvs - 1
    places, face = kal.render.mesh.rasterize(size, size, torch.zeros(on_texture.shape[:3]),
                                             on_texture, mesh.face_vertices)
    return places, face >= 0


def photograph(mesh: kal.rep.SurfaceMesh, texture: torch.Tensor, transform: torch.Tensor,
               projection: torch.Tensor, size: int) -> tuple[torch.Tensor, torch.Tensor]:
    """An image [1,H,W,3] and depths [1,H,W,1] from a camera [1,4,3]."""
    corners, on_image, normals = kal.render.mesh.prepare_vertices(
        mesh.vertices, mesh.faces, projection, camera_transform=transform)
    (uv, depth), face = kal.render.mesh.rasterize(
        size, size, corners[..., 2], on_image, [mesh.face_uvs, corners[..., 2:]],
        normals[..., 2] >= 0)
    image = kal.render.mesh.texture_mapping(uv, texture, mode="bilinear")
    return image * (face >= 0).unsqueeze(-1), depth


def seen_colors(places: torch.Tensor, image: torch.Tensor, depth: torch.Tensor,
                transform: torch.Tensor, projection: torch.Tensor
                ) -> tuple[torch.Tensor, torch.Tensor]:
    """Colours [1,S,S,3] that an image gives to places, and whether it shows them [1,S,S,1]."""
    in_camera = places.flatten(1, 2) @ transform[:, :3] + transform[:, 3:]
    on_image = kal.render.camera.perspective_camera(in_camera, projection)
    uv = ((on_image + 1) / 2).reshape(*places.shape[:3], 2)
    color, front = (kal.render.mesh.texture_mapping(uv, t.permute(0, 3, 1, 2), mode=mode)
                    for t, mode in ((image, "bilinear"), (depth, "nearest")))
    behind = front - in_camera[..., 2:].reshape(*places.shape[:3], 1)
    return color, (behind.abs() < DEPTH_SLACK) & (front < 0)


def project(path: pathlib.Path, size: int = 128, cameras: int = 6
            ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """The texture [1,3,S,S] that photographs give, the true one, and which texels were seen."""
    mesh = kal.io.obj.import_mesh(str(path)).to_batched()
    places, used = places_of_texels(mesh, size)
    truth = (0.5 + 0.4 * torch.sin(5 * places)).permute(0, 3, 1, 2)
    projection = kal.render.camera.generate_perspective_projection(0.8)
    colors, weight = torch.zeros_like(places), torch.zeros(*places.shape[:3], 1)
    angles = 2 * torch.pi * torch.arange(cameras) / cameras
    for i, (sine, cosine) in enumerate(zip(angles.sin(), angles.cos())):
        transform = kal.render.camera.generate_transformation_matrix(
            3 * torch.stack([sine, torch.tensor((-1.)**i), cosine])[None], torch.zeros(1, 3),
            torch.tensor([[0., 1, 0]]))
        image, depth = photograph(mesh, truth, transform, projection, 2 * size)
        color, seen = seen_colors(places, image, depth, transform, projection)
        colors += color * seen
        weight += seen
    texture = (colors / weight.clamp(min=1)).permute(0, 3, 1, 2)
    return texture, truth, (weight[..., 0] > 0) & used


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        texture, truth, seen = project(write_sphere(pathlib.Path(folder)))
    error = (texture - truth).abs().mean(dim=1)[seen].mean()
    print(f"{100 * seen.float().mean():.0f} % of the texels were seen; mean error {error:.4f}")


if __name__ == "__main__":
    main()
