# SPDX-License-Identifier: Apache-2.0
"""Training steps of this library beside PyTorch's, in turns: a table of medians and ratios.

    apt install python3-torch
    cmake --preset release && cmake --build build/release --target nn_step_server
    python3 bench/nn/compare_steps.py

Both run all the time in processes of their own, one step of one, one of the other, so that what
else the machine does meets both alike. One core: medians of the CPU time, both bound to the same
core. Two cores: medians of the wall time, OpenMP's threads bound to a core each (without that GNU
OpenMP often puts both onto one). The first steps, which take memory, are not counted.
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
# network: (counted steps, goal of ours / PyTorch on one core, on two)
NETWORKS = {"reconstruction": (9, 0.70, 0.62), "critic": (9, 0.62, None),
            "adversarial": (21, 0.60, None), "gan": (21, 0.60, None)}
WARM_UP = 2


def start(command, cores):
    environment = dict(os.environ, OMP_NUM_THREADS=str(cores), OPENBLAS_NUM_THREADS=str(cores),
                       OMP_PROC_BIND="true", OMP_PLACES="cores")
    mask = sorted(os.sched_getaffinity(0))[-cores:]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                            env=environment, preexec_fn=lambda: os.sched_setaffinity(0, mask))


def step(process):
    process.stdin.write("\n")
    process.stdin.flush()
    line = process.stdout.readline()
    if not line:
        sys.exit("a process ended before it answered")
    return json.loads(line)


def measure(network, cores, options):
    """Medians of both: {"ours": {...}, "pytorch": {...}}."""
    processes = {
        "ours": start([options.server, network, str(cores)], cores),
        "pytorch": start([options.python, str(ROOT / "bench/nn/pytorch_steps.py"), network,
                          str(cores)], cores)}
    steps = options.steps or NETWORKS[network][0]
    answers = {name: [] for name in processes}
    for _ in range(WARM_UP + steps):
        for name, process in processes.items():
            answers[name].append(step(process))
    for process in processes.values():
        process.stdin.close()
        process.wait()
    return {name: {key: statistics.median(a[key] for a in given[WARM_UP:]) for key in given[0]}
            for name, given in answers.items()}


def row(cells):
    print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


def report(network, options):
    both = {cores: measure(network, cores, options) for cores in options.cores}
    _, one_goal, two_goal = NETWORKS[network]
    for cores, result in both.items():
        key, goal = ("cpu_ms", one_goal) if cores == 1 else ("wall_ms", two_goal)
        ours, theirs = result["ours"], result["pytorch"]
        speedup = ""
        if cores > 1 and 1 in both:
            speedup = "{:.2f} / {:.2f}".format(*(both[1][who]["wall_ms"] / result[who]["wall_ms"]
                                                 for who in ("ours", "pytorch")))
        row([network, cores, key.split("_")[0], f"{ours[key]:.0f}", f"{theirs[key]:.0f}",
             f"{ours[key] / theirs[key]:.2f}", goal or "", speedup, f"{ours['pool_mb']:.0f}",
             f"{ours['rss_mb']:.0f}", f"{theirs['rss_mb']:.0f}"])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("networks", nargs="*", default=list(NETWORKS), metavar="NETWORK",
                        help="of " + ", ".join(NETWORKS))
    parser.add_argument("--steps", type=int, help="counted steps of each (default: 9 or 21)")
    parser.add_argument("--cores", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--server", default=str(ROOT / "build/release/bench/nn/nn_step_server"))
    parser.add_argument("--python", default="/usr/bin/python3", help="one that has torch")
    options = parser.parse_args()
    row(["network", "cores", "time", "ours ms", "PyTorch ms", "ratio", "goal",
         "gain of the cores, ours / PyTorch", "ours: tensors MB", "ours: resident MB",
         "PyTorch: resident MB"])
    row(["---"] * 11)
    for network in options.networks:
        report(network, options)


if __name__ == "__main__":
    main()
