#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""The model of docs/training.md: what a step takes on many ranks, from what one rank needs.

    bench/train/scaling_model.py NUMBERS COMPUTE UPDATE [--portions 64] [--gbits 10 100 200]

NUMBERS: of gradients (run.json: parameters). COMPUTE, UPDATE: seconds of one rank for a step's portions, and for Adam.
Prints the speed of R ranks over that of one, and the batch from which twice the ranks are 1.5 times as fast, as a multiple
of the batch that COMPUTE is of.
"""
import argparse

BUCKET = 1 << 18  # numbers, as in src/train/ranks/gradient_sums.h
BACKWARD = 0.6  # share of a portion's time in which sums may travel
TCP = 0.93  # share of a network's bandwidth that TCP carries
PLACING = 8 / 36  # bytes moved to put a weight that came in its place, over those that updating it moves


def step_time(ranks, compute, update, numbers, gbits, portions):
    computing = compute * -(-portions // ranks) / portions
    if ranks == 1:
        return computing + update
    travel = (ranks - 1) / ranks * 4 * numbers / (TCP * gbits * 1e9 / 8)  # of sums, and of what comes back
    buckets = max(1, -(-numbers // BUCKET))
    overlap = BACKWARD * compute / portions
    moved = update / ranks  # weights, whose buckets leave one by one
    placing = PLACING * update * (ranks - 1) / ranks
    exposed = max(travel - overlap, travel / buckets)
    return computing + exposed + max(moved + travel / buckets, travel + moved / buckets) + placing


def batch_for(ranks, args, gbits):
    """The multiple of the batch from which 2 R ranks are 1.5 times as fast as R."""
    factor = 1.0
    while factor < 4096:
        half, full = (step_time(r, args.compute * factor, args.update, args.numbers, gbits, args.portions)
                      for r in (ranks, 2 * ranks))
        if half / full >= 1.5:
            return factor
        factor *= 1.1
    return float("inf")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("numbers", type=int)
    parser.add_argument("compute", type=float)
    parser.add_argument("update", type=float)
    parser.add_argument("--portions", type=int, default=64)
    parser.add_argument("--gbits", type=float, nargs="+", default=[10, 100, 200])
    parser.add_argument("--ranks", type=int, nargs="+", default=[2, 4, 8, 16])
    args = parser.parse_args()
    alone = step_time(1, args.compute, args.update, args.numbers, 1, args.portions)
    for gbits in args.gbits:
        speeds = [alone / step_time(r, args.compute, args.update, args.numbers, gbits, args.portions) for r in args.ranks]
        print(f"{gbits:g} Gb/s:", ", ".join(f"{r}: {s:.2f}" for r, s in zip(args.ranks, speeds)),
              f"; 8 -> 16 pays from {batch_for(8, args, gbits):.1f} times the batch")


if __name__ == "__main__":
    main()
