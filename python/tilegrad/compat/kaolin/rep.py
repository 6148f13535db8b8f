# SPDX-License-Identifier: Apache-2.0
"""kaolin.rep: SurfaceMesh of Kaolin 0.15 and later, TriangleMesh of 0.1."""

from __future__ import annotations

import enum
import os
from typing import Any, Callable, Optional, Sequence, Union

import torch

from tilegrad._dense import full_precision
from tilegrad.compat.kaolin import ops
from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.ops._subdivide import adjacency

__all__ = ["SurfaceMesh", "TriangleMesh"]

__getattr__ = missing_from(__name__)

_UNBATCHED = ("faces",)  # the same for all meshes of a batch


class SurfaceMesh:
    """A triangle mesh, or B of them with the same faces. Members may be set, also to None; one that
    is not set is computed if possible, else None. Computed ones are recomputed at each access, so
    that they follow their sources.

    vertices [V,3]; faces [F,3] int64; normals [N,3] with face_normals_idx [F,3]; uvs [T,2] with
    face_uvs_idx [F,3]; vertex_normals [V,3]; vertex_colors, vertex_features [V,C]; face_colors,
    face_features [F,3,C]; materials, a list of dictionaries; material_assignments [F], indices into
    it, -1: none.
    Computed: face_vertices [F,3,3]; face_uvs [F,3,2]; face_normals [F,3,3], from normals, else from
    vertex_normals, else flat; vertex_normals, the mean of face_normals; face_colors and
    face_features from those of vertices; materials_order [M,2] of Kaolin before 0.13, (material,
    first face) of each run of faces.
    In a batch all but faces have a leading axis B, materials is a list of lists, and
    materials_order a list of [M,2].
    """

    class Batching(str, enum.Enum):
        """NONE: one mesh. FIXED: a batch with the same faces."""

        NONE = "NONE"
        FIXED = "FIXED"

    def __init__(self, vertices: torch.Tensor, faces: torch.Tensor,
                 normals: Optional[torch.Tensor] = None, uvs: Optional[torch.Tensor] = None,
                 face_uvs_idx: Optional[torch.Tensor] = None,
                 face_normals_idx: Optional[torch.Tensor] = None,
                 material_assignments: Optional[torch.Tensor] = None,
                 materials: Optional[list] = None,
                 vertex_normals: Optional[torch.Tensor] = None, **others: Any) -> None:
        """others: the further members by name. TypeError: it is none."""
        members = dict(vertices=vertices, faces=faces, normals=normals, uvs=uvs,
                       face_uvs_idx=face_uvs_idx, face_normals_idx=face_normals_idx,
                       material_assignments=material_assignments, materials=materials,
                       vertex_normals=vertex_normals, **others)
        for name, value in members.items():
            if name not in _STORED:
                raise TypeError(f"SurfaceMesh: no member {name!r}")
            setattr(self, name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in _STORED:
            raise AttributeError(f"SurfaceMesh has no member {name!r}: one of {', '.join(_STORED)}")
        super().__setattr__(name, value)
        if value is None:
            del self.__dict__[name]

    def __getattr__(self, name: str) -> Any:
        if name in _COMPUTED:
            return _COMPUTED[name](self)
        if name in _STORED:
            return None
        raise AttributeError(f"SurfaceMesh has no member {name!r}: docs/porting.md lists what is "
                             f"available")

    @property
    def batching(self) -> SurfaceMesh.Batching:
        """NONE if vertices are [V,3]."""
        return self.Batching.NONE if self.vertices.ndim == 2 else self.Batching.FIXED

    def has_attribute(self, attr: str) -> bool:
        """Whether it was set; computed ones are not."""
        return attr in self.__dict__

    def get_attributes(self, only_tensors: bool = False) -> list[str]:
        """The names of what was set."""
        return [name for name, value in self.__dict__.items()
                if isinstance(value, torch.Tensor) or not only_tensors]

    def as_dict(self, only_tensors: bool = False) -> dict[str, Any]:
        """What was set, by name."""
        return {name: self.__dict__[name] for name in self.get_attributes(only_tensors)}

    def to_batched(self) -> SurfaceMesh:
        """Turns one mesh into a batch of one, in place; returns itself."""
        return self.set_batching(self.Batching.FIXED)

    def set_batching(self, batching: SurfaceMesh.Batching) -> SurfaceMesh:
        """Turns one mesh into a batch of one, or back, in place; returns itself. ValueError: a
        batch of several cannot be one."""
        if batching == self.batching:
            return self
        if batching == self.Batching.NONE and len(self) != 1:
            raise ValueError(f"SurfaceMesh.set_batching: {len(self)} meshes cannot become one")
        self._apply((lambda v: v[0]) if batching == self.Batching.NONE else
                    (lambda v: v[None] if isinstance(v, torch.Tensor) else [v]))
        return self

    @classmethod
    def cat(cls, meshes: Sequence[SurfaceMesh], fixed_topology: bool = True) -> SurfaceMesh:
        """A batch of meshes with the same faces, of what all of them have. ValueError: other faces,
        or fixed_topology is False: lists of meshes are not available."""
        if not fixed_topology or not all(torch.equal(m.faces, meshes[0].faces) for m in meshes):
            raise ValueError("SurfaceMesh.cat: only meshes with the same faces form a batch here")
        each = [mesh.copy().to_batched() for mesh in meshes]
        members = {name: [getattr(mesh, name) for mesh in each] for name in each[0].__dict__
                   if all(mesh.has_attribute(name) for mesh in each)}
        return cls(**{name: values[0] if name in _UNBATCHED
                      else sum(values, []) if name == "materials" else torch.cat(values)
                      for name, values in members.items()})

    def copy(self) -> SurfaceMesh:
        """Another mesh with the same tensors."""
        return SurfaceMesh(**self.__dict__)

    def cuda(self, device: Any = None, attributes: Any = None) -> SurfaceMesh:
        """Itself: tilegrad renders on the CPU."""
        del device, attributes
        return self

    def cpu(self, attributes: Any = None) -> SurfaceMesh:
        """Itself."""
        del attributes
        return self

    def to(self, device: Any, attributes: Any = None) -> SurfaceMesh:
        """Itself, whatever the device."""
        del device, attributes
        return self

    def detach(self) -> SurfaceMesh:
        """Another mesh with the tensors detached."""
        return self.copy()._apply(lambda v: v.detach() if isinstance(v, torch.Tensor) else v, ())

    def float_tensors_to(self, float_dtype: torch.dtype) -> SurfaceMesh:
        """Another mesh with its floating tensors of that type."""
        return self.copy()._apply(
            lambda v: v.to(float_dtype)
            if isinstance(v, torch.Tensor) and v.is_floating_point() else v, ())

    def _apply(self, change: Callable[[Any], Any],
               but: Sequence[str] = _UNBATCHED) -> SurfaceMesh:
        for name in [n for n in self.__dict__ if n not in but]:
            self.__dict__[name] = change(self.__dict__[name])
        return self

    def __len__(self) -> int:
        return 1 if self.vertices.ndim == 2 else len(self.vertices)

    def __repr__(self) -> str:
        parts = ", ".join(f"{name} {list(value.shape)}" for name, value in self.__dict__.items()
                          if isinstance(value, torch.Tensor))
        return f"<SurfaceMesh, batching {self.batching.value}: {parts}>"


def _look_up(values: Optional[torch.Tensor], index: Optional[torch.Tensor]
             ) -> Optional[torch.Tensor]:
    """[V,C] by [F,3] or [B,V,C] by [F,3] or [B,F,3]; -1, a corner without, has those of 0, as in
    Kaolin."""
    if values is None or index is None:
        return None
    index = index.long().clamp(min=0)
    if index.ndim == 2:
        return values[..., index, :]
    return torch.stack([v[i] for v, i in zip(values, index)])


def _face_normals(mesh: SurfaceMesh) -> torch.Tensor:
    given = _look_up(mesh.normals, mesh.face_normals_idx)
    if given is None and mesh.has_attribute("vertex_normals"):
        given = _look_up(mesh.vertex_normals, mesh.faces)
    if given is not None:
        return given
    corners = mesh.face_vertices
    flat = ops.mesh.face_normals(corners.reshape(-1, *corners.shape[-3:]), unit=True)
    return flat.reshape(*corners.shape[:-2], 1, 3).expand_as(corners)


def _vertex_normals(mesh: SurfaceMesh) -> torch.Tensor:
    normals = mesh.face_normals
    mean = ops.mesh.compute_vertex_normals(
        mesh.faces, normals.reshape(-1, *normals.shape[-3:]), mesh.vertices.shape[-2])
    return mean.reshape(mesh.vertices.shape)


def _materials_order(mesh: SurfaceMesh) -> Union[torch.Tensor, list[torch.Tensor], None]:
    of_faces = mesh.material_assignments
    if of_faces is None:
        return None
    if of_faces.ndim == 1:
        return _runs(of_faces)
    return [_runs(of_mesh) for of_mesh in of_faces]


def _runs(of_faces: torch.Tensor) -> torch.Tensor:
    """(material, first face) of each run of faces, of the materials [F] of one mesh."""
    materials, counts = of_faces.long().unique_consecutive(return_counts=True)
    order = torch.stack([materials, counts.cumsum(0) - counts], dim=1)
    return order[materials >= 0]  # -1: faces without one


_COMPUTED: dict[str, Callable[[SurfaceMesh], Any]] = {
    "face_vertices": lambda mesh: _look_up(mesh.vertices, mesh.faces),
    "face_uvs": lambda mesh: _look_up(mesh.uvs, mesh.face_uvs_idx),
    "face_normals": _face_normals,
    "vertex_normals": _vertex_normals,
    "face_colors": lambda mesh: _look_up(mesh.vertex_colors, mesh.faces),
    "face_features": lambda mesh: _look_up(mesh.vertex_features, mesh.faces),
    "materials_order": _materials_order,
}
_STORED = ("vertices", "faces", "normals", "uvs", "face_uvs_idx", "face_normals_idx",
           "material_assignments", "materials", "vertex_normals", "vertex_colors",
           "vertex_features", "face_normals", "face_uvs", "face_vertices", "face_colors",
           "face_features")


class TriangleMesh:
    """vertices [V,3], faces [F,3] int64; uvs [T,2] with face_textures [F,3] int64, or None. With
    adjacency: edges [E,2], and ff [F,3], the faces beyond each face's edges, -1 where there is
    none; else both are None. adj: what the caller puts there."""

    def __init__(self, vertices: torch.Tensor, faces: torch.Tensor,
                 uvs: Optional[torch.Tensor] = None, face_textures: Optional[torch.Tensor] = None,
                 textures: Optional[torch.Tensor] = None) -> None:
        self.vertices, self.faces = vertices, faces
        self.uvs, self.face_textures, self.textures = uvs, face_textures, textures
        self.edges: Optional[torch.Tensor] = None
        self.ff: Optional[torch.Tensor] = None
        self.adj: Optional[torch.Tensor] = None

    @classmethod
    def from_tensors(cls, vertices: torch.Tensor, faces: torch.Tensor,
                     uvs: Optional[torch.Tensor] = None,
                     face_textures: Optional[torch.Tensor] = None,
                     textures: Optional[torch.Tensor] = None,
                     enable_adjacency: bool = False) -> TriangleMesh:
        """Of copies of vertices and faces."""
        mesh = cls(vertices.clone(), faces.clone(), uvs, face_textures, textures)
        if enable_adjacency:
            mesh.edges, mesh.ff = adjacency(mesh.faces)
        return mesh

    @classmethod
    def from_obj(cls, filename: Union[str, "os.PathLike[str]"],
                 enable_adjacency: bool = False) -> TriangleMesh:
        """Loads a mesh, of any format that tilegrad.meshes reads. OSError, ValueError: name the
        file and what is wrong with it."""
        from tilegrad.compat.kaolin import io
        mesh = io.obj.import_mesh(filename)
        return cls.from_tensors(mesh.vertices, mesh.faces, mesh.uvs, mesh.face_uvs_idx,
                                enable_adjacency=enable_adjacency)

    from_off = from_obj

    @property
    def device(self) -> torch.device:
        """Of the vertices."""
        return self.vertices.device

    def cuda(self) -> None:
        """Does nothing: tilegrad renders on the CPU."""

    def cpu(self) -> None:
        """Does nothing."""

    def compute_face_normals(self) -> torch.Tensor:
        """[F,3], of length 1."""
        corners = ops.mesh.index_vertices_by_faces(self.vertices[None], self.faces)
        return ops.mesh.face_normals(corners, unit=True)[0]

    def compute_adjacency_matrix_full(self) -> torch.Tensor:
        """[V,V]: 1 where an edge joins two vertices, and on the diagonal."""
        count = len(self.vertices)
        return ops.mesh.adjacency_matrix(count, self.faces, sparse=False) + torch.eye(count)

    def compute_adjacency_matrix_sparse(self) -> torch.Tensor:
        """The same, sparse."""
        return self.compute_adjacency_matrix_full().to_sparse()

    @full_precision
    def compute_laplacian(self) -> torch.Tensor:
        """[V,3], each vertex minus the mean of its neighbours."""
        return -ops.mesh.uniform_laplacian(len(self.vertices), self.faces) @ self.vertices

    @full_precision
    def laplacian_smoothing(self, iterations: int = 1) -> None:
        """Moves each vertex to the mean of its neighbours and itself."""
        adjacency = self.compute_adjacency_matrix_full()
        for _ in range(iterations):
            self.vertices = adjacency @ self.vertices / adjacency.sum(dim=1, keepdim=True)

    def sample(self, num_samples: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Points [num_samples,3] distributed by area, and their faces [num_samples]."""
        points, faces = ops.mesh.sample_points(self.vertices[None], self.faces, num_samples)
        return points[0], faces[0]
