# SPDX-License-Identifier: Apache-2.0
"""What a training step takes, from the log of a short run: for the benchmarks of this folder."""
import argparse
import json
import pathlib
import statistics
import subprocess


def parser(description, defaults):
    """Program, configuration, dataset, --set, and a whole number for each of `defaults`."""
    out = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("program", "config", "data"):
        out.add_argument(name)
    for name, value in defaults.items():
        out.add_argument(f"--{name}", type=int, default=value)
    out.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE")
    return out


def measure(args, launcher, threads, folder):
    """Median seconds of a step and share of waiting, without the first three steps, and how many numbers ranks sum in it."""
    run = pathlib.Path(folder) / "run"
    subprocess.run(["rm", "-rf", str(run)], check=True)
    words = launcher + [args.program, "train", "--config", args.config, "--data", args.data, "--out", str(run), "--quiet",
                        "--threads", str(threads), "--steps", str(args.steps)]
    for setting in [f"schedule.portions={args.portions}", "schedule.log_every=1", "schedule.sample_every=1000000",
                    "schedule.checkpoint_every=1000000"] + args.set:
        words += ["--set", setting]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr)
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    steps = [b["seconds"] - a["seconds"] for a, b in zip(lines[2:], lines[3:])]
    waits = [line.get("wait_share", 0) for line in lines[3:]]
    return statistics.median(steps), statistics.median(waits), int(lines[-1].get("summed_numbers", 0))
