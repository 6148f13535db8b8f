# SPDX-License-Identifier: Apache-2.0
"""Losses of meshes and silhouettes with their gradients, as training and fitting compute them.

    value, gradient = losses.edge_length(positions, faces)          # NumPy
    losses.edge_length(positions, faces).backward()                 # torch tensors, if one is given

Real numbers are float32 unless an array of float64 is given. Gradients are with respect to the
first argument, for `chamfer` to both. Numbers that are not finite are errors.
"""

from __future__ import annotations

import sys
from typing import Any, Callable, NamedTuple, Optional

import numpy as np

from tilegrad import _arrays, _tools
from tilegrad._arrays import thread_count


class Loss(NamedTuple):
    """A loss of arrays: its value, and the gradient, of the shape of the first argument."""

    value: float
    gradient: np.ndarray


class PairLoss(NamedTuple):
    """A loss of two arrays: its value, and the gradients with respect to both."""

    value: float
    gradient_a: np.ndarray
    gradient_b: np.ndarray


def edge_length(positions: Any, faces: Any) -> Any:
    """Inequality of edge lengths: n sum l^2 / (sum l)^2 - 1, 0 where all are equal; independent of the
    mesh's size. positions: (V, 3). faces: (F, 3) whole numbers."""
    return _of_mesh("edge_length", positions, faces)


def normal_consistency(positions: Any, faces: Any) -> Any:
    """The sum over edges of (cos(n1, n2) - 1)^2 with the unit normals of the two faces. Boundary
    edges do not count. Arguments as in `edge_length`."""
    return _of_mesh("normal_consistency", positions, faces)


def laplacian(positions: Any, faces: Any, start: Optional[Any] = None) -> Any:
    """The sum over vertices of |mean of the neighbours - vertex|^2, with uniform weights.

    start: (V, 3): applies it to the movement positions - start, as in section 4.1 of the DIB-R
        paper.
    """
    if start is not None:
        positions = _movement(positions, start)
    return _of_mesh("laplacian", positions, faces)


