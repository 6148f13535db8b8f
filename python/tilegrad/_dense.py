# SPDX-License-Identifier: Apache-2.0
"""Tensors of PyTorch that have real numbers in the CPU's memory."""

from __future__ import annotations

import torch


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
