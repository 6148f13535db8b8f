# SPDX-License-Identifier: Apache-2.0
"""A triangle mesh with materials and textures, as files hold it. Public in `tilegrad.meshes`."""

from __future__ import annotations

import dataclasses
import os
from typing import Any, Optional, Union

import numpy as np

from tilegrad import _arrays, _core, _tools
from tilegrad._arrays import ending_of, name_of, Path
from tilegrad._camera import Camera
from tilegrad._lit import lit
from tilegrad._scene import Scene, Surface, Texture, changed

_COLOR_SPACES = ("srgb", "linear")
_NORMALS = ("auto", "smooth", "flat")
_ALPHA_MODES = ("opaque", "mask", "blend")


@dataclasses.dataclass
class Material:
    """How faces are drawn. Colours are encoded as in image files (sRGB).

    base_color: r, g, b, a, 0 to 1; multiplies the texture. texture: index into Mesh.textures, -1:
    none. wrap: "repeat", "mirror" or "clamp"; "repeat clamp" and the like: one way along u, another
    along v. nearest: nearest-neighbour sampling. alpha_mode: "opaque", "mask" (cut out where alpha
    is below alpha_cutoff) or "blend"; `scene` draws all three opaque. double_sided: False: viewers
    do not draw back faces. unlit: the colour ignores the light.
    """

    name: str = ""
    base_color: tuple[float, float, float, float] = (0.8, 0.8, 0.8, 1.0)
    texture: int = -1
    wrap: str = "repeat"
    nearest: bool = False
    alpha_mode: str = "opaque"
    alpha_cutoff: float = 0.5
    double_sided: bool = True
    unlit: bool = False

    def checked(self, function: str) -> dict[str, Any]:
        """Its members for C++. TypeError and ValueError name `function`."""
        place = f"material {self.name!r}: "
        _arrays.check_choice(function, place + "wrap", self.wrap, _core.WRAPS)
        _arrays.check_choice(function, place + "alpha_mode", self.alpha_mode, _ALPHA_MODES)
        color = _arrays.as_array(function, place + "base_color", self.base_color, np.float32, (4,))
        name = _arrays.as_text(function, "material name", str(self.name))
        return {"name": name, "base_color": color.tolist(),
                "texture": _arrays.as_number(function, place + "texture", self.texture, int),
                "wrap": self.wrap, "nearest": bool(self.nearest), "alpha_mode": self.alpha_mode,
                "alpha_cutoff": _arrays.as_number(function, place + "alpha_cutoff",
                                                  self.alpha_cutoff, float),
                "double_sided": bool(self.double_sided), "unlit": bool(self.unlit)}


@dataclasses.dataclass(eq=False, repr=False)
class MeshTexture:
    """An image on a mesh: (height, width, 3 or 4) uint8, row 0 on top is v = 1."""

    name: str
    image: np.ndarray

    def __repr__(self) -> str:
        return f"<tilegrad MeshTexture {self.name!r}: {' x '.join(map(str, self.image.shape))}>"


@dataclasses.dataclass(eq=False)
class MeshCamera:
    """A perspective camera that a glTF file holds: node_to_world (4, 4) float64, OpenGL's axes;
    yfov: radians, the full vertical field of view; aspect_ratio: of the field of view, 0: that of
    the image; znear: world units."""

    name: str
    node_to_world: np.ndarray
    yfov: float
    aspect_ratio: float
    znear: float

    def camera(self, width: int, height: int) -> Camera:
        """For an image of that size in pixels."""
        return Camera.of_numbers(_tools.from_gltf(
            np.ravel(self.node_to_world), (self.yfov, self.aspect_ratio, self.znear),
            (width, height)), (width, height))


@dataclasses.dataclass(eq=False)
class MeshTables:
    """A file's own lists of texture coordinates and normals, which corners share; None where there
    are none.

    uvs: (N, 2) float32, without the material's texture transform. normals: (M, 3) float32, of any
    length. face_uvs, face_normals: (F, 3) int32, indices into them; -1: a corner without.
    """

    uvs: Optional[np.ndarray] = None
    face_uvs: Optional[np.ndarray] = None
    normals: Optional[np.ndarray] = None
    face_normals: Optional[np.ndarray] = None


