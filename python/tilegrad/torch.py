# SPDX-License-Identifier: Apache-2.0
"""The renderer as a differentiable function of PyTorch tensors, over shared memory.

    positions = torch.tensor(mesh.positions, requires_grad=True)
    images = tilegrad.torch.render(positions, mesh.faces, camera, width=64, height=64)
    (images.alpha - target).square().mean().backward()          # positions.grad

float32 tensors are rendered by the engine, float64 ones by the scalar reference in double
precision, which is for `torch.autograd.gradcheck`. Tensors are of the CPU. Any tensor of a scene
may ask for a gradient; what does not is not computed. The first derivative only.
"""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple, Optional, Sequence, Union

import numpy as np
import torch

from tilegrad import _arrays, _core, _rotation
from tilegrad._autograd import first_derivative_only
from tilegrad._camera import Camera
from tilegrad._dense import check_dense, full_precision
from tilegrad._packed import Packed
from tilegrad._renderer import Frame, Gradients
from tilegrad._renderer import Renderer as _Engine
from tilegrad._scene import Light, Scene, Surface, Texture
from tilegrad._threads import thread_count

Array = Any  # whatever tilegrad takes as an array
Value = Any  # a tensor, a number, or a nested sequence of numbers

# Of several numbers each.
_RECORDS: dict[str, type[Packed]] = {"camera": Camera, "lights": Light, "surfaces": Surface}
_INDICES = ("faces", "face_surfaces")  # a Scene takes their tensors as they are
_CONSTANT = ("barycentrics", "face_ids")  # images without a gradient


class Images(NamedTuple):
    """What a render gives, as `tilegrad.Frame` has it; None for what was not asked for. Their
    memory is the renderer's: a change in place before backward is an error that torch finds."""

    color: Optional[torch.Tensor] = None
    alpha: Optional[torch.Tensor] = None
    attributes: Optional[torch.Tensor] = None
    depth: Optional[torch.Tensor] = None
    normals: Optional[torch.Tensor] = None
    uv: Optional[torch.Tensor] = None
    barycentrics: Optional[torch.Tensor] = None
    face_ids: Optional[torch.Tensor] = None


@full_precision
def render(positions: Union[torch.Tensor, Sequence[torch.Tensor]], faces: Array, camera: Any, *,
           width: int, height: int, outputs: Sequence[str] = ("color", "alpha"),
           threads: int = 0, surface_textures: Sequence[int] = (), **arguments: Any) -> Images:
    """Images (N, ...) of a scene, of a batch of N, or of a list of meshes behind each other.

    positions: (V, 3) or (N, V, 3); its dtype is that of the images, to which other tensors are
        converted. faces: (F, 3) whole numbers.
    camera: a Camera, or a tensor ([N,] 17) of `camera`. Images of another size than a Camera is
        for are an error; the numbers in a tensor are for an image of width and height.
    width, height, outputs: as of `tilegrad.Renderer.render`; face_ids are always there.
    threads: as of `tilegrad.Renderer`; 0: what TILEGRAD_THREADS says, or as many as torch uses:
        one in a worker of a DataLoader.
    surface_textures: the texture of each surface, -1: none, where `surfaces` is a tensor.
    arguments: those of `tilegrad.Scene` (colors, uvs, textures, surfaces, lights, lighting, sh,
        attributes, ...), each array also as a tensor, Texture with texels in a tensor, lights a
        tensor ([N,] L, 4) of `lights`, surfaces a tensor (S, 13) of `surfaces`; and options of
        `tilegrad.Renderer.render` (delta, max_alpha_error, culling, ...).

    Different meshes in one call: positions are a list of (V, 3) or (N, V, 3). Every other argument
    that is a list (faces, camera, colors, ...) has one for each of them, too; what is no list, but
    a tensor, a tuple, a number, is for all. They must be alike: what one has, all have.

    In torch.autocast tensors of bfloat16 are rendered in float32; elsewhere they are an error.

    Errors: TypeError for tensors that are not on the CPU; what Scene and Renderer raise.
    """
    outputs = (outputs,) if isinstance(outputs, str) else tuple(outputs)
    scene = {"positions": positions, "faces": faces, "camera": camera,
             "surface_textures": surface_textures}
    options = {"width": width, "height": height, "outputs": outputs}
    for name, value in arguments.items():
        (options if name in _OPTIONS else scene)[name] = value
    call = _Call(_each(scene), options, threads)
    images = _Render.apply(call, *call.tensors)
    return Images(**dict(zip((*outputs, "face_ids"), images)))


class Renderer(torch.nn.Module):
    """`render` with options that stay the same, to put into a model.

    width, height: pixels. Further arguments: those of `render` that hold for every call.
    """

    def __init__(self, width: int, height: int, **arguments: Any) -> None:
        super().__init__()
        self.arguments: dict[str, Any] = {"width": width, "height": height, **arguments}

    def forward(self, positions: torch.Tensor, faces: Array, camera: Union[Camera, torch.Tensor],
                **arguments: Any) -> Images:
        """Images of a scene; further arguments as of `render`, before those of the renderer."""
        return render(positions, faces, camera, **{**self.arguments, **arguments})

    def extra_repr(self) -> str:
        return ", ".join(f"{name}={value!r}" for name, value in self.arguments.items())


