# SPDX-License-Identifier: Apache-2.0
"""The renderer as a differentiable function of PyTorch tensors, over shared memory.

    positions = torch.tensor(mesh.positions, requires_grad=True)
    images = tilegrad.torch.render(positions, mesh.faces, camera, width=64, height=64)
    (images.alpha - target).square().mean().backward()          # positions.grad

float32 tensors are rendered by the engine, float64 ones by the scalar reference in double
precision, which is for `torch.autograd.gradcheck`. Tensors are on the CPU. Any tensor of a scene
may require a gradient; others are not computed. First derivatives only.
"""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple, Optional, Sequence, Union

import torch

from tilegrad import _arrays, _core
from tilegrad._dense import check_dense, first_derivative_only, full_precision
from tilegrad._camera import Camera
from tilegrad._renderer import PASSED_ON
from tilegrad._torch_call import Call, scenes_of

Array = Any  # whatever tilegrad takes as an array
Value = Any  # a tensor, a number, or a nested sequence of numbers

_CONSTANT = ("barycentrics", "face_ids")  # images without a gradient


class Images(NamedTuple):
    """The images of a render, as in `tilegrad.Frame`; None if not requested. Their memory is the
    renderer's; torch reports an in-place change before backward as an error."""

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
    """Images (N, ...) of a scene, of a batch of N, or of a list of meshes one after the other.

    positions: (V, 3) or (N, V, 3); its dtype is that of the images, to which other tensors are
        converted. faces: (F, 3) whole numbers.
    camera: a Camera, or a tensor ([N,] 17) of `camera`. A size other than the Camera's is an error;
        the numbers in a tensor are for an image of width and height.
    width, height, outputs: as in `tilegrad.Renderer.render`; face_ids are always computed.
    threads: as in `tilegrad.Renderer`; 0: TILEGRAD_THREADS, or as many as torch uses: one in a
        worker of a DataLoader.
    surface_textures: the texture of each surface, -1: none, if `surfaces` is a tensor.
    arguments: those of `tilegrad.Scene` (colors, uvs, textures, surfaces, lights, lighting, sh,
        attributes, ...), each array also as a tensor, Texture with texels in a tensor, lights a
        tensor ([N,] L, 4) of `lights`, surfaces a tensor (S, 13) of `surfaces`; and options of
        `tilegrad.Renderer.render` (delta, max_alpha_error, culling, ...).

    Different meshes in one call: positions are a list of (V, 3) or (N, V, 3). Every other argument
    that is a list (faces, camera, colors, ...) has one item for each of them, too; a tensor, a
    tuple or a number is for all. All meshes must have the same arguments.

    Under torch.autocast tensors of bfloat16 are rendered in float32; elsewhere they are an error.

    Errors: TypeError for tensors that are not on the CPU; those of Scene and Renderer.
    """
    outputs = (outputs,) if isinstance(outputs, str) else tuple(outputs)
    scene = {"positions": positions, "faces": faces, "camera": camera,
             "surface_textures": surface_textures}
    options = {"width": width, "height": height, "outputs": outputs}
    for name, value in arguments.items():
        (options if name in PASSED_ON else scene)[name] = value
    call = Call(scenes_of(scene), options, threads)
    images = _Render.apply(call, *call.tensors)
    return Images(**dict(zip((*outputs, "face_ids"), images)))


class Renderer(torch.nn.Module):
    """`render` as a module with fixed options, for use in a model.

    width, height: pixels. Further arguments: those of `render` that hold for every call.
    """

    def __init__(self, width: int, height: int, **arguments: Any) -> None:
        super().__init__()
        self.arguments: dict[str, Any] = {"width": width, "height": height, **arguments}

    def forward(self, positions: torch.Tensor, faces: Array, camera: Union[Camera, torch.Tensor],
                **arguments: Any) -> Images:
        """Images of a scene; further arguments as in `render`, which override the renderer's."""
        return render(positions, faces, camera, **{**self.arguments, **arguments})

    def extra_repr(self) -> str:
        return ", ".join(f"{name}={value!r}" for name, value in self.arguments.items())


@full_precision
def camera(rotation: Value = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
           translation: Value = (0.0, 0.0, 0.0), fx: Value = _core.CAMERA[12],
           fy: Value = _core.CAMERA[13], cx: Value = _core.CAMERA[14],
           cy: Value = _core.CAMERA[15], near_plane: Value = _core.CAMERA[16]) -> torch.Tensor:
    """A camera from tensors, ([N,] 17), differentiable with respect to each of them; the gradient
    of near_plane is 0, since it only says where faces are cut.

    rotation: ([N,] 3, 3), for example from `rotation_6d`; translation: ([N,] 3); fx, fy, cx, cy:
    numbers or (N,). Meanings as in `tilegrad.Camera`. Numbers may replace tensors.
    """
    return _packed(rotation=(rotation, (3, 3)), translation=(translation, (3,)), fx=(fx, ()),
                   fy=(fy, ()), cx=(cx, ()), cy=(cy, ()), near_plane=(near_plane, ()))


