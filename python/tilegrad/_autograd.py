# SPDX-License-Identifier: Apache-2.0
"""How far torch may differentiate what tilegrad computes: once."""

from __future__ import annotations

import functools
from typing import Any, Callable, Optional

import torch

Gradients = tuple[Optional[torch.Tensor], ...]


def first_derivative_only(backward: Callable[..., Any]) -> Callable[..., Any]:
    """For the `backward` of an autograd.Function, which has saved its inputs: whoever differentiates
    the gradients once more gets a RuntimeError.

    torch's once_differentiable raises where backward() passes. What asks for gradients of some
    inputs (functional.jvp, functional.hessian) does not find its node, and says 0.
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