@full_precision
def camera(rotation: Value = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
           translation: Value = (0.0, 0.0, 0.0), fx: Value = _core.CAMERA[12],
           fy: Value = _core.CAMERA[13], cx: Value = _core.CAMERA[14],
           cy: Value = _core.CAMERA[15], near_plane: Value = _core.CAMERA[16]) -> torch.Tensor:
    """A camera of tensors, ([N,] 17), through which gradients go back to each of them.

    rotation: ([N,] 3, 3), for example of `rotation_6d`; translation: ([N,] 3); fx, fy, cx, cy:
    numbers or (N,). Meanings as of `tilegrad.Camera`. Numbers may stand for tensors.
    """
    return _packed(rotation=(rotation, (3, 3)), translation=(translation, (3,)), fx=(fx, ()),
                   fy=(fy, ()), cx=(cx, ()), cy=(cy, ()), near_plane=(near_plane, ()))


@full_precision
def lights(direction: Value, intensity: Value = 1.0) -> torch.Tensor:
    """Directional lights of tensors, ([N,] L, 4): direction ([N,] L, 3), from the surface to the
    light, world, not 0; intensity ([N,] L) or a number."""
    return _packed(direction=(direction, (3,)), intensity=(intensity, ()))


@full_precision
def surfaces(base_color: Value = (1.0, 1.0, 1.0), ambient: Value = (0.0, 0.0, 0.0),
             diffuse: Value = (1.0, 1.0, 1.0), specular: Value = (0.4, 0.4, 0.4),
             shininess: Value = 10.0) -> torch.Tensor:
    """Surfaces of tensors, (S, 13): (S, 3) each and shininess (S,), as of `tilegrad.Surface`;
    numbers and arrays without the axis S are shared by all."""
    numbers = _packed(base_color=(base_color, (3,)), ambient=(ambient, (3,)),
                      diffuse=(diffuse, (3,)), specular=(specular, (3,)),
                      shininess=(shininess, ()))
    return numbers if numbers.ndim == 2 else numbers[None]


rotation_6d = _rotation.rotation_6d

_OPTIONS = frozenset(("delta", "max_alpha_error", "interpolation", "culling", "alpha_rule",
                      "paper_box", "paper_faces"))


class _Place(NamedTuple):
    """Where a tensor stands: in which scene, in which argument, and of textures in which."""

    scene: int
    name: str
    texture: int = 0


class _Call:
    """A render: its tensors, and all the rest with places for them."""

    def __init__(self, scenes: Sequence[dict[str, Any]], options: dict[str, Any],
                 threads: int) -> None:
        for name, value in options.items():
            if isinstance(value, torch.Tensor) and value.requires_grad:
                raise ValueError(f"render: {name} has no gradient; give {name}.item()")
        self.options, self.threads = options, thread_count("render", threads)
        self.scenes = [_with_textures(scene) for scene in scenes]
        self.surface_textures = [_surface_textures(scene) for scene in self.scenes]
        self.places: list[_Place] = []
        self.tensors: list[torch.Tensor] = []
        for i, scene in enumerate(self.scenes):
            for k, texture in enumerate(scene.get("textures") or ()):
                self._note(_Place(i, "textures", k), texture.texels)
            for name, value in scene.items():
                self._note(_Place(i, name), value)

    def _note(self, place: _Place, value: Any) -> None:
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
        """Renders, with the memory of the tensors where the renderer can take it as it is."""
        scenes = [dict(scene) for scene in self.scenes]
        for scene in scenes:
            if scene.get("textures") is not None:
                scene["textures"] = list(scene["textures"])
        for place, tensor in zip(self.places, tensors):
            if place.name not in _INDICES:
                self._put(scenes[place.scene], place, tensor.detach().resolve_neg().numpy())
        return self._engine().render([Scene(**scene) for scene in scenes], **self.options)

    def _put(self, scene: dict[str, Any], place: _Place, array: np.ndarray) -> None:
        name = place.name
        if name == "textures":
            old = scene[name][place.texture]
            scene[name][place.texture] = Texture(array, old.wrap, old.filter)
        elif name in _RECORDS:
            scene[name] = self._record(place, array)
        else:
            scene[name] = array

    def _record(self, place: _Place, array: np.ndarray) -> Packed:
        """The numbers of a camera, of lights or of surfaces as those."""
        kind = _RECORDS[place.name]
        if array.ndim < 1 or array.shape[-1] != kind._SIZE:
            raise ValueError(f"render: {place.name} has shape {array.shape}, expected "
                             f"{_arrays.shape_text(('...', kind._SIZE))}")
        record = kind.of_numbers(array)
        if isinstance(record, Surface):
            record.texture = self.surface_textures[place.scene]
        return record

    def gradients(self, frame: Frame, wanted: Sequence[bool],
                  cotangents: dict[str, Any]) -> list[Optional[torch.Tensor]]:
        """dL/d(tensor) in the order of the tensors; None for those that are not wanted."""
        names = tuple(dict.fromkeys(place.name for place, want in zip(self.places, wanted) if want))
        found = self._engine().backward(frame, wrt=names, **cotangents)
        return [self._gradient(found[place.scene], place) if want else None
                for place, want in zip(self.places, wanted)]

    @staticmethod
    def _gradient(found: Gradients, place: _Place) -> torch.Tensor:
        value = getattr(found, place.name)
        if place.name == "textures":
            value = value[place.texture]
        return torch.from_numpy(value.numbers if place.name in _RECORDS else value)

    def _engine(self) -> _Engine:
        return _engine(self.threads or torch.get_num_threads())


