# SPDX-License-Identifier: Apache-2.0
"""The renderer of tilegrad in C++; use it through the package tilegrad."""

from typing import Any, Optional, Sequence, Union, overload

import numpy as np

Size = tuple[int, int]  # width, height; pixels

__version__: str

# Names of enumerators, in the order of C++'s enumerations.
INTERPOLATIONS: tuple[str, ...]
CULLINGS: tuple[str, ...]
ALPHA_RULES: tuple[str, ...]
WRAPS: tuple[str, ...]
FILTERS: tuple[str, ...]
LIGHTINGS: tuple[str, ...]
NORMAL_KINDS: tuple[str, ...]
IMAGES: tuple[str, ...]

# Defaults of records, number by number.
CAMERA: list[float]
SURFACE: list[float]
LIGHT: list[float]
TEXTURE: tuple[int, int]
FOV_Y: float

def simd_target() -> str: ...
def icosphere(level: int, radius: float) -> tuple[np.ndarray, np.ndarray]: ...
def camera_look_at(fov_y: float, size: Size, eye: np.ndarray, target: np.ndarray,
                   up: np.ndarray) -> np.ndarray: ...
def camera_orbit(fov_y: float, size: Size, orbits: np.ndarray) -> np.ndarray: ...
def camera_from(convention: str, rows: np.ndarray, size: Size = ...,
                half: bool = ...) -> np.ndarray: ...
def camera_to(convention: str, cameras: np.ndarray, size: Size = ..., half: bool = ...,
              far_plane: float = ...) -> np.ndarray: ...
def camera_resize(cameras: np.ndarray, from_size: Size, to_size: Size) -> np.ndarray: ...

class RenderOptions:
    width: int
    height: int
    delta: float
    max_alpha_error: float
    interpolation: int
    culling: int
    alpha_rule: int
    paper_box: float
    paper_faces: int
    def __init__(self) -> None: ...

class SceneArrays:
    fields: dict[str, np.ndarray]
    per_corner: list[str]
    textures: list[np.ndarray]
    wraps: list[int]
    filters: list[int]
    surface_textures: list[int]
    shading: tuple[int, int, bool, bool]
    def __init__(self) -> None: ...

class _Scene:
    def __init__(self, count: int, arrays: SceneArrays) -> None: ...
    @property
    def count(self) -> int: ...

class Scene32(_Scene): ...
class Scene64(_Scene): ...

