# SPDX-License-Identifier: Apache-2.0
"""What several runs show of the same held-out objects, side by side: the paper's figures 4 and 5.

Each run's report draws RUN/summary.png, a row an object, the same objects in every run of a dataset. A sheet has
once what does not depend on the run, such as the input, and for each run what does.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import pathlib
import subprocess

import numpy as np

WHITE = 255


@dataclasses.dataclass(frozen=True)
class Layout:
    """Columns of a summary, by their number from 0. gap: white pixels between its cells."""

    columns: int
    before: tuple[int, ...]  # of all runs, in front
    own: tuple[int, ...]     # of each run
    after: tuple[int, ...]   # of all runs, at the end
    gap: int


def cells(summary: np.ndarray, layout: Layout) -> list[np.ndarray]:
    """The columns of a summary [H, W, 3]."""
    step = (summary.shape[1] + layout.gap) // layout.columns
    if step * layout.columns - layout.gap != summary.shape[1]:
        raise ValueError(f"a summary {summary.shape[1]} pixels wide has no {layout.columns} columns")
    return [summary[:, step * column:step * (column + 1) - layout.gap] for column in range(layout.columns)]


def beside(summaries: list[np.ndarray], layout: Layout) -> np.ndarray:
    """The sheet of such summaries; runs stand four gaps apart."""
    if len({summary.shape for summary in summaries}) != 1:
        raise ValueError("the runs show different objects: score them on one dataset")
    pictures = [cells(summary, layout) for summary in summaries]
    groups = [[pictures[0][column] for column in layout.before]]
    groups += [[of_run[column] for column in layout.own] for of_run in pictures]
    groups += [[pictures[0][column] for column in layout.after]]
    height = summaries[0].shape[0]
    parts: list[np.ndarray] = []
    for group in filter(None, groups):
        for number, picture in enumerate(group):
            width = layout.gap * (0 if not parts else 1 if number else 4)
            parts += [np.full((height, width, 3), WHITE, np.uint8), picture]
    return np.concatenate(parts, axis=1)


def write(options: argparse.Namespace, found: dict[str, pathlib.Path], layout: Layout) -> str:
    """Writes options.sheet of the runs `found`, by method, and says what its columns are."""
    from tilegrad.images import load_image, save_image  # PYTHONPATH=build/release/python

    summaries = []
    for run in found.values():
        said = subprocess.run([options.program, "report", "--run", str(run), "--data", options.data, "--json"],
                              check=True, stdout=subprocess.PIPE, text=True)
        summaries.append(load_image(json.loads(said.stdout)["sheet"])[..., :3])
    save_image(options.sheet, beside(summaries, layout))
    return f"{options.sheet}: a row a held-out object; columns: what all share, {', '.join(found)}, what all share"
