# SPDX-License-Identifier: Apache-2.0
"""Tensors of PyTorch that have real numbers in the CPU's memory, in full precision."""

from __future__ import annotations

import functools
from typing import Any, Callable, TypeVar

import torch

from tilegrad._scene import Texture

Function = TypeVar("Function", bound=Callable[..., Any])

_HALVES = (torch.bfloat16, torch.float16)


def check_dense(function: str, argument: str, tensor: torch.Tensor) -> None:
    """TypeError for a tensor of another device, and for a sparse, quantized or complex one."""
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
    """The function in torch.autocast as outside of it: in float32, whatever half of it its tensors
    are, alone or in lists. bfloat16 has eight binary digits, and an image of 512 pixels has nine."""
    @functools.wraps(function)
    def full(*arguments: Any, **named: Any) -> Any:
        if not _in_autocast():
            return function(*arguments, **named)
        with torch.autocast("cpu", enabled=False):
            return function(*map(_widened, arguments),
                            **{name: _widened(value) for name, value in named.items()})

    return full  # type: ignore[return-value]


def widened(tensor: torch.Tensor) -> torch.Tensor:
    """In torch.autocast as float32, through which gradients flow back; elsewhere as it is."""
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
