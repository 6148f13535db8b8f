# SPDX-License-Identifier: Apache-2.0
"""PyTorch3D's tutorials of differentiable rendering, on a CPU: a camera's position, a shape and a
texture, each fitted to pictures.

    python3 pytorch3d_tutorials.py camera
    python3 pytorch3d_tutorials.py mesh --interface compat --pictures mesh.png
    python3 pytorch3d_tutorials.py texture --mesh cow.obj

--interface native draws with tilegrad.torch, compat with PyTorch3D's rasterize_meshes as
tilegrad.compat.pytorch3d has it, and its shaders' formulas in torch. Sizes, settings and optimizers
are the tutorials', regularisers similar; colours are not lit. Silhouettes of both interfaces agree
but for half a pixel at the edge.
Without --mesh, the object is a lobed body of 5,120 faces.
"""

from __future__ import annotations

import argparse
import itertools
import math
import time
from typing import Any, Callable, NamedTuple

import torch

import tilegrad
import tilegrad.torch
from tilegrad import files, losses, meshes
from tilegrad.compat import pytorch3d

SIGMA, GAMMA = 1e-4, 1e-4
FOCAL = 1 / math.tan(math.radians(30))  # of FoVPerspectiveCameras, whose field of view is 60 degrees
VIEWS, VIEWS_PER_STEP = 20, 2


class Object(NamedTuple):
    """vertices [V,3], faces [F,3] int64, colors [V,3]."""

    vertices: torch.Tensor
    faces: torch.Tensor
    colors: torch.Tensor


class Views(NamedTuple):
    """rotation [N,3,3] whose rows are right, up, back; position [N,3]."""

    rotation: torch.Tensor
    position: torch.Tensor

    def of(self, points: torch.Tensor) -> torch.Tensor:
        """Points [V,3] as the cameras see them, [N,V,3]."""
        return (points - self.position[:, None]) @ self.rotation.transpose(1, 2)


def look_at_origin(position: torch.Tensor) -> Views:
    """Cameras at position [N,3], differentiable."""
    back = torch.nn.functional.normalize(position, dim=1)
    up = torch.tensor([0.0, 1.0, 0.0]).expand_as(back)
    right = torch.nn.functional.normalize(torch.cross(up, back, dim=1), dim=1)
    return Views(torch.stack([right, torch.cross(back, right, dim=1), back], dim=1), position)


def orbit(distance: float, elevation: torch.Tensor, azimuth: torch.Tensor) -> torch.Tensor:
    """Positions [N,3] on a sphere; degrees."""
    elevation, azimuth = torch.deg2rad(elevation), torch.deg2rad(azimuth)
    return distance * torch.stack([torch.cos(elevation) * torch.sin(azimuth), torch.sin(elevation),
                                   torch.cos(elevation) * torch.cos(azimuth)], dim=1)


