# SPDX-License-Identifier: Apache-2.0
"""A call of `tilegrad.torch.render`: which arguments are tensors, of which mesh, and where their
gradients go."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple, Optional, Sequence

import numpy as np
import torch

from tilegrad import _arrays
from tilegrad._arrays import thread_count
from tilegrad._dense import check_dense
from tilegrad._packed import Packed
from tilegrad._renderer import RECORDS, Frame, Gradients, Renderer
from tilegrad._scene import Scene, Surface, Texture

_INDICES = ("faces", "face_surfaces")  # a Scene takes their tensors as they are


class Place(NamedTuple):
    """The place of a tensor: its scene, its argument, and for textures which one."""

    scene: int
    name: str
    texture: int = 0


class Call:
    """A render: its tensors, and the other arguments with placeholders for them."""

    def __init__(self, scenes: Sequence[dict[str, Any]], options: dict[str, Any],
                 threads: int) -> None:
        for name, value in options.items():
            if isinstance(value, torch.Tensor) and value.requires_grad:
                raise ValueError(f"render: {name} has no gradient; give {name}.item()")
        self.options, self.threads = options, thread_count("render", threads)
        self.scenes = [_with_textures(scene) for scene in scenes]
        self.surface_textures = [_surface_textures(scene) for scene in self.scenes]
        self.places: list[Place] = []
        self.tensors: list[torch.Tensor] = []
        for i, scene in enumerate(self.scenes):
            for k, texture in enumerate(scene.get("textures") or ()):
                self._note(Place(i, "textures", k), texture.texels)
            for name, value in scene.items():
                self._note(Place(i, name), value)

    def _note(self, place: Place, value: Any) -> None:
        if not isinstance(value, torch.Tensor):
            return
        name = place.name
        check_dense("render", name, value)
        if value.is_floating_point() and value.dtype not in (torch.float32, torch.float64):
            raise TypeError(f"render: {name} has dtype {value.dtype}, expected torch.float32 or "
                            f"torch.float64 ({name}.float() makes it one)")
        self.places.append(place)
        self.tensors.append(value)

    def frame(self, tensors: Sequence[torch.Tensor]) -> Frame:
        """Renders, in the tensors' own memory where the renderer can use it."""
        scenes = [dict(scene) for scene in self.scenes]
        for scene in scenes:
            if scene.get("textures") is not None:
                scene["textures"] = list(scene["textures"])
        for place, tensor in zip(self.places, tensors):
            if place.name not in _INDICES:
                self._put(scenes[place.scene], place, tensor.detach().resolve_neg().numpy())
        return self._engine().render([Scene(**scene) for scene in scenes], **self.options)

    def _put(self, scene: dict[str, Any], place: Place, array: np.ndarray) -> None:
        name = place.name
        if name == "textures":
            old = scene[name][place.texture]
            scene[name][place.texture] = Texture(array, old.wrap, old.filter)
        elif name in RECORDS:
            scene[name] = self._record(place, array)
        else:
            scene[name] = array

    def _record(self, place: Place, array: np.ndarray) -> Packed:
        """The numbers of a camera, lights or surfaces as a Camera, Light or Surface."""
        kind = RECORDS[place.name]
        if array.ndim < 1 or array.shape[-1] != kind._SIZE:
            raise ValueError(f"render: {place.name} has shape {array.shape}, expected "
                             f"{_arrays.shape_text(('...', kind._SIZE))}")
        record = kind.of_numbers(array)
        if isinstance(record, Surface):
            record.texture = self.surface_textures[place.scene]
        return record

    def gradients(self, frame: Frame, wanted: Sequence[bool],
                  cotangents: dict[str, Any]) -> list[Optional[torch.Tensor]]:
        """dL/d(tensor) in the order of the tensors; None if not requested."""
        names = tuple(dict.fromkeys(place.name for place, want in zip(self.places, wanted) if want))
        found = self._engine().backward(frame, wrt=names, **cotangents)
        return [self._gradient(found[place.scene], place) if want else None
                for place, want in zip(self.places, wanted)]

    @staticmethod
    def _gradient(found: Gradients, place: Place) -> torch.Tensor:
        value = getattr(found, place.name)
        if place.name == "textures":
            value = value[place.texture]
        return torch.from_numpy(value.numbers if place.name in RECORDS else value)

    def _engine(self) -> Renderer:
        return _engine(self.threads or torch.get_num_threads())


def scenes_of(arguments: dict[str, Any]) -> list[dict[str, Any]]:
    """The arguments of each mesh, if positions is a list."""
    positions = arguments["positions"]
    several = isinstance(positions, (list, tuple)) and len(positions) > 0
    if not several or not all(getattr(mesh, "ndim", 0) >= 2 for mesh in positions):
        return [arguments]  # nested lists of numbers are one mesh, too
    own = {name: value for name, value in arguments.items() if _is_of_each(value)}
    own["positions"] = positions
    for name, value in own.items():
        if len(value) != len(positions):
            raise ValueError(f"render: {name} is a list of {len(value)}, expected {len(positions)}, "
                             f"one for each of positions; what all share may be a tuple")
    return [{**arguments, **{name: value[i] for name, value in own.items()}}
            for i in range(len(positions))]


def _is_of_each(value: Any) -> bool:
    """Whether it is a list of anything but numbers and names."""
    return isinstance(value, list) and not all(isinstance(v, (int, float, str)) for v in value)


def _with_textures(arguments: dict[str, Any]) -> dict[str, Any]:
    """The same with a list of Texture, if there are textures."""
    textures = arguments.get("textures")
    if textures is None:
        return arguments
    each = textures if isinstance(textures, (list, tuple)) else [textures]
    made = [texture if isinstance(texture, Texture) else Texture(texture) for texture in each]
    return {**arguments, "textures": made}


def _surface_textures(arguments: dict[str, Any]) -> np.ndarray:
    """Removes them from the arguments, in the form of Surface: one -1 for all surfaces if there are
    none."""
    given = arguments.pop("surface_textures")
    indices = _arrays.contiguous("render", "surface_textures", given, np.int32)
    if not indices.size:
        return np.array(-1, np.int32)
    if not isinstance(arguments.get("surfaces"), torch.Tensor):
        raise ValueError("render: surface_textures belong to surfaces in a tensor; a Surface "
                         "has its own texture")
    return indices


@functools.lru_cache(maxsize=None)
def _engine(threads: int) -> Renderer:
    """One for each number of threads; a renderer serves any thread and any process."""
    return Renderer(threads)