class _Frame:
    @property
    def count(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def width(self) -> int: ...
    @property
    def alpha_error_bound(self) -> float: ...
    @property
    def face_ids(self) -> np.ndarray: ...
    def view(self, name: str, writeable: bool = False) -> np.ndarray: ...

class Frame32(_Frame): ...
class Frame64(_Frame): ...

class Renderer:
    def __init__(self, threads: int) -> None: ...
    @property
    def threads(self) -> int: ...
    @overload
    def render(self, scenes: Sequence[Scene32], options: RenderOptions,
               outputs: Sequence[bool]) -> Frame32: ...
    @overload
    def render(self, scenes: Sequence[Scene64], options: RenderOptions,
               outputs: Sequence[bool]) -> Frame64: ...
    def backward(self, frame: Union[Frame32, Frame64], cotangents: dict[str, np.ndarray],
                 gradients: Sequence[dict[str, Any]], add: bool = False) -> None: ...

# Of tilegrad.compat.kaolin. Arrays are C-contiguous, float32 or float64, all of a call the same.

class ProjectedMaskOptions:
    def __init__(self, *, delta: float, max_alpha_error: float) -> None: ...
    @staticmethod
    def paper(*, delta: float, boxlen: float, knum: int,
              edge_eps: float) -> ProjectedMaskOptions: ...

def rasterize_projected(
    face_vertices_image: np.ndarray, face_vertices_z: np.ndarray, face_features: np.ndarray,
    valid_faces: Optional[np.ndarray], height: int, width: int, eps: float,
    threads: int) -> tuple[np.ndarray, np.ndarray]: ...
def rasterize_projected_backward(
    face_vertices_image: np.ndarray, face_features: np.ndarray, face_idx: np.ndarray,
    gradient: np.ndarray, eps: float, wants_face_vertices_image: bool, wants_face_features: bool,
    threads: int) -> tuple[np.ndarray, np.ndarray]: ...
def projected_soft_mask(
    face_vertices_image: np.ndarray, selected_face_idx: np.ndarray, options: ProjectedMaskOptions,
    threads: int) -> tuple[np.ndarray, float]: ...
def projected_soft_mask_backward(
    face_vertices_image: np.ndarray, selected_face_idx: np.ndarray, soft_mask: np.ndarray,
    gradient: np.ndarray, options: ProjectedMaskOptions, threads: int) -> np.ndarray: ...

# Of tilegrad.compat.nvdiffrast. Arrays are C-contiguous, float32 or float64, all of a call the same.

TEXTURE_FILTERS: tuple[str, ...]
TEXTURE_BOUNDARIES: tuple[str, ...]

class NvdiffrastRasterizer:
    def __init__(self) -> None: ...
    def rasterize(
        self, pos: np.ndarray, tri: np.ndarray, ranges: Optional[np.ndarray], height: int,
        width: int, peeled: Optional[np.ndarray], threads: int
    ) -> tuple[np.ndarray, np.ndarray]: ...

class InterpolateCall:
    def __init__(self, *, tri: np.ndarray, rast: np.ndarray, rast_db: Optional[np.ndarray],
                 diff_attrs: np.ndarray, threads: int) -> None: ...

class EdgeRings:
    def __init__(self, tri: np.ndarray) -> None: ...

class TextureCall:
    def __init__(self, *, uv: np.ndarray, uv_da: Optional[np.ndarray],
                 mip_level_bias: Optional[np.ndarray], filter: int, boundary: int,
                 threads: int) -> None: ...

def nvdiffrast_rasterize_backward(
    pos: np.ndarray, tri: np.ndarray, rast: np.ndarray, d_rast: Optional[np.ndarray],
    d_rast_db: Optional[np.ndarray], threads: int) -> np.ndarray: ...
def nvdiffrast_interpolate(
    attr: np.ndarray, call: InterpolateCall) -> tuple[np.ndarray, np.ndarray]: ...
def nvdiffrast_interpolate_backward(
    attr: np.ndarray, call: InterpolateCall, d_out: np.ndarray, d_out_da: Optional[np.ndarray],
    wanted: Sequence[bool]
) -> tuple[Optional[np.ndarray], Optional[np.ndarray], Optional[np.ndarray]]: ...
def nvdiffrast_antialias(
    color: np.ndarray, rast: np.ndarray, pos: np.ndarray, tri: np.ndarray, rings: EdgeRings,
    threads: int) -> np.ndarray: ...
def nvdiffrast_antialias_backward(
    color: np.ndarray, rast: np.ndarray, pos: np.ndarray, tri: np.ndarray, rings: EdgeRings,
    gradient: np.ndarray, wanted: Sequence[bool], threads: int
) -> tuple[Optional[np.ndarray], Optional[np.ndarray]]: ...
def nvdiffrast_texture(levels: Sequence[np.ndarray], call: TextureCall) -> np.ndarray: ...
def nvdiffrast_texture_backward(
    levels: Sequence[np.ndarray], call: TextureCall, gradient: np.ndarray, wanted: Sequence[bool]
) -> tuple[list[np.ndarray], Optional[np.ndarray], Optional[np.ndarray],
           Optional[np.ndarray]]: ...
def nvdiffrast_mip(tex: np.ndarray, most: int, threads: int) -> list[np.ndarray]: ...
def nvdiffrast_mip_backward(d_levels: Sequence[np.ndarray], threads: int) -> np.ndarray: ...

# Of tilegrad.fragments.

class LayeredOptions:
    def __init__(self, *, height: int, width: int, faces_per_pixel: int, blur_radius: float,
                 perspective_correct: bool, clip_barycentrics: bool,
                 cull_backfaces: bool) -> None: ...

def rasterize_layers(
    face_vertices: np.ndarray, images: Sequence[tuple[int, int]], options: LayeredOptions,
    threads: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]: ...
def rasterize_layers_backward(
    face_vertices: np.ndarray, pix_to_face: np.ndarray, d_zbuf: np.ndarray,
    d_bary_coords: np.ndarray, d_dists: np.ndarray, options: LayeredOptions,
    threads: int) -> np.ndarray: ...