def _each(arguments: dict[str, Any]) -> list[dict[str, Any]]:
    """The arguments of each mesh, where positions are a list of them."""
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
    """Whether it is a list, of something else than numbers and names."""
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
    """Takes them out of the arguments, as Surface has them: one -1 for all surfaces if there are
    none."""
    given = arguments.pop("surface_textures")
    indices = _arrays.contiguous("render", "surface_textures", given, np.int32)
    if not indices.size:
        return np.array(-1, np.int32)
    if not isinstance(arguments.get("surfaces"), torch.Tensor):
        raise ValueError("render: surface_textures belong to surfaces in a tensor; a Surface "
                         "has its own texture")
    return indices


class _Render(torch.autograd.Function):
    """Each call has its own frame, so that renders may follow each other before backward."""

    @staticmethod
    def forward(ctx: Any, call: _Call,  # type: ignore[override]
                *tensors: torch.Tensor) -> tuple[torch.Tensor, ...]:
        frame = call.frame(tensors)
        images = tuple(torch.from_numpy(frame.shared(name)) for name in frame.outputs)
        face_ids = torch.from_numpy(frame.face_ids.copy())
        ctx.mark_non_differentiable(face_ids, *(image for name, image in zip(frame.outputs, images)
                                                if name in _CONSTANT))
        ctx.set_materialize_grads(False)
        # Backward reads all of them: torch sees to it that nobody has changed one.
        ctx.save_for_backward(*tensors, *images)
        ctx.call, ctx.frame = call, frame
        return (*images, face_ids)

    @staticmethod
    @first_derivative_only
    def backward(ctx: Any, *d_images: Optional[torch.Tensor]) -> tuple[Any, ...]:
        tensors = ctx.saved_tensors
        wanted = ctx.needs_input_grad[1:]
        cotangents = {name: d_image.resolve_neg().numpy()
                      for name, d_image in zip(ctx.frame.outputs, d_images)
                      if d_image is not None and name not in _CONSTANT}
        if not cotangents or not any(wanted):
            return (None,) * len(ctx.needs_input_grad)
        gradients = ctx.call.gradients(ctx.frame, wanted, cotangents)
        return (None, *(None if gradient is None else gradient.reshape_as(tensor).to(tensor.dtype)
                        for gradient, tensor in zip(gradients, tensors)))


@functools.lru_cache(maxsize=None)
def _engine(threads: int) -> _Engine:
    """One for each number of threads; a renderer serves any thread and any process."""
    return _Engine(threads)


def _packed(**parts: tuple[Value, tuple[int, ...]]) -> torch.Tensor:
    """The parts of records behind each other, their leading axes broadcast. In the dtype of their
    tensors; numbers alone are kept in float64, as Camera keeps them, until a scene rounds them."""
    given = [value.dtype for value, _ in parts.values()
             if isinstance(value, torch.Tensor) and value.is_floating_point()]
    dtype = functools.reduce(torch.promote_types, given,
                             torch.float32 if given else torch.float64)
    flat = []
    lead = torch.Size()
    for name, (value, shape) in parts.items():
        if isinstance(value, torch.Tensor):
            check_dense("tilegrad.torch", name, value)
        try:
            tensor = torch.as_tensor(value, dtype=dtype)
        except (TypeError, ValueError, RuntimeError, OverflowError):
            raise TypeError(f"{name} is {value!r}, expected a tensor or numbers") from None
        split = tensor.ndim - len(shape)
        if split < 0 or tensor.shape[split:] != shape:
            raise ValueError(f"{name} has shape {tuple(tensor.shape)}, expected "
                             f"{_arrays.shape_text(('...', *shape))}")
        try:
            lead = torch.broadcast_shapes(lead, tensor.shape[:split])
        except RuntimeError:
            raise ValueError(f"{name} has shape {tuple(tensor.shape)}, expected "
                             f"{tuple((*lead, *shape))}, as the arguments before it have it, or "
                             f"leading axes that broadcast with that") from None
        flat.append(tensor.reshape(*tensor.shape[:split], math.prod(shape)))
    return torch.cat([tensor.expand(*lead, -1) for tensor in flat], dim=-1)
