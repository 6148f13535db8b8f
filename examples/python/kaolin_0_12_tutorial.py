# SPDX-License-Identifier: Apache-2.0
"""Shape and texture from files, in the structure of the DIB-R tutorial of Kaolin 0.10 to 0.13.

Written for Kaolin; the import below is all that makes it run on a CPU.

    python3 kaolin_0_12_tutorial.py         # about half a minute
"""

from __future__ import annotations

import pathlib
import tempfile

import torch

import tilegrad.compat.kaolin as kal
from kaolin_files import write_sphere, write_views

IMAGE_WEIGHT, MASK_WEIGHT, LAPLACIAN_WEIGHT = 1.0, 1.0, 0.03
BATCH = 4


class Model:
    """A mesh from a file, whose vertices and texture are to be found."""

    def __init__(self, path: pathlib.Path) -> None:
        mesh = kal.io.obj.import_mesh(str(path), with_materials=True)
        centred = kal.ops.pointcloud.center_points(mesh.vertices.unsqueeze(0), normalize=True)
        self.faces = mesh.faces
        self.face_uvs = kal.ops.mesh.index_vertices_by_faces(mesh.uvs.unsqueeze(0),
                                                             mesh.face_uvs_idx)
        texture = mesh.materials[0]["map_Kd"].permute(2, 0, 1).unsqueeze(0).float() / 255.
        self.start = centred * 1.2
        self.vertices = self.start.clone().requires_grad_()
        self.texture = texture.requires_grad_()
        self.laplacian = kal.ops.mesh.uniform_laplacian(self.start.shape[1], self.faces)

    def render(self, metadata: dict, size: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Images [B,H,W,3] and soft masks [B,H,W]."""
        transform = metadata["cam_transform"]
        batch = len(transform)
        corners, corners_image, normals = kal.render.mesh.prepare_vertices(
            self.vertices.repeat(batch, 1, 1), self.faces, metadata["cam_proj"][0],
            camera_transform=transform)
        attributes = [self.face_uvs.repeat(batch, 1, 1, 1),
                      torch.ones((batch, len(self.faces), 3, 1))]
        (uv, mask), soft_mask, _ = kal.render.mesh.dibr_rasterization(
            size, size, corners[:, :, :, -1], corners_image, attributes, normals[:, :, -1])
        image = kal.render.mesh.texture_mapping(uv, self.texture.repeat(batch, 1, 1, 1),
                                                mode="bilinear")
        image *= mask
        return image.clamp(0., 1.), soft_mask

    def smoothness(self) -> torch.Tensor:
        """Of what the vertices have moved."""
        moved = torch.matmul(self.laplacian, self.vertices - self.start)
        return torch.mean(moved**2) * self.vertices.shape[1]


def fit(folder: pathlib.Path, views: int = 12, epochs: int = 60) -> list[tuple[float, float]]:
    """The losses of image and silhouette, step by step."""
    torch.manual_seed(0)
    data = [kal.io.render.import_synthetic_view(folder, i, rgb=True, semantic=True)
            for i in range(views)]
    for view in data:
        del view["metadata"]["clipping_range"], view["metadata"]["asset_transforms"]
    loader = torch.utils.data.DataLoader(data, batch_size=BATCH, shuffle=True)
    model = Model(folder / "sphere.obj")
    optimizer = torch.optim.Adam([{"params": [model.vertices], "lr": 1e-2},
                                  {"params": [model.texture], "lr": 5e-2}])
    losses = []
    for _ in range(epochs):
        for batch in loader:
            image, soft_mask = model.render(batch["metadata"], batch["rgb"].shape[1])
            image_loss = torch.mean(torch.abs(image - batch["rgb"]))
            mask_loss = kal.metrics.render.mask_iou(soft_mask, batch["semantic"])
            loss = (IMAGE_WEIGHT * image_loss + MASK_WEIGHT * mask_loss
                    + LAPLACIAN_WEIGHT * model.smoothness())
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            losses.append((image_loss.item(), mask_loss.item()))
    return losses


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        write_sphere(folder)
        write_views(folder, 12, 128)
        losses = fit(folder)
    for name, first, last in zip(("image", "silhouette"), losses[0], losses[-1]):
        print(f"{name} loss {first:.4f} -> {last:.4f}")


if __name__ == "__main__":
    main()
