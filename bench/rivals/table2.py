#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Table 2 of the paper: texture and light from one image, by our renderer and by N3MR's texture cubes.

    tilegrad dataset --source cars --out datasets/cars
    python3 bench/rivals/table2.py --data datasets/cars --out runs/table2 [--steps 4000] [--seeds 1 2]

One network, the same data, steps and losses (configs/texture_quick.toml); only the renderer differs.
Trains and scores one run after the other and prints the table as Markdown. Errors are means over all
pixels and channels of the image, with standard errors over held-out models; below each of ours stand
the predicted texture without light and under the mean of all lights. Differences come last, by pairs
of models, with errors over models and seeds. A run that is finished is kept, one that was stopped goes on.
--sheet FILE.png, with PYTHONPATH=build/release/python: the paper's figure 5, a row an object: input, of each
renderer texture + light, texture and light, and the true texture and light.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import statistics
import subprocess
import sys
from typing import Any

import runs
import sheet

# Input | texture + light, texture and light | the true texture and light.
LAYOUT = sheet.Layout(columns=11, before=(0,), own=(1, 2, 3), after=(4, 5), gap=2)
METHODS = {"N3MR": "render.rule=n3mr", "DIB-R": "render.rule=dibr"}
# Cars of ShapeNet as printed: texture L1, angle of the light, texture + light L1.
PAPER = {"N3MR": (0.03640, 23.5585, 0.02208), "DIB-R": (0.02179, 9.7096, 0.01362)}
SCORES = {"texture_l1": (1, 4), "light_angle": (1, 1), "lit_l1": (1, 4)}  # factor, digits
BASELINES = ("without light", "mean light")


def folder(options: argparse.Namespace, method: str, seed: int) -> pathlib.Path:
    return pathlib.Path(options.out) / f"{method.lower()}-{seed}"


def scores(options: argparse.Namespace, method: str, seed: int) -> dict[str, Any]:
    """The scores of a run, which is trained and evaluated first if need be."""
    run = folder(options, method, seed)
    if not (run / "eval.json").exists():
        runs.train(options, run, [METHODS[method], f"schedule.seed={seed}"])
        runs.evaluate(options, run)
    return json.loads((run / "eval.json").read_text())


def number(values: list[float | None], digits: int) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return ""
    return f"{statistics.fmean(known):.{digits}f}"


def cells(rows: list[dict[str, Any]]) -> list[str]:
    out = []
    for score, (_, digits) in SCORES.items():
        error = number([row["error"].get(score) for row in rows], digits)
        out.append(number([row["mean"].get(score) for row in rows], digits) + (f" ± {error}" if error else ""))
    ratio = number([row.get("light_of_constant") for row in rows], 2)
    return [*out, ratio]


def table(results: dict[str, list[dict[str, Any]]]) -> str:
    header = ["method", "texture L1", "light (degrees)", "texture + light L1", "light / constant", "paper"]
    lines = [header, ["---"] + ["--:"] * 5]
    for method, found in results.items():
        printed = " / ".join(str(value) for value in PAPER[method])
        lines.append([method, *cells([runs.row_of(one, "tilegrad") for one in found]), printed])
        for baseline in BASELINES:
            lines.append([f"{method}, {baseline}", *cells([runs.row_of(one, baseline) for one in found]), ""])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> int:
    parser = runs.parser(__doc__, METHODS)
    parser.set_defaults(config="configs/texture_quick.toml", steps=4000, seeds=[1])
    options = parser.parse_args()
    try:
        results = {method: [scores(options, method, seed) for seed in options.seeds]
                   for method in options.methods}
        first = {method: folder(options, method, options.seeds[0]) for method in options.methods}
        told = sheet.write(options, first, LAYOUT) if options.sheet else ""
    except subprocess.CalledProcessError as error:
        print(f"table2: {runs.failure(error)}", file=sys.stderr)
        return 1
    print(table(results))
    print(runs.comparisons(results, "DIB-R", SCORES))
    if told:
        print(told)
    return 0


if __name__ == "__main__":
    sys.exit(main())
