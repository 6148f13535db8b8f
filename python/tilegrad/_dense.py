# SPDX-License-Identifier: Apache-2.0
"""Tensors of PyTorch that have real numbers in memory."""

from __future__ import annotations

import torch


def check_dense(function: str, argument: str, tensor: torch.Tensor) -> None:
    """TypeError for a sparse, quantized or complex tensor."""
    if tensor.is_complex():
        raise TypeError(f"{function}: {argument} has dtype {tensor.dtype}, expected real numbers")
    if tensor.layout == torch.strided and not tensor.is_quantized:
        return
    kind, cure = ("quantized", "dequantize") if tensor.is_quantized else ("sparse", "to_dense")
    raise TypeError(f"{function}: {argument} is {kind}, expected a dense tensor: give "
                    f"{argument}.{cure}()")
