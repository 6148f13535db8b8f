#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Table 1 of the paper: one network, several renderers, the same data, steps and hyperparameters.

    tilegrad dataset --source thirteen --out datasets/thirteen
    python3 bench/rivals/table1.py --data datasets/thirteen --out runs/table1 [--seeds 1 2]

Trains and scores each renderer with each seed, one run after the other, and prints the table as
Markdown: 3D IoU / F-score of each class, and both rules of IoU, with standard errors over held-out
models; then differences to our renderer by pairs of models, with errors over models and seeds. A run
that is finished is kept, one that was stopped goes on. Processor time is that of training, start-up
included. --sheet FILE.png, with PYTHONPATH=build/release/python: the paper's figure 4, a row an object of
each class: input, each renderer's prediction from there and from another side, and the truth from there.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import resource
import statistics
import subprocess
import sys
from typing import Any

import runs
import sheet

# Input | prediction, and from another side | the truth from there.
LAYOUT = sheet.Layout(columns=4, before=(0,), own=(1, 2), after=(3,), gap=4)
METHODS = {
    "N3MR": ["render.rule=n3mr"],
    "SoftRas-Mesh": ["render.rule=softras"],
    "SoftRas-Color": ["render.rule=softras", "softras.color=true"],
    "DIB-R": ["render.rule=dibr"],
    # Not the paper's: a soft band that is several pixels wide at first, and a fifth of one in the end.
    "DIB-R-wide": ["render.rule=dibr", "render.sharpness_start=500", "render.sharpness=30000"],
}
# Means over thirteen classes of ShapeNet as printed, 3D IoU / F-score; nobody printed SoftRas-Color's.
PAPER = {"N3MR": (57.0, 54.7), "SoftRas-Mesh": (59.3, 49.9), "DIB-R": (61.2, 55.8)}
SCORES = ("iou", "f_score", "carved_iou")


def processor_seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def train(options: argparse.Namespace, run: pathlib.Path, method: str, seed: int) -> None:
    """Trains `run` to its end. Its processor time is kept in a file beside it."""
    before = processor_seconds()
    runs.train(options, run, [*METHODS[method], f"schedule.seed={seed}"])
    used = pathlib.Path(f"{run}.seconds")
    earlier = float(used.read_text()) if used.exists() else 0.0
    used.write_text(str(earlier + processor_seconds() - before))


def folder(options: argparse.Namespace, method: str, seed: int) -> pathlib.Path:
    return pathlib.Path(options.out) / f"{method.lower()}-{seed}"


def scores(options: argparse.Namespace, method: str, seed: int) -> dict[str, Any]:
    """The scores of a run, which is trained and evaluated first if need be."""
    run = folder(options, method, seed)
    if not (run / "eval.json").exists():
        train(options, run, method, seed)
        runs.evaluate(options, run)
    found = json.loads((run / "eval.json").read_text())
    found["seconds"] = float(pathlib.Path(f"{run}.seconds").read_text())
    return found


def cells(rows: list[dict[str, Any]]) -> list[str]:
    """One row of the table: the mean over runs of each class, then means over classes with errors."""
    out = []
    for number in range(len(rows[0]["classes"])):
        iou, f_score = (statistics.fmean(100 * row["classes"][number][score] for row in rows)
                        for score in SCORES[:2])
        out.append(f"{iou:.1f} / {f_score:.1f}")
    for score in SCORES:
        mean = 100 * statistics.fmean(row["mean"][score] for row in rows)
        error = 100 * statistics.fmean(row["error"][score] for row in rows)
        out.append(f"{mean:.1f} ± {error:.1f}")
    return out


def table(results: dict[str, list[dict[str, Any]]], steps: int) -> str:
    first = next(iter(results.values()))[0]
    header = ["method", *first["classes"], "IoU", "F-score", "carved IoU", "ms of processor a step", "paper"]
    lines = [header, ["---"] + ["--:"] * (len(header) - 1)]
    for baseline in ("undeformed template", "best single shape", "nearest training picture"):
        lines.append([baseline, *cells([runs.row_of(first, baseline)]), "", ""])
    for method, found in results.items():
        paper = "%.1f / %.1f" % PAPER[method] if method in PAPER else ""
        seconds = statistics.fmean(one["seconds"] for one in found)
        lines.append([method, *cells([runs.row_of(one, "tilegrad") for one in found]),
                      f"{1000 * seconds / steps:.0f}", paper])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> int:
    parser = runs.parser(__doc__, METHODS)
    parser.set_defaults(config="configs/table1.toml", steps=4000, seeds=[1, 2])
    options = parser.parse_args()
    try:
        results = {method: [scores(options, method, seed) for seed in options.seeds]
                   for method in options.methods}
        first = {method: folder(options, method, options.seeds[0]) for method in options.methods}
        told = sheet.write(options, first, LAYOUT) if options.sheet else ""
    except subprocess.CalledProcessError as error:
        print(f"table1: {runs.failure(error)}", file=sys.stderr)
        return 1
    print(table(results, options.steps))
    print(runs.comparisons(results, "DIB-R", {score: (100, 1) for score in SCORES}))
    if told:
        print(told)
    return 0


if __name__ == "__main__":
    sys.exit(main())