@full_precision
def lights(direction: Value, intensity: Value = 1.0) -> torch.Tensor:
    """Directional lights from tensors, ([N,] L, 4): direction ([N,] L, 3), from the surface to the
    light, world, not 0; intensity ([N,] L) or a number."""
    return _packed(direction=(direction, (3,)), intensity=(intensity, ()))


@full_precision
def surfaces(base_color: Value = (1.0, 1.0, 1.0), ambient: Value = (0.0, 0.0, 0.0),
             diffuse: Value = (1.0, 1.0, 1.0), specular: Value = (0.4, 0.4, 0.4),
             shininess: Value = 10.0) -> torch.Tensor:
    """Surfaces from tensors, (S, 13): (S, 3) each and shininess (S,), as in `tilegrad.Surface`;
    numbers and arrays without the axis S are shared by all."""
    numbers = _packed(base_color=(base_color, (3,)), ambient=(ambient, (3,)),
                      diffuse=(diffuse, (3,)), specular=(specular, (3,)),
                      shininess=(shininess, ()))
    return numbers if numbers.ndim == 2 else numbers[None]



class _Render(torch.autograd.Function):
    """Each call has its own frame, so that several renders may precede backward."""

    @staticmethod
    def forward(ctx: Any, call: Call,  # type: ignore[override]
                *tensors: torch.Tensor) -> tuple[torch.Tensor, ...]:
        frame = call.frame(tensors)
        images = tuple(torch.from_numpy(frame.shared(name)) for name in frame.outputs)
        face_ids = torch.from_numpy(frame.face_ids.copy())
        ctx.mark_non_differentiable(face_ids, *(image for name, image in zip(frame.outputs, images)
                                                if name in _CONSTANT))
        ctx.set_materialize_grads(False)
        # Backward reads all of them; torch checks that none has changed.
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


def _packed(**parts: tuple[Value, tuple[int, ...]]) -> torch.Tensor:
    """The parts of records, concatenated, with broadcast leading axes. In the dtype of their
    tensors; numbers alone are kept in float64, as in Camera, until a scene rounds them."""
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


def _scaled(vectors: torch.Tensor) -> torch.Tensor:
    """With a largest number of 1, so that no length overflows or vanishes; 0 stays."""
    largest = vectors.detach().abs().amax(dim=-1, keepdim=True)
    return vectors / largest.masked_fill(largest == 0, 1)


@full_precision
def rotation_6d(numbers: torch.Tensor) -> torch.Tensor:
    """Rotations (..., 3, 3) from six unconstrained numbers (..., 6): their first two rows, made
    orthonormal (Y. Zhou et al.: On the continuity of rotation representations in neural networks,
    2019).

    TypeError if they are not real numbers, ValueError if they are not six or not finite, or where
    the first three are 0 or the last three parallel to them.
    """
    if not isinstance(numbers, torch.Tensor) or numbers.dtype not in (torch.float32, torch.float64):
        kind = getattr(numbers, "dtype", type(numbers).__name__)
        raise TypeError(f"rotation_6d: numbers have dtype {kind}, expected torch.float32 or "
                        f"torch.float64")
    check_dense("rotation_6d", "numbers", numbers)
    if numbers.ndim < 1 or numbers.shape[-1] != 6:
        raise ValueError(f"rotation_6d: numbers have shape {tuple(numbers.shape)}, expected "
                         f"(..., 6)")
    if not torch.isfinite(numbers).all():
        raise ValueError("rotation_6d: numbers has values that are not finite")
    first, second = _scaled(numbers[..., :3]), _scaled(numbers[..., 3:])
    x = torch.nn.functional.normalize(first, dim=-1)
    across = second - (x * second).sum(-1, keepdim=True) * x
    y = torch.nn.functional.normalize(across, dim=-1)
    z = torch.cross(x, y, dim=-1)
    with torch.no_grad():
        rounding = 8 * torch.finfo(numbers.dtype).eps * second.norm(dim=-1)
        if not ((z.norm(dim=-1) > 0.5) & (across.norm(dim=-1) > rounding)).all():
            raise ValueError("rotation_6d: of six numbers the first three are 0, or the last "
                             "three parallel to them")
    return torch.stack([x, y, z], dim=-2)
