# SPDX-License-Identifier: Apache-2.0
"""Times of the functions of tilegrad.compat.nvdiffrast: a sphere of 10,000 triangles in 512 x 512
pixels, a texture of 1024 x 1024 x 3. The least wall-clock time of several calls, and of their
backward passes.

    python3 nvdiffrast_calls.py [threads ...]

OMP_WAIT_POLICY=passive keeps torch's own threads from spinning beside ours.
"""

from __future__ import annotations

import math
import sys
import time
from typing import Any, Callable

import torch

import tilegrad.compat.nvdiffrast.torch as dr

SIZE, RINGS, SEGMENTS, TEXTURE, ROUNDS = 512, 50, 100, 1024, 10


def sphere() -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Clip positions [1,V,4], texture coordinates [1,V,2], triangles [F,3]."""
    ring, segment = torch.meshgrid(torch.arange(RINGS + 1.0), torch.arange(SEGMENTS + 1.0),
                                   indexing="ij")
    polar, turn = math.pi * ring / RINGS, 2 * math.pi * segment / SEGMENTS
    x, y, z = polar.sin() * turn.cos(), polar.cos(), polar.sin() * turn.sin() - 3.2
    pos = torch.stack([2.5 * x, 2.5 * y, -51 / 49 * z - 100 / 49, -z], -1).reshape(1, -1, 4)
    uv = torch.stack([segment / SEGMENTS, ring / RINGS], -1).reshape(1, -1, 2)
    first = torch.arange(RINGS * (SEGMENTS + 1)).reshape(RINGS, -1)[:, :-1].reshape(-1, 1, 1)
    corners = torch.tensor([[0, SEGMENTS + 1, SEGMENTS + 2], [0, SEGMENTS + 2, 1]])
    return pos, uv, (first + corners).reshape(-1, 3).int()


class Times:
    """The least time of each thing that was timed."""

    def __init__(self) -> None:
        self.least: dict[str, list[float]] = {}

    def call(self, name: str, inputs: tuple, function: Callable[..., Any]) -> Any:
        """Calls function(*inputs), then its backward pass; returns the results, cut off."""
        leaves = [t.detach().clone().requires_grad_() for t in inputs]
        begin = time.perf_counter()
        results = function(*leaves)
        middle = time.perf_counter()
        results = results if isinstance(results, tuple) else (results,)
        cotangents = [torch.ones_like(r) for r in results]
        start = time.perf_counter()
        torch.autograd.grad(results, leaves, cotangents, allow_unused=True)
        both = self.least.setdefault(name, [math.inf, math.inf])
        both[0] = min(both[0], 1e3 * (middle - begin))
        both[1] = min(both[1], 1e3 * (time.perf_counter() - start))
        return [r.detach() for r in results]


def measure(threads: int) -> Times:
    """All functions, one after the other, as a program calls them."""
    torch.set_num_threads(threads)
    times, context = Times(), dr.RasterizeCpuContext()
    pos, attr, tri = sphere()
    tex = torch.rand(1, TEXTURE, TEXTURE, 3)
    topology = dr.antialias_construct_topology_hash(tri)
    for _ in range(ROUNDS):
        rast, rast_db = times.call("rasterize", (pos,),
                                   lambda p: dr.rasterize(context, p, tri, (SIZE, SIZE)))
        uv, uv_da = times.call("interpolate, diff_attrs='all'", (attr, rast, rast_db),
                               lambda a, r, d: dr.interpolate(a, r, tri, d, "all"))
        times.call("texture, linear", (tex, uv), dr.texture)
        color, = times.call("texture, linear-mipmap-linear", (tex, uv, uv_da), dr.texture)
        times.call("antialias", (color, pos),
                   lambda c, p: dr.antialias(c, rast, p, tri, topology))
    return times


def main() -> None:
    for threads in [int(a) for a in sys.argv[1:]] or [1, 2]:
        print(f"{threads} threads{'':26} forward  backward, ms")
        for name, (forward, backward) in measure(threads).least.items():
            print(f"  {name:32} {forward:8.2f} {backward:9.2f}")


if __name__ == "__main__":
    main()
