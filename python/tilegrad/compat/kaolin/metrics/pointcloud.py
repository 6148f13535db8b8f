# SPDX-License-Identifier: Apache-2.0
"""kaolin.metrics.pointcloud. The nearest points are found by the k-d tree that scores predictions;
distances are torch's, so that gradients flow to both clouds."""

from __future__ import annotations

import torch

from tilegrad._dense import full_precision
from tilegrad.compat._tensors import (check_floats, check_not_empty, surface_tools, threads,
                                      to_numpy)
from tilegrad.compat.kaolin._missing import missing_from

__getattr__ = missing_from(__name__)


@full_precision
def sided_distance(p1: torch.Tensor, p2: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """For each point of p1 [B,N,3] the squared distance to the nearest one of p2 [B,M,3], [B,N],
    and the index of that one, [B,N] int64; of equally near ones the first."""
    sizes: dict = {}
    check_floats("sided_distance", "p1", p1, ("B", "N", 3), sizes)
    check_floats("sided_distance", "p2", p2, ("B", "M", 3), sizes, p1)
    if p1.shape[1]:
        check_not_empty("sided_distance", "p2", p2, "points")
    index = torch.from_numpy(surface_tools().nearest_points(to_numpy(p1), to_numpy(p2), threads()))
    nearest = p2.gather(1, index.unsqueeze(-1).expand(-1, -1, 3))
    return ((p1 - nearest)**2).sum(dim=-1), index


@full_precision
def chamfer_distance(p1: torch.Tensor, p2: torch.Tensor, w1: float = 1., w2: float = 1.,
                     squared: bool = True) -> torch.Tensor:
    """w1 times the mean of p1's sided distances to p2 plus w2 times the mean of p2's to p1: [B].
    squared: False: of distances, not of their squares. p1: [B,N,3]. p2: [B,M,3]. ValueError: a
    cloud without points, which has no mean."""
    _check_clouds("chamfer_distance", p1=p1, p2=p2)
    ways = [sided_distance(p1, p2)[0], sided_distance(p2, p1)[0]]
    if not squared:
        ways = [_root(way) for way in ways]
    return w1 * ways[0].mean(dim=-1) + w2 * ways[1].mean(dim=-1)


@full_precision
def f_score(gt_points: torch.Tensor, pred_points: torch.Tensor, radius: float = 0.01,
            eps: float = 1e-8) -> torch.Tensor:
    """2 P R / (P + R + eps): P and R are the shares of predicted points within `radius` of the
    truth and the reverse. gt_points: [B,N,3]. pred_points: [B,M,3]. Returns [B], without a
    gradient. ValueError: a cloud without points."""
    _check_clouds("f_score", gt_points=gt_points, pred_points=pred_points)
    recall, precision = (
        (sided_distance(a, b)[0].sqrt() <= radius).to(pred_points.dtype).mean(dim=-1)
        for a, b in ((gt_points, pred_points), (pred_points, gt_points)))
    return 2 * precision * recall / (precision + recall + eps)


def _check_clouds(name: str, **clouds: torch.Tensor) -> None:
    for argument, points in clouds.items():
        check_floats(name, argument, points, ("B", "N", 3))
        check_not_empty(name, argument, points, "points")


def _root(squares: torch.Tensor) -> torch.Tensor:
    """The square root, with gradient 0 at 0."""
    zero = squares == 0
    return torch.where(zero, 0., torch.where(zero, 1., squares).sqrt())
