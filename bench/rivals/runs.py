# SPDX-License-Identifier: Apache-2.0
"""What the tables of this folder share: runs that are trained once, go on after a stop, and are scored."""

from __future__ import annotations

import argparse
import math
import pathlib
import statistics
import subprocess
from collections import defaultdict
from collections.abc import Iterable
from typing import Any


def parser(description: str | None, methods: Iterable[str]) -> argparse.ArgumentParser:
    """The options of every table; the caller sets the defaults of config, steps and seeds."""
    out = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    out.add_argument("--data", required=True, help="dataset folder")
    out.add_argument("--out", required=True, help="folder of the runs")
    out.add_argument("--program", default="build/release/src/cli/tilegrad", help="tilegrad")
    out.add_argument("--config", help="of all")
    out.add_argument("--steps", type=int, help="of each run")
    out.add_argument("--seeds", type=int, nargs="+")
    out.add_argument("--methods", nargs="+", choices=list(methods), default=list(methods))
    out.add_argument("--sheet", metavar="FILE", help="also write what the first seed's runs predict, side by side")
    out.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="for all")
    return out


def train(options: argparse.Namespace, run: pathlib.Path, settings: Iterable[str]) -> None:
    """Trains `run` to its end, from where it was stopped."""
    command = [options.program, "train", "--out", str(run), "--config", options.config, "--data", options.data]
    if (run / "run.json").exists():
        command += ["--resume"]
    for setting in [*settings, f"schedule.steps={options.steps}", *options.set]:
        command += ["--set", setting]
    subprocess.run(command, check=True)


def evaluate(options: argparse.Namespace, run: pathlib.Path) -> None:
    subprocess.run([options.program, "eval", "--run", str(run), "--data", options.data], check=True)


def row_of(found: dict[str, Any], method: str) -> dict[str, Any]:
    return next(row for row in found["rows"] if row["method"] == method)


def mean_over_classes(classes: Iterable[list[float]]) -> tuple[float, float]:
    """Mean of means and its standard error, as src/train/eval/statistics.h has them."""
    known = [numbers for numbers in classes if numbers]
    means = [statistics.fmean(numbers) for numbers in known]
    squares = sum((x - mean) ** 2 for numbers, mean in zip(known, means) for x in numbers)
    freedom = sum(len(numbers) - 1 for numbers in known)
    shares = sum(1 / len(numbers) for numbers in known)
    error = math.sqrt(squares / freedom * shares) / len(known) if freedom else math.nan
    return statistics.fmean(means), error


def paired(first: list[dict[str, Any]], second: list[dict[str, Any]], score: str) -> tuple[float, float]:
    """The mean difference of two methods, each a run a seed, with its standard error: over held-out shapes, of
    means over seeds, and over seeds, in squares."""
    shapes: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    by_seed = []
    for one, other in zip(first, second):
        theirs = {(model["class"], model["id"]): model[score] for model in other["models"]}
        of_seed: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
        for model in one["models"]:
            difference = model[score] - theirs[model["class"], model["id"]]
            for to in (shapes, of_seed):
                to[model["class"]][model.get("shape", model["id"])].append(difference)
        by_seed.append(mean_over_classes(numbers_of(of_seed))[0])
    mean, error = mean_over_classes(numbers_of(shapes))
    spread = statistics.stdev(by_seed) / math.sqrt(len(by_seed)) if len(by_seed) > 1 else 0.0
    return mean, math.hypot(error, spread)


def numbers_of(shapes: dict[str, dict[str, list[float]]]) -> list[list[float]]:
    """One number a shape: the mean over its models and seeds."""
    return [[statistics.fmean(numbers) for numbers in of_class.values()] for of_class in shapes.values()]


def comparisons(results: dict[str, list[dict[str, Any]]], ours: str, scores: dict[str, tuple[float, int]]) -> str:
    """A line a rival and score; `scores`: what a number is multiplied by, and its digits."""
    lines = []
    for method, found in results.items():
        if method == ours or ours not in results:
            continue
        parts = []
        for score, (factor, digits) in scores.items():
            mean, error = paired(results[ours], found, score)
            verdict = " (a tie)" if not abs(mean) >= 2 * error else ""
            parts.append(f"{score} {factor * mean:+.{digits}f} ± {factor * error:.{digits}f}{verdict}")
        lines.append(f"{ours} minus {method}, by pairs of models: {', '.join(parts)}")
    return "\n".join(lines)


def failure(error: subprocess.CalledProcessError) -> str:
    return f"{error.cmd[1]} failed with exit code {error.returncode}; the same command goes on from here"
