#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""What ranks cost on one machine: R ranks of one worker beside one process with R workers, the same portions, in turns.

    bench/train/ranks_and_workers.py PROGRAM CONFIG DATA [--ranks 2] [--portions 4] [--steps 40] [--turns 5] [--set KEY=VALUE ...]

Prints the median step of each, and the speed of ranks over that of workers: the median over turns, with the least and the largest.
"""
import statistics
import tempfile

import step_times


def turn(args, folder):
    """Seconds of a step of one process, of ranks, and the share that rank 0 waited."""
    one, _, _ = step_times.measure(args, [], args.ranks, folder)
    mpirun = ["mpirun", "--allow-run-as-root", "--bind-to", "none", "-n", str(args.ranks)]
    return (one, *step_times.measure(args, mpirun, 1, folder)[:2])


def main():
    args = step_times.parser(__doc__, {"ranks": 2, "portions": 4, "steps": 40, "turns": 5}).parse_args()
    with tempfile.TemporaryDirectory() as folder:
        turns = [turn(args, folder) for _ in range(args.turns)]
    workers, ranks, wait = (statistics.median(column) for column in zip(*turns))
    ratios = sorted(one / many for one, many, _ in turns)
    print(f"one process, {args.ranks} workers: {workers * 1e3:.1f} ms a step; {args.ranks} ranks: {ranks * 1e3:.1f} ms, waiting {wait * 100:.1f} %; "
          f"ranks are {statistics.median(ratios):.3f} times as fast ({ratios[0]:.3f} to {ratios[-1]:.3f})")


if __name__ == "__main__":
    main()
