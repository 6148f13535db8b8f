#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""What ranks cost on one machine: R ranks of one worker beside one process with R workers, the same portions, in turns.

    bench/train/ranks_and_workers.py PROGRAM CONFIG DATA [--ranks 2] [--portions 4] [--steps 40] [--turns 5] [--set KEY=VALUE ...]

Prints the median step of each, and the speed of ranks over that of workers: the median over turns, with the least and the largest.
"""
import argparse
import json
import pathlib
import statistics
import subprocess
import tempfile


def median_step(args, ranks, run):
    """Seconds of a step, without the first three, and the share of waiting."""
    subprocess.run(["rm", "-rf", str(run)], check=True)
    launcher = ["mpirun", "--allow-run-as-root", "--bind-to", "none", "-n", str(ranks)] if ranks > 1 else []
    words = launcher + [args.program, "train", "--config", args.config, "--data", args.data, "--out", str(run), "--quiet",
                        "--threads", str(args.ranks // ranks), "--steps", str(args.steps)]
    for setting in [f"schedule.portions={args.portions}", "schedule.log_every=1", "schedule.sample_every=1000000",
                    "schedule.checkpoint_every=1000000"] + args.set:
        words += ["--set", setting]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr)
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    steps = [b["seconds"] - a["seconds"] for a, b in zip(lines[2:], lines[3:])]
    return statistics.median(steps), statistics.median(line.get("wait_share", 0) for line in lines[3:])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("program", "config", "data"):
        parser.add_argument(name)
    for name, value in (("ranks", 2), ("portions", 4), ("steps", 40), ("turns", 5)):
        parser.add_argument(f"--{name}", type=int, default=value)
    parser.add_argument("--set", nargs="+", default=[])
    args = parser.parse_args()
    turns = []
    with tempfile.TemporaryDirectory() as folder:
        run = pathlib.Path(folder) / "run"
        for _ in range(args.turns):
            turns.append((*median_step(args, 1, run), *median_step(args, args.ranks, run)))
    workers, _, ranks, wait = (statistics.median(column) for column in zip(*turns))
    ratios = sorted(turn[0] / turn[2] for turn in turns)
    print(f"one process, {args.ranks} workers: {workers * 1e3:.1f} ms a step; {args.ranks} ranks: {ranks * 1e3:.1f} ms, waiting {wait * 100:.1f} %; "
          f"ranks are {statistics.median(ratios):.3f} times as fast ({ratios[0]:.3f} to {ratios[-1]:.3f})")


if __name__ == "__main__":
    main()
