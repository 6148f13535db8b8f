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
        positions = positions - _like(positions, start)
    return _of_mesh("laplacian", positions, faces)


def iou(alpha: Any, truth: Any) -> Any:
    """Equation 12: the mean over images of 1 - |S S'|_1 / |S + S' - S S'|_1. alpha, truth: (N, H, W)
    or (H, W), 0 to 1. The gradient is with respect to alpha."""
    def compute(a: np.ndarray, s: np.ndarray) -> tuple[float, np.ndarray]:
        if a.shape != s.shape or a.ndim not in (2, 3):
            raise ValueError(f"iou: alpha has shape {a.shape}, truth {s.shape}; expected the same, "
                             f"(N, H, W) or (H, W)")
        images = 1 if a.ndim == 2 else len(a)
        rows = (images, a.size // max(images, 1))
        value, gradient = _tools.iou(a.reshape(rows), s.reshape(rows))
        return value, gradient.reshape(a.shape)

    if _torch_of(alpha):
        return _on_tape(lambda a: compute(a, np.ascontiguousarray(_numpy(truth), a.dtype)), alpha)
    a = _floats("iou", "alpha", alpha)
    return Loss(*compute(a, np.ascontiguousarray(_numpy(truth), a.dtype)))


def chamfer(a: Any, b: Any, *, threads: int = 0) -> Any:
    """The mean squared distance of a's points to the nearest of b, plus the same the other way.
    a: (N, 3). b: (M, 3), of the same dtype. The nearest points are found by the k-d tree that scores
    predictions. Returns value and both gradients; for tensors a scalar."""
    count = thread_count("chamfer", threads)
    if _torch_of(a, b):
        return _on_tape(lambda p, q: _chamfer(p, q, count), a, b)
    p = _floats("chamfer", "a", a)
    return PairLoss(*_chamfer(p, np.ascontiguousarray(_numpy(b), p.dtype), count))


def _chamfer(a: np.ndarray, b: np.ndarray, threads: int
             ) -> tuple[float, np.ndarray, np.ndarray]:
    for name, points in (("a", a), ("b", b)):
        _arrays.check_shape("chamfer", name, points.shape, ("N" if name == "a" else "M", 3))
        if not len(points):
            raise ValueError(f"chamfer: {name} has no points")
    value, gradients = 0.0, [np.zeros_like(a), np.zeros_like(b)]
    for p, q, d_p, d_q in ((a, b, *gradients), (b, a, *reversed(gradients))):
        nearest = _tools.nearest_points(p[None], q[None], threads)[0]
        gap = p - q[nearest]
        value += float(np.square(gap, dtype=np.float64).sum() / len(p))
        d_p += 2 / len(p) * gap
        np.subtract.at(d_q, nearest, 2 / len(p) * gap)
    return value, gradients[0], gradients[1]


def _of_mesh(name: str, positions: Any, faces: Any) -> Any:
    if _numpy(faces).dtype.kind not in "iu":
        raise TypeError(f"{name}: faces has dtype {_numpy(faces).dtype}, expected whole numbers")
    triangles = _arrays.as_indices(name, "faces", faces, ("F", 3))
    compute = getattr(_tools, name)
    if _torch_of(positions):
        return _on_tape(lambda p: compute(p, triangles), positions)
    return Loss(*compute(_floats(name, "positions", positions), triangles))


def _floats(function: str, argument: str, value: Any) -> np.ndarray:
    return _arrays.contiguous(function, argument, value,
                              _arrays.float_dtype(function, argument, value))


def _torch_of(*values: Any) -> Any:
    """torch, if one of the values is a tensor; it is never imported here."""
    torch = sys.modules.get("torch")
    return torch if torch and any(isinstance(value, torch.Tensor) for value in values) else None


def _numpy(value: Any) -> np.ndarray:
    return value.detach().cpu().numpy() if _torch_of(value) else np.asarray(value)


def _like(tensor: Any, value: Any) -> Any:
    torch = _torch_of(tensor)
    if not torch or isinstance(value, torch.Tensor):
        return value if torch else np.asarray(value)
    return torch.as_tensor(np.ascontiguousarray(value), dtype=tensor.dtype)


def _on_tape(compute: Callable[..., tuple], *inputs: Any) -> Any:
    """The value as a scalar tensor whose backward gives the gradients. First derivatives only."""
    from tilegrad._dense import first_derivative_only, widened
    torch = _torch_of(*inputs)
    tensors = [widened(torch.as_tensor(value)) for value in inputs]

    class Node(torch.autograd.Function):
        @staticmethod
        def forward(context, *values):
            context.save_for_backward(*values)
            if any(value.device.type != "cpu" for value in values):
                raise TypeError("tilegrad.losses: tensors must be on the CPU")
            value, *gradients = compute(*(np.ascontiguousarray(v.detach().numpy())
                                          for v in values))
            context.gradients = [torch.from_numpy(gradient) for gradient in gradients]
            return values[0].new_tensor(value)

        @staticmethod
        @first_derivative_only
        def backward(context, scale):
            return tuple(scale * gradient for gradient in context.gradients)

    return Node.apply(*tensors)