def ico_sphere(level: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Vertices [V,3] on the unit sphere, faces [F,3]: an icosahedron subdivided level times."""
    golden = (1 + math.sqrt(5)) / 2
    short = [(0.0, y, z) for y in (-1.0, 1.0) for z in (-golden, golden)]
    vertices = torch.tensor([(c[i], c[i - 1], c[i - 2]) for i in range(3) for c in short])
    near = torch.cdist(vertices, vertices) < 2.1  # edges have length 2
    corners = torch.stack([vertices[list(face)] for face in itertools.combinations(range(12), 3)
                           if all(near[a, b] for a, b in itertools.combinations(face, 2))])
    inward = torch.linalg.det(corners) < 0
    corners = torch.where(inward[:, None, None], corners.flip(1), corners)
    for _ in range(level):
        a, b, c = corners.unbind(dim=1)
        ab, bc, ca = a + b, b + c, c + a
        parts = [(a, ab / 2, ca / 2), (ab / 2, b, bc / 2), (ca / 2, bc / 2, c),
                 (ab / 2, bc / 2, ca / 2)]
        corners = torch.cat([torch.stack(part, dim=1) for part in parts])
    vertices, faces = corners.reshape(-1, 3).unique(dim=0, return_inverse=True)
    return torch.nn.functional.normalize(vertices, dim=1), faces.reshape(-1, 3)


class Native:
    """Draws with tilegrad.torch; exp(-d^2 / sigma) beyond an edge."""

    def __init__(self, size: int, faces_per_pixel: int) -> None:
        del faces_per_pixel  # all faces count
        self.size = size

    def silhouettes(self, mesh: Object, views: Views) -> torch.Tensor:
        return self._render(mesh, views, ("alpha",)).alpha

    def images(self, mesh: Object, views: Views) -> tuple[torch.Tensor, torch.Tensor]:
        """Colours [N,H,W,3] on white, and silhouettes [N,H,W]."""
        found = self._render(mesh, views, ("color", "alpha"), colors=mesh.colors)
        color = torch.where(found.face_ids[:, None] >= 0, found.color, 1.0)
        return color.permute(0, 2, 3, 1), found.alpha

    def _render(self, mesh: Object, views: Views, outputs: tuple[str, ...],
                **more: Any) -> tilegrad.torch.Images:
        focal = FOCAL * self.size / 2
        translation = -(views.rotation @ views.position[..., None])[..., 0]
        camera = tilegrad.torch.camera(views.rotation, translation, focal, focal, self.size / 2,
                                       self.size / 2)
        return tilegrad.torch.render(mesh.vertices, mesh.faces, camera, width=self.size,
                                     height=self.size, delta=SIGMA, outputs=outputs, **more)


class Batch(NamedTuple):
    """What rasterize_meshes reads of PyTorch3D's Meshes: the same faces, N times."""

    vertices: torch.Tensor  # [N,V,3], NDC with depth
    faces: torch.Tensor     # [F,3]

    def verts_packed(self) -> torch.Tensor:
        return self.vertices.reshape(-1, 3)

    def faces_packed(self) -> torch.Tensor:
        count, rows = self.vertices.shape[:2]
        return (self.faces + rows * torch.arange(count)[:, None, None]).reshape(-1, 3)

    def mesh_to_faces_packed_first_idx(self) -> torch.Tensor:
        return len(self.faces) * torch.arange(len(self.vertices))

    def num_faces_per_mesh(self) -> torch.Tensor:
        return torch.full((len(self.vertices),), len(self.faces))


class Compat:
    """Draws with rasterize_meshes, SoftSilhouetteShader's and SoftPhongShader's blending."""

    def __init__(self, size: int, faces_per_pixel: int) -> None:
        self.size, self.faces_per_pixel = size, faces_per_pixel

    def silhouettes(self, mesh: Object, views: Views) -> torch.Tensor:
        pix_to_face, _, _, dists = self._rasterize(mesh, views)
        return 1 - torch.prod(1 - self._coverage(pix_to_face, dists), dim=-1)

    def images(self, mesh: Object, views: Views) -> tuple[torch.Tensor, torch.Tensor]:
        """Colours [N,H,W,3] on white, and silhouettes [N,H,W]."""
        pix_to_face, depth, barycentrics, dists = self._rasterize(mesh, views)
        coverage = self._coverage(pix_to_face, dists)
        faces = mesh.faces.repeat(len(pix_to_face), 1)[pix_to_face.clamp(min=0)]
        texels = (barycentrics[..., None] * mesh.colors[faces]).sum(dim=-2)
        near, far = 1.0, 100.0
        nearness = torch.where(pix_to_face >= 0, (far - depth) / (far - near), 0.0)
        nearest = nearness.amax(dim=-1, keepdim=True).clamp(min=1e-10)
        weights = coverage * torch.exp((nearness - nearest) / GAMMA)
        background = torch.exp((1e-10 - nearest) / GAMMA).clamp(min=1e-10)
        total = weights.sum(dim=-1, keepdim=True) + background
        color = ((weights[..., None] * texels).sum(dim=-2) + background) / total
        return color, 1 - torch.prod(1 - coverage, dim=-1)

    def _rasterize(self, mesh: Object, views: Views) -> tuple[torch.Tensor, ...]:
        x, y, z = views.of(mesh.vertices).unbind(dim=-1)
        ndc = torch.stack([FOCAL * x / z, -FOCAL * y / z, -z], dim=-1)  # +x left
        return pytorch3d.rasterize_meshes(
            Batch(ndc, mesh.faces), self.size, math.log(1 / 1e-4 - 1) * SIGMA,
            self.faces_per_pixel, clip_barycentric_coords=True)

    @staticmethod
    def _coverage(pix_to_face: torch.Tensor, dists: torch.Tensor) -> torch.Tensor:
        return torch.sigmoid(-dists / SIGMA) * (pix_to_face >= 0)


INTERFACES = {"native": Native, "compat": Compat}


class Fit(NamedTuple):
    """Losses, milliseconds a step, scores by name, and images [N,H,W,3] beside their targets."""

    losses: list[float]
    milliseconds: float
    scores: dict[str, float]
    pictures: tuple[torch.Tensor, torch.Tensor]


def descend(optimizer: torch.optim.Optimizer, loss: Callable[[], torch.Tensor],
            steps: int) -> tuple[list[float], float]:
    """The losses, and milliseconds a step."""
    values = []
    begin = time.monotonic()
    for step in range(steps):
        optimizer.zero_grad()
        value = loss()
        value.backward()
        optimizer.step()
        values.append(value.item())
        if step % max(steps // 10, 1) == 0:
            print(f"step {step:4d}  loss {values[-1]:.5g}")
    return values, 1000 * (time.monotonic() - begin) / max(steps, 1)


def gray(alpha: torch.Tensor) -> torch.Tensor:
    return alpha[..., None].expand(*alpha.shape, 3)


def fit_camera(target: Object, interface: type, steps: int = 200) -> Fit:
    """camera_position_optimization_with_differentiable_rendering: where a silhouette is seen from."""
    drawer = interface(256, faces_per_pixel=100)
    truth = orbit(3.0, torch.tensor([50.0]), torch.tensor([0.0]))
    with torch.no_grad():
        wanted = (drawer.silhouettes(target, look_at_origin(truth)) > 0.5).float()
    position = torch.tensor([[3.0, 6.9, 2.5]], requires_grad=True)

    def loss() -> torch.Tensor:
        return ((drawer.silhouettes(target, look_at_origin(position)) - wanted) ** 2).sum()

    values, milliseconds = descend(torch.optim.Adam([position], lr=0.05), loss, steps)
    with torch.no_grad():
        found = drawer.silhouettes(target, look_at_origin(position))
    distance = (position - truth).norm().item()
    return Fit(values, milliseconds, {"distance of the camera to the truth": distance},
               (gray(found), gray(wanted)))


def smoothness(vertices: torch.Tensor, faces: torch.Tensor) -> torch.Tensor:
    """mesh_edge_loss, and much like mesh_normal_consistency and mesh_laplacian_smoothing: means of
    squared differences of normals, and the root of the mean square of the Laplacian."""
    corners = vertices[faces]
    edges = (corners - corners.roll(1, dims=1)).square().sum(dim=-1).mean()
    normal = losses.normal_consistency(vertices, faces) / (1.5 * len(faces))
    laplacian = losses.laplacian(vertices, faces) / len(vertices)
    return edges + 0.01 * normal + torch.sqrt(laplacian + 1e-12)


def fit_textured_mesh(target: Object, interface: type, steps: int = 2000,
                      textured: bool = False) -> Fit:
    """fit_textured_mesh: a sphere takes the shape, and with `textured` the colours, that pictures
    from 20 sides show."""
    drawer = interface(128, faces_per_pixel=50)
    turn = torch.linspace(-180, 180, VIEWS)
    views = look_at_origin(orbit(2.7, turn + 180, turn))
    with torch.no_grad():
        rgb, alpha = drawer.images(target, views)
    vertices, faces = ico_sphere(4)
    offsets = torch.zeros_like(vertices, requires_grad=True)
    colors = torch.full_like(vertices, 0.5, requires_grad=True)
    generator = torch.Generator().manual_seed(0)

    def moved() -> Object:
        return Object(vertices + offsets, faces, colors)

    def loss() -> torch.Tensor:
        mesh = moved()
        chosen = torch.randperm(VIEWS, generator=generator)[:VIEWS_PER_STEP]
        seen = Views(views.rotation[chosen], views.position[chosen])
        total = smoothness(mesh.vertices, mesh.faces)
        if not textured:
            return total + (drawer.silhouettes(mesh, seen) - alpha[chosen]).square().mean()
        drawn_rgb, drawn_alpha = drawer.images(mesh, seen)
        return (total + (drawn_alpha - alpha[chosen]).square().mean()
                + (drawn_rgb - rgb[chosen]).square().mean())

    unknown = [offsets, colors] if textured else [offsets]
    values, milliseconds = descend(torch.optim.SGD(unknown, lr=1.0, momentum=0.9), loss, steps)
    with torch.no_grad():
        drawn_rgb, drawn_alpha = drawer.images(moved(), views)
    hard, true = drawn_alpha > 0.5, alpha > 0.5
    overlap = (hard & true).sum() / (hard | true).sum()
    scores = {"IoU of the silhouettes, %": 100 * overlap.item()}
    if not textured:
        return Fit(values, milliseconds, scores, (gray(drawn_alpha), gray(alpha)))
    scores["PSNR, dB"] = -10 * (drawn_rgb - rgb).square().mean().log10().item()
    return Fit(values, milliseconds, scores, (drawn_rgb, rgb))


TUTORIALS: dict[str, Callable[..., Fit]] = {
    "camera": fit_camera,
    "mesh": fit_textured_mesh,
    "texture": lambda *arguments, **more: fit_textured_mesh(*arguments, **more, textured=True),
}


def lobed_body() -> Object:
    vertices, faces = ico_sphere(4)
    x, y, z = vertices.unbind(dim=1)
    lobes = 0.6 + 0.25 * torch.cos(3 * torch.atan2(z, x) + 1) * (1 - y**2) + 0.15 * y
    return Object(vertices * lobes[:, None], faces, 0.5 + 0.4 * torch.sin(8 * vertices))


def load_object(path: str, normalized: bool) -> Object:
    """A file's mesh. normalized: moved and scaled into [-1, 1]^3, as fit_textured_mesh does. Without
    vertex colours, places are colours."""
    mesh = meshes.load_mesh(path)
    vertices = torch.as_tensor(mesh.positions)
    centred = vertices - vertices.mean(dim=0)
    scaled = centred / centred.abs().max()
    colors = 0.5 + 0.5 * scaled if mesh.colors is None else torch.as_tensor(mesh.colors)[:, :3]
    return Object(scaled if normalized else vertices, torch.as_tensor(mesh.faces).long(), colors)


def save_pictures(path: str, fit: Fit, count: int = 6) -> None:
    """A row of what was drawn, and one of what was to be drawn."""
    rows = [torch.cat(list(images[:count]), dim=1) for images in fit.pictures]
    files.save_image(path, torch.cat(rows).clamp(0, 1).contiguous().numpy())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tutorial", choices=TUTORIALS)
    parser.add_argument("--interface", choices=INTERFACES, default="native")
    parser.add_argument("--mesh", metavar="FILE", help="fit to this object")
    parser.add_argument("--steps", type=int, help="default: the tutorial's, 200 or 2000")
    parser.add_argument("--pictures", metavar="FILE", help="write images there, .png")
    options = parser.parse_args()
    more = {} if options.steps is None else {"steps": options.steps}
    target = (load_object(options.mesh, normalized=options.tutorial != "camera") if options.mesh
              else lobed_body())
    fit = TUTORIALS[options.tutorial](target, INTERFACES[options.interface], **more)
    scores = "; ".join(f"{name}: {value:.3f}" for name, value in fit.scores.items())
    print(f"{fit.milliseconds:.1f} ms a step; {scores}")
    if options.pictures:
        save_pictures(options.pictures, fit)


if __name__ == "__main__":
    main()
