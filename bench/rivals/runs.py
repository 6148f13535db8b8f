# SPDX-License-Identifier: Apache-2.0
"""What the tables of this folder share: runs that are trained once, go on after a stop, and are scored."""

from __future__ import annotations

import argparse
import pathlib
import subprocess
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


def failure(error: subprocess.CalledProcessError) -> str:
    return f"{error.cmd[1]} failed with exit code {error.returncode}; the same command goes on from here"
