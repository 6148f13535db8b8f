# SPDX-License-Identifier: Apache-2.0
"""Scenes to render: a mesh, its appearance, and a camera; one image or a batch."""

from __future__ import annotations

from typing import Any, Optional, Sequence, Union

import numpy as np

from tilegrad import _arrays, _core
from tilegrad._camera import Camera
from tilegrad._packed import Packed, Part, stacked

_SHAPES = {"colors": ("V", 3), "uvs": ("V", 2), "normals": ("V", 3), "attributes": ("V", "C"),
           "light_directions": ("V", 3), "sh": (9,)}
_CORNER_SHAPES = {"colors": ("F", 3, 3), "uvs": ("F", 3, 2), "normals": ("F", 3, 3),
                  "attributes": ("F", 3, "C")}  # in the order that C++ has them
_FIELDS = ("positions", "faces", "camera", *_SHAPES, "face_surfaces", "lights")
# Arguments that have a gradient.
DIFFERENTIABLE = ("positions", "camera", *_SHAPES, "textures", "surfaces", "lights")
_S, _L = _core.SURFACE, _core.LIGHT


class Surface(Packed):
    """The material of a surface, or of S of them::

        colour = base_color * texture * vertex colour * (ambient + diffuse * light)
                 + specular * highlight

    base_color, ambient, diffuse, specular: (3,) or (S, 3). Spherical harmonics use base_color only;
        specular and shininess apply to Phong lighting only.
    shininess: number or (S,), 0 to 1e6.
    texture: index into the scene's textures, or S of them; -1: none.
    """

    __slots__ = ("texture",)
    _SIZE = len(_S)

    base_color = Part(0, (3,), "(..., 3)")
    ambient = Part(3, (3,), "(..., 3)")
    diffuse = Part(6, (3,), "(..., 3)")
    specular = Part(9, (3,), "(..., 3)")
    shininess = Part(12, (), "(...) exponent of the highlight.")

    def __init__(self, base_color=_S[:3], ambient=_S[3:6], diffuse=_S[6:9], specular=_S[9:12],
                 shininess=_S[12], texture: Union[int, Sequence[int]] = -1) -> None:
        self._pack(base_color=base_color, ambient=ambient, diffuse=diffuse, specular=specular,
                   shininess=shininess)
        self.texture = _arrays.contiguous("Surface", "texture", texture, np.int32)

    @classmethod
    def of_numbers(cls, numbers: np.ndarray) -> "Surface":
        """From an array (..., 13), without a copy; without textures."""
        surface = super().of_numbers(numbers)
        surface.texture = np.array(-1, np.int32)
        return surface

    def __getitem__(self, index: Any) -> "Surface":
        surface = super().__getitem__(index)
        textures = np.array(self.textures(), np.int32).reshape(self.numbers.shape[:-1])
        surface.texture = np.asarray(textures[index])
        return surface

    @classmethod
    def _names(cls) -> list[str]:
        return [*super()._names(), "texture"]

    def textures(self) -> list[int]:
        """The texture of each surface."""
        count = self.numbers.shape[:-1] or (1,)
        try:
            return np.broadcast_to(self.texture, count).ravel().tolist()
        except ValueError:
            raise ValueError(f"Surface: texture has shape {self.texture.shape}, expected () or "
                             f"{count}, one for each surface") from None


class Light(Packed):
    """A directional light, or L of them, or L for each of N images.

    direction: (3,) or (L, 3) or (N, L, 3), from the surface to the light, world, not 0.
    intensity: number or (L,) or (N, L).
    """

    __slots__ = ()
    _SIZE = len(_L)

    direction = Part(0, (3,), "(..., 3) from the surface to the light.")
    intensity = Part(3, (), "(...)")

    def __init__(self, direction=_L[:3], intensity=_L[3]) -> None:
        self._pack(direction=direction, intensity=intensity)


class Texture:
    """Texels, and how they are sampled.

    texels: (Ht, Wt, 3), or (N, Ht, Wt, 3) for a texture of each image, 0 to 1; row 0 on top;
        (u, v) = (0, 0) is the lower left corner. Sides 1 to 16384.
    wrap: "repeat", "clamp" (the border extends) or "mirror"; "repeat clamp" and the like: one way
        along u, another along v.
    filter: "nearest", "bilinear" or "trilinear" (between the levels of a pyramid; gradients hold
        the level constant).
    """

    __slots__ = ("texels", "wrap", "filter")

    def __init__(self, texels: Any, wrap: str = _core.WRAPS[_core.TEXTURE[0]],
                 filter: str = _core.FILTERS[_core.TEXTURE[1]]) -> None:
        _arrays.check_choice("Texture", "wrap", wrap, _core.WRAPS)
        _arrays.check_choice("Texture", "filter", filter, _core.FILTERS)
        self.texels, self.wrap, self.filter = texels, wrap, filter