def iou(alpha: Any, truth: Any) -> Any:
    """Equation 12: the mean over images of 1 - |S S'|_1 / |S + S' - S S'|_1. alpha, truth: (N, H, W)
    or (H, W), 0 to 1. The gradient is with respect to alpha. ValueError: a number beyond that."""
    def compute(a: np.ndarray, s: np.ndarray) -> tuple[float, np.ndarray]:
        if a.shape != s.shape or a.ndim not in (2, 3):
            raise ValueError(f"iou: alpha has shape {a.shape}, truth {s.shape}; expected the same, "
                             f"(N, H, W) or (H, W)")
        _check_unit("alpha", a)
        _check_unit("truth", s)
        images = 1 if a.ndim == 2 else len(a)
        rows = (images, a.size // max(images, 1))
        value, gradient = _tools.iou(a.reshape(rows), s.reshape(rows))
        return value, gradient.reshape(a.shape)

    if _torch_of(alpha):
        return _on_tape("iou", lambda a: compute(a, _constant("iou", "truth", truth, a.dtype)),
                        alpha=alpha)
    a = _floats("iou", "alpha", alpha)
    return Loss(*compute(a, _constant("iou", "truth", truth, a.dtype)))


def _check_unit(argument: str, values: np.ndarray) -> None:
    """ValueError unless all values of a mask are in [0, 1]."""
    if not ((values >= 0) & (values <= 1)).all():
        raise ValueError(f"iou: {argument} has numbers outside of [0, 1]; divide bytes by 255")


def chamfer(a: Any, b: Any, *, threads: int = 0) -> Any:
    """The mean squared distance of a's points to the nearest of b, plus the same the other way.
    a: (N, 3). b: (M, 3), of the same dtype. The nearest points are found by the k-d tree that scores
    predictions. Returns value and both gradients; for tensors a scalar."""
    count = thread_count("chamfer", threads)
    if _torch_of(a, b):
        return _on_tape("chamfer", lambda p, q: _chamfer(p, q, count), a=a, b=b)
    p = _floats("chamfer", "a", a)
    return PairLoss(*_chamfer(p, _constant("chamfer", "b", b, p.dtype), count))


def _chamfer(a: np.ndarray, b: np.ndarray, threads: int
             ) -> tuple[float, np.ndarray, np.ndarray]:
    for name, points in (("a", a), ("b", b)):
        _arrays.check_shape("chamfer", name, points.shape, ("N" if name == "a" else "M", 3))
        if not len(points):
            raise ValueError(f"chamfer: {name} has no points")
        _arrays.check_finite("chamfer", name, points)
    value, gradients = 0.0, [np.zeros_like(a), np.zeros_like(b)]
    for p, q, d_p, d_q in ((a, b, *gradients), (b, a, *reversed(gradients))):
        nearest = _tools.nearest_points(p[None], q[None], threads)[0]
        gap = p - q[nearest]
        value += float(np.square(gap, dtype=np.float64).sum() / len(p))
        d_p += 2 / len(p) * gap
        np.subtract.at(d_q, nearest, 2 / len(p) * gap)
    return _in_range("chamfer", "a or b", (value, *gradients))


def _of_mesh(name: str, positions: Any, faces: Any) -> Any:
    triangles = _arrays.as_indices(name, "faces", faces, ("F", 3))

    def compute(p: np.ndarray) -> tuple:
        return _in_range(name, "positions", getattr(_tools, name)(p, triangles))

    if _torch_of(positions):
        return _on_tape(name, compute, positions=positions)
    return Loss(*compute(_floats(name, "positions", positions)))


def _in_range(name: str, arguments: str, found: tuple) -> tuple:
    """`found`, a value and its gradients; ValueError if they overflowed."""
    if not all(np.isfinite(part).all() for part in found):
        raise ValueError(f"{name}: {arguments} has numbers so large that the loss overflows")
    return found


def _floats(function: str, argument: str, value: Any) -> np.ndarray:
    return _arrays.contiguous(function, argument, value,
                              _arrays.float_dtype(function, argument, value))


def _torch_of(*values: Any) -> Any:
    """torch, if one of the values is a tensor; it is never imported here."""
    torch = sys.modules.get("torch")
    return torch if torch and any(isinstance(value, torch.Tensor) for value in values) else None


def _constant(function: str, argument: str, value: Any, dtype: Any) -> np.ndarray:
    """As an array of `dtype`, without its gradient; masks may be bool."""
    torch = _torch_of(value)
    if torch:
        value = value.detach().byte() if value.dtype == torch.bool else value.detach()
    array = _arrays.foreign(function, argument, value)
    return _arrays.contiguous(function, argument,
                              array.astype(dtype) if array.dtype == bool else array, dtype)


def _movement(positions: Any, start: Any) -> Any:
    """positions - start, (V, 3) each."""
    torch = _torch_of(positions, start)
    ends = {"positions": positions, "start": start}
    if torch:
        ends = _tensors("laplacian", ends)
    else:
        ends = {name: _floats("laplacian", name, value) for name, value in ends.items()}
    sizes: dict[str, int] = {}
    for name, value in ends.items():
        _arrays.check_shape("laplacian", name, value.shape, ("V", 3), sizes)
    return ends["positions"] - ends["start"]


def _tensors(function: str, values: dict[str, Any]) -> dict[str, Any]:
    """Tensors of float32 or float64 on the CPU; arrays get the dtype of the first tensor."""
    from tilegrad._dense import widened
    from tilegrad.compat._tensors import check_floats
    torch = _torch_of(*values.values())
    like = next(value for value in values.values() if isinstance(value, torch.Tensor))
    found = {}
    for name, value in values.items():
        if not isinstance(value, torch.Tensor):
            value = torch.as_tensor(_floats(function, name, value), dtype=like.dtype)
        found[name] = widened(value)
        check_floats(function, name, found[name], tuple(value.shape))
    return found


def _on_tape(function: str, compute: Callable[..., tuple], **inputs: Any) -> Any:
    """The value as a scalar tensor whose backward gives the gradients. First derivatives only."""
    from tilegrad._dense import first_derivative_only
    torch = _torch_of(*inputs.values())
    tensors = list(_tensors(function, inputs).values())
    if len({tensor.dtype for tensor in tensors}) > 1:
        raise TypeError(f"{function}: {' and '.join(inputs)} have dtypes "
                        f"{' and '.join(str(tensor.dtype) for tensor in tensors)}, expected one")

    class Node(torch.autograd.Function):
        @staticmethod
        def forward(context, *values):
            context.save_for_backward(*values)
            value, *gradients = compute(*(np.ascontiguousarray(v.detach().numpy())
                                          for v in values))
            context.gradients = [torch.from_numpy(gradient) for gradient in gradients]
            return values[0].new_tensor(value)

        @staticmethod
        @first_derivative_only
        def backward(context, scale):
            return tuple(scale * gradient for gradient in context.gradients)

    return Node.apply(*tensors)