@dataclasses.dataclass(eq=False, repr=False)
class Mesh:
    """A triangle mesh: V vertices, F faces; None where absent.

    positions: (V, 3) float32. faces: (F, 3) int32; counter-clockwise seen from outside.
    normals: (V, 3) float32, unit. colors: (V, 4) or (V, 3) float32, 0 to 1, sRGB.
    corner_uvs: (F, 3, 2) float32, for the corners of faces; (0, 0) is the lower left corner of the
        texture. corner_normals: (F, 3, 3) float32. corner_colors: (F, 3, 4) or (F, 3, 3) float32,
        instead of colors.
    face_materials: (F,) int32, indices into materials; all 0 if None.
    warnings: what a file lacked, and its substitute. cameras: those of a glTF file.
    tables: the lists of an OBJ file from which corner_uvs and corner_normals were looked up;
        changes to them have no effect.
    origin: (3,) float64: what was subtracted from the file's coordinates, because they are too far
        from the origin for float32; `positions + origin` is the position in the world. Almost
        always 0.
    """

    positions: np.ndarray
    faces: np.ndarray
    normals: Optional[np.ndarray] = None
    colors: Optional[np.ndarray] = None
    corner_uvs: Optional[np.ndarray] = None
    corner_normals: Optional[np.ndarray] = None
    corner_colors: Optional[np.ndarray] = None
    face_materials: Optional[np.ndarray] = None
    materials: list[Material] = dataclasses.field(default_factory=list)
    textures: list[MeshTexture] = dataclasses.field(default_factory=list)
    warnings: list[str] = dataclasses.field(default_factory=list)
    cameras: list[MeshCamera] = dataclasses.field(default_factory=list)
    tables: Optional[MeshTables] = None
    origin: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))

    def scene_arguments(self, *, color_space: str = "srgb",
                        normals: str = "auto") -> dict[str, Any]:
        """The arguments of a `Scene` other than positions, faces, camera and light:
        colours, uvs, textures, surfaces, normals.

        color_space: "srgb": colours are the numbers of the file, as in training; "linear": decoded,
            as in viewers, so that the picture must be encoded in the end.
        normals: "auto" (the mesh's own; flat if it has none), "smooth" or "flat".
        ValueError: an array violates the shapes of Mesh, or an index is out of range.
        """
        linear = _arrays.check_choice("Mesh.scene", "color_space", color_space, _COLOR_SPACES) == 1
        _arrays.check_choice("Mesh.scene", "normals", normals, _NORMALS)
        made = _tools.scene_of_mesh(self._checked("Mesh.scene"), linear, normals)
        kind = made["normal_kind"]
        arguments = {"colors": made["colors"], "uvs": made["uvs"],
                     "normals": made["normals"] if kind == "given" else kind,
                     "textures": [Texture(**texture) for texture in made["textures"]] or None,
                     "surfaces": [Surface(**surface) for surface in made["surfaces"]],
                     "face_surfaces": self.face_materials, "two_sided": True}
        per_corner = [name for name in ("colors", "uvs", "normals")
                      if getattr(arguments[name], "ndim", 2) == 3]
        return {**arguments, "per_corner": tuple(per_corner)}

    def scene(self, camera: Camera, *, color_space: str = "srgb", normals: str = "auto",
              **arguments: Any) -> Scene:
        """A scene of this mesh. color_space, normals: as in `scene_arguments`; further arguments
        are the Scene's own (lighting, lights, ...) and override the mesh's."""
        own = self.scene_arguments(color_space=color_space, normals=normals)
        return Scene(self.positions, self.faces, camera, **changed(own, arguments))

    def save(self, path: Path) -> None:
        """Writes a binary glTF 2.0 file (.glb), which every viewer opens; whole or not at all."""
        if ending_of(path) != ".glb":
            raise ValueError(f"save_mesh: {os.fsdecode(path)!r} must end in .glb, the format that "
                             f"is written")
        _tools.save_mesh(name_of(path), self._checked("save_mesh"))

    def to_trimesh(self, trimesh: Any) -> Any:
        """The mesh as a Trimesh of the module trimesh, with vertex colours; `trimesh`: the
        module."""
        return trimesh.Trimesh(vertices=self.positions, faces=self.faces,
                               vertex_normals=self.normals, vertex_colors=self.colors,
                               process=False)

    def to_open3d(self, open3d: Any) -> Any:
        """The mesh as a TriangleMesh of the module open3d, with vertex colours; `open3d`: the
        module."""
        vectors = open3d.utility
        mesh = open3d.geometry.TriangleMesh(
            vectors.Vector3dVector(np.asarray(self.positions, np.float64)),
            vectors.Vector3iVector(np.asarray(self.faces, np.int32)))
        for name, values in (("vertex_colors", self.colors), ("vertex_normals", self.normals)):
            if values is not None:
                values = np.ascontiguousarray(np.asarray(values, np.float64)[:, :3])
                setattr(mesh, name, vectors.Vector3dVector(values))
        return mesh

    def _repr_png_(self) -> bytes:
        """The display in notebooks."""
        camera = Camera.framing(self)
        return lit(self, camera, camera.size)._repr_png_()

    def __repr__(self) -> str:
        parts = [name for name in ("normals", "colors", "corner_uvs", "corner_normals",
                                  "corner_colors")
                 if getattr(self, name) is not None]
        return (f"<tilegrad Mesh: {len(self.positions)} vertices, {len(self.faces)} faces, "
                f"{len(self.materials)} materials, {len(self.textures)} textures"
                f"{''.join(', ' + name for name in parts)}>")

    def _checked(self, function: str) -> dict[str, Any]:
        """As a dictionary for C++, all arrays of the right dtype."""
        sizes: dict[str, int] = {}

        def array(name: str, dtype: Any, *shape: Union[str, int]) -> Optional[np.ndarray]:
            value = getattr(self, name)
            return None if value is None else _arrays.as_array(function, name, value, dtype, shape,
                                                               sizes)

        return {"positions": array("positions", np.float32, "V", 3),
                "faces": array("faces", np.int32, "F", 3),
                "normals": array("normals", np.float32, "V", 3),
                "colors": self._rgba(function, "colors", sizes, "V"),
                "corner_uvs": array("corner_uvs", np.float32, "F", 3, 2),
                "corner_normals": array("corner_normals", np.float32, "F", 3, 3),
                "corner_colors": self._rgba(function, "corner_colors", sizes, "F", 3),
                "face_materials": array("face_materials", np.int32, "F"),
                "origin": self._origin(function),
                "materials": [material.checked(function) for material in self._materials(function)],
                "textures": [{"name": _arrays.as_text(function, "texture name",
                                                      str(texture.name)),
                              "image": self._texels(function, texture)}
                             for texture in self.textures]}

    def _origin(self, function: str) -> list[float]:
        origin = _arrays.as_array(function, "origin", self.origin, np.float64, (3,))
        _arrays.check_finite(function, "origin", origin)
        return origin.tolist()

    def _materials(self, function: str) -> list[Material]:
        found = self.materials
        if isinstance(found, (list, tuple)) and all(isinstance(m, Material) for m in found):
            return list(found)
        raise TypeError(f"{function}: materials is {found!r}, expected a list of Material")

    @staticmethod
    def _texels(function: str, texture: MeshTexture) -> np.ndarray:
        channels = 4 if np.shape(texture.image)[2:] == (4,) else 3
        return _arrays.as_array(function, f"image of texture {texture.name!r}", texture.image,
                                np.uint8, ("height", "width", channels))

    def _rgba(self, function: str, name: str, sizes: dict[str, int],
              *shape: Union[str, int]) -> Optional[np.ndarray]:
        value = getattr(self, name)
        if value is None:
            return None
        channels = 3 if np.shape(value)[-1:] == (3,) else 4
        colors = _arrays.as_array(function, name, value, np.float32, (*shape, channels), sizes)
        _arrays.warn_of_bytes(function, name, colors)
        if channels == 4:
            return colors
        return np.concatenate([colors, np.ones((*colors.shape[:-1], 1), np.float32)], axis=-1)


def mesh_of_dict(arrays: dict[str, Any]) -> Mesh:
    """From the dictionary that C++ returns."""
    parts = dict(arrays)
    parts["materials"] = [Material(**material) for material in arrays["materials"]]
    parts["textures"] = [MeshTexture(**texture) for texture in arrays["textures"]]
    parts["cameras"] = [MeshCamera(**camera) for camera in arrays.get("cameras", ())]
    if arrays.get("tables") is not None:
        parts["tables"] = MeshTables(**arrays["tables"])
    return Mesh(**parts)