class Scene:
    """A mesh with a camera: one image, or a batch of N images that share faces.

    Shapes: V vertices, F faces, C channels. Any array but `faces` and `face_surfaces` may have an
    additional leading axis N, with each image's own; without it all images share the array. A batch
    of different meshes is a list of scenes.

    Arrays that are C-contiguous and of the scene's dtype are used in place, not copied: they must
    not change from a render to its last backward. Everything else is copied once, here
    (`tilegrad.stats` counts that); faces of another integer type once for all scenes with that
    array.

    positions: (V, 3), world. Their dtype is the scene's: an array of float64 makes a scene for the
        scalar reference in double precision, which is for checks and slow; everything else is
        float32, for the engine.
    faces: (F, 3) int32, indices of vertices; counter-clockwise is the front.
    camera: Camera, of one view or of N.
    colors: (V, 3), 0 to 1; bytes are refused, also in textures.
    uvs: (V, 2); (0, 0) is the lower left corner of a texture.
    textures: Texture or an array (Ht, Wt, 3), or a list of them.
    surfaces: Surface or a list of them; without any, one with C++'s defaults and texture 0.
    face_surfaces: (F,) int32, the surface of each face; all 0 if None.
    lighting: "none" (colours as they are), "lambert", "phong" or "spherical_harmonics".
    normals: "smooth" (of vertices, from positions), "flat" (of faces), or an array (V, 3) of any
        length.
    two_sided: whether to flip normals of faces seen from behind.
    clamp: whether to clamp colours to [0, 1]; clamped values have no gradient.
    lights: Light or a list of them, for Lambert and Phong lighting.
    light_directions: (V, 3), one light of intensity 1 for each vertex, instead of `lights`.
    sh: (9,), orthonormal real spherical harmonics 1, -y, z, -x, xy, -yz, 3z^2-1, -xz, x^2-y^2.
    attributes: (V, C), anything else to interpolate.
    per_corner: names of those of colors, uvs, normals, attributes that are given for the corners of
        faces, (F, 3, C), so that seams need no doubled vertices; an error if the scene lacks one.

    Errors: TypeError and ValueError with the argument's name, what was expected and got. render
    reports numbers that are not finite and indices out of range.
    """

    __slots__ = ("_arguments", "_fields", "_textures", "_surface", "_record", "_dtype", "_count",
                 "__weakref__")

    def __init__(self, positions: Any, faces: Any, camera: Camera, *, colors: Any = None,
                 uvs: Any = None, textures: Any = None, surfaces: Any = None,
                 face_surfaces: Any = None, lighting: str = "none", normals: Any = "smooth",
                 two_sided: bool = False, clamp: bool = False, lights: Any = None,
                 light_directions: Any = None, sh: Any = None, attributes: Any = None,
                 per_corner: Sequence[str] = ()) -> None:
        self._arguments = dict(locals())
        del self._arguments["self"]
        self._dtype = _arrays.float_dtype("Scene", "positions", positions)
        sizes: dict[str, int] = {}
        corners = self._corners(per_corner)
        fields = {"positions": self._take("positions", positions, ("V", 3), sizes),
                  "faces": _arrays.as_indices("Scene", "faces", faces, ("F", 3), sizes),
                  "camera": self._camera(camera, sizes)}
        for name in _SHAPES:
            value = self._arguments[name]
            if name == "normals" and isinstance(value, str):
                value = None  # they are derived
            if value is None and name in corners:
                raise ValueError(f"Scene: per_corner has {name!r}, but the scene has no {name}")
            if value is not None:
                shape = _CORNER_SHAPES[name] if name in corners else _SHAPES[name]
                fields[name] = self._take(name, value, shape, sizes)
        if face_surfaces is not None:
            fields["face_surfaces"] = _arrays.as_indices("Scene", "face_surfaces", face_surfaces,
                                                          ("F",), sizes)
        if lights is not None:
            fields["lights"] = self._lights(lights, sizes)
        self._fields = fields
        self._textures = [] if textures is None else self._take_textures(textures, sizes)
        self._surface = (None, []) if surfaces is None else self._surfaces(surfaces)
        self._count = sizes.get("N", 1)
        arrays = self._core_arrays(corners)
        arrays.shading = (_arrays.check_choice("Scene", "lighting", lighting, _core.LIGHTINGS),
                          self._normal_kind(normals),
                          _arrays.as_flag("Scene", "two_sided", two_sided),
                          _arrays.as_flag("Scene", "clamp", clamp))
        kind = _core.Scene64 if self._dtype == np.float64 else _core.Scene32
        self._record = kind(self._count, arrays)

    # What the constructor consists of.

    def _take(self, name: str, value: Any, shape: tuple, sizes: dict) -> np.ndarray:
        colors = name.startswith(("colors", "textures"))
        take = _arrays.as_colors if colors else _arrays.as_batched
        return take("Scene", name, value, self._dtype, shape, sizes)

    def _camera(self, camera: Camera, sizes: dict) -> np.ndarray:
        if not isinstance(camera, Camera):
            raise TypeError(f"Scene: camera must be a Camera, got {type(camera).__name__}")
        numbers = camera.numbers.astype(self._dtype)
        _arrays.check_batched("Scene", "camera", numbers.shape, (Camera._SIZE,), sizes)
        return numbers

    @staticmethod
    def _corners(per_corner: Sequence[str]) -> Sequence[str]:
        return _arrays.as_names("Scene", "per_corner", per_corner, tuple(_CORNER_SHAPES))

    def _lights(self, lights: Any, sizes: dict) -> np.ndarray:
        numbers = stacked("Scene", "lights", lights, Light).astype(self._dtype)
        _arrays.check_batched("Scene", "lights", numbers.shape, ("L", Light._SIZE), sizes)
        return numbers

    def _take_textures(self, textures: Any, sizes: dict) -> list[tuple[np.ndarray, str, str]]:
        out = []
        for i, value in enumerate(textures if isinstance(textures, (list, tuple)) else [textures]):
            texture = value if isinstance(value, Texture) else Texture(value)
            own = {name: sizes[name] for name in sizes if name == "N"}
            texels = self._take(f"textures[{i}]", texture.texels, ("Ht", "Wt", 3), own)
            sizes.update({name: own[name] for name in own if name == "N"})
            out.append((texels, texture.wrap, texture.filter))
        return out

    def _surfaces(self, surfaces: Any) -> tuple[np.ndarray, list[int]]:
        numbers = stacked("Scene", "surfaces", surfaces, Surface).astype(self._dtype)
        _arrays.check_shape("Scene", "surfaces", numbers.shape, ("S", Surface._SIZE))
        each = [surfaces] if isinstance(surfaces, Surface) else surfaces
        return numbers, [texture for surface in each for texture in surface.textures()]

    def _core_arrays(self, corners: Sequence[str]) -> _core.SceneArrays:
        a = _core.SceneArrays()
        a.fields = {**self._fields}
        if corners:
            a.per_corner = list(corners)
        if self._textures:
            a.textures = [texels for texels, _, _ in self._textures]
            a.wraps = [_core.WRAPS.index(wrap) for _, wrap, _ in self._textures]
            a.filters = [_core.FILTERS.index(filter) for _, _, filter in self._textures]
        if self._surface[1]:
            a.fields["surfaces"], a.surface_textures = self._surface
        return a

    @staticmethod
    def _normal_kind(normals: Any) -> int:
        given = len(_core.NORMAL_KINDS) - 1
        if normals is not None and not isinstance(normals, str):
            return given
        return _arrays.check_choice("Scene", "normals", normals, _core.NORMAL_KINDS[:given])

    # What it holds.

    @property
    def positions(self) -> np.ndarray:
        """(V, 3) or (N, V, 3), world: the array that was given, or its copy."""
        return self._fields["positions"]

    @property
    def faces(self) -> np.ndarray:
        """(F, 3) int32."""
        return self._fields["faces"]

    @property
    def camera(self) -> Camera:
        """Of one view, or of N; in the scene's dtype."""
        return Camera.of_numbers(self._fields["camera"], self._arguments["camera"].size)

    @property
    def dtype(self) -> np.dtype:
        """float32 (the engine) or float64 (the scalar reference)."""
        return self._dtype

    def __len__(self) -> int:
        """N, the number of images."""
        return self._count

    def __getitem__(self, name: str) -> Optional[np.ndarray]:
        """The array of that name, as the renderer sees it; None if the scene has none."""
        if name not in _FIELDS:
            raise KeyError(f"Scene has no array {name!r}, but " + ", ".join(_FIELDS))
        return self._fields.get(name)

    def __contains__(self, name: Any) -> bool:
        """Whether the scene has an array of that name."""
        return self._fields.get(name) is not None

    def replace(self, **changes: Any) -> "Scene":
        """The same scene with some arguments changed: scene.replace(positions=moved). Arguments set
        to None also leave per_corner."""
        unknown = sorted(set(changes) - set(self._arguments))
        if unknown:
            raise TypeError(f"Scene.replace: no argument {unknown[0]!r}")
        return Scene(**changed(self._arguments, changes))

    def __reduce__(self) -> tuple:
        return _scene_of, (self._arguments,)

    def __repr__(self) -> str:
        v, f = self.positions.shape[-2], len(self.faces)
        return f"<tilegrad.Scene: {len(self)} images, {v} vertices, {f} faces, {self.dtype}>"


def changed(arguments: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Arguments of a scene with changes. Unless `per_corner` is among them, it loses the names of
    removed arguments."""
    merged = {**arguments, **changes}
    if "per_corner" not in changes:
        gone = [name for name, value in changes.items() if value is None or isinstance(value, str)]
        merged["per_corner"] = tuple(
            name for name in Scene._corners(merged.get("per_corner", ())) if name not in gone)
    return merged


def _scene_of(arguments: dict) -> Scene:
    return Scene(**arguments)
