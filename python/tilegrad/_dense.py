# SPDX-License-Identifier: Apache-2.0
"""Dense, real PyTorch tensors on the CPU, in full precision."""

from __future__ import annotations

import functools
from typing import Any, Callable, Optional, TypeVar

import torch

from tilegrad._scene import Texture

Function = TypeVar("Function", bound=Callable[..., Any])

_HALVES = (torch.bfloat16, torch.float16)


def check_dense(function: str, argument: str, tensor: torch.Tensor) -> None:
    """TypeError for a tensor on another device, and for a sparse, quantized or complex one."""
    if tensor.device.type != "cpu":
        raise TypeError(f"{function}: {argument} is on {tensor.device}; tilegrad renders on the "
                        f"CPU: give {argument}.cpu()")
    if tensor.is_complex():
        raise TypeError(f"{function}: {argument} has dtype {tensor.dtype}, expected real numbers")
    if tensor.layout == torch.strided and not tensor.is_quantized:
        return
    kind, cure = ("quantized", "dequantize") if tensor.is_quantized else ("sparse", "to_dense")
    raise TypeError(f"{function}: {argument} is {kind}, expected a dense tensor: give "
                    f"{argument}.{cure}()")


def full_precision(function: Function) -> Function:
    """Makes a function ignore torch.autocast: half-precision tensors, alone or in lists, become
    float32. bfloat16 has eight binary digits; a position in an image of 512 pixels needs nine."""
    @functools.wraps(function)
    def full(*arguments: Any, **named: Any) -> Any:
        if not _in_autocast():
            return function(*arguments, **named)
        with torch.autocast("cpu", enabled=False):
            return function(*map(_widened, arguments),
                            **{name: _widened(value) for name, value in named.items()})

    return full  # type: ignore[return-value]


def widened(tensor: torch.Tensor) -> torch.Tensor:
    """Under torch.autocast as float32, differentiably; elsewhere unchanged."""
    return _widened(tensor) if _in_autocast() else tensor


def _widened(value: Any) -> Any:
    """With float32 for all bfloat16 and float16 in it."""
    if isinstance(value, torch.Tensor):
        return value.float() if value.dtype in _HALVES and value.device.type == "cpu" else value
    if isinstance(value, Texture):
        return Texture(_widened(value.texels), value.wrap, value.filter)
    return type(value)(map(_widened, value)) if type(value) in (list, tuple) else value


def _in_autocast() -> bool:
    try:
        return torch.is_autocast_enabled("cpu")  # type: ignore[call-arg]
    except TypeError:  # before torch 2.4
        return torch.is_autocast_cpu_enabled()


Gradients = tuple[Optional[torch.Tensor], ...]


def first_derivative_only(backward: Callable[..., Any]) -> Callable[..., Any]:
    """For the `backward` of an autograd.Function that saved its inputs: differentiating the
    gradients again raises a RuntimeError.

    torch's once_differentiable raises where backward() passes. Functions that ask for gradients of
    some inputs (functional.jvp, functional.hessian) do not find its node, and return 0.
    """
    @functools.wraps(backward)
    def refusing(ctx: Any, *d_outputs: Optional[torch.Tensor]) -> Any:
        with torch.no_grad():
            gradients = backward(ctx, *d_outputs)
        if not torch.is_grad_enabled():
            return gradients
        if isinstance(gradients, torch.Tensor):
            gradients = (gradients,)
        return _tied(gradients, (*ctx.saved_tensors, *d_outputs))

    return refusing


def _tied(gradients: Gradients, sources: Gradients) -> Gradients:
    """The gradients as functions of what they were computed from, without a derivative."""
    found = [gradient for gradient in gradients if gradient is not None]
    if not found:
        return gradients
    tied = iter(_Refusal.apply(len(found), *found, *sources))
    return tuple(None if gradient is None else next(tied) for gradient in gradients)


class _Refusal(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, count: int, *tensors: Optional[torch.Tensor]) -> Any:
        del ctx
        return tuple(tensor.detach() for tensor in tensors[:count])

    @staticmethod
    def backward(ctx: Any, *gradients: Any) -> Any:
        raise RuntimeError("tilegrad has first derivatives only (once_differentiable): jvp, hessian "
                           "and penalties of gradients would need second ones; differences of "
                           "gradients give them")
