#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Training over a slow network, on one machine: each rank in a network namespace of its own, behind a link of limited
bandwidth (tc's tbf). Prints what a step takes, measured and as docs/training.md says it should. As root, with Open MPI:

    bench/train/limited_network.py PROGRAM CONFIG DATA [--ranks 2] [--portions 4] [--steps 20] [--gbits 0.5 1 4] [--set KEY=VALUE ...]

The model is given what a step takes without a limit, just before and after, on as many ranks (so that what else the machine does, and its number of
cores, count on both sides), the number of gradients that the log says (summed_numbers) and the bandwidth.
"""
import pathlib
import subprocess
import tempfile

import step_times
from scaling_model import step_time


def sh(*words):
    subprocess.run(words, check=True, capture_output=True)


def address(rank):
    return f"10.97.0.{rank + 1}"


class Network:
    """Namespaces tg0, tg1, .. on one bridge; all that a rank sends goes through a filter of `gbits`, None: none."""

    def __init__(self, ranks, gbits):
        self.ranks, self.gbits = ranks, gbits

    def __enter__(self):
        self.__exit__()
        sh("ip", "link", "add", "tgbridge", "type", "bridge")
        sh("ip", "link", "set", "tgbridge", "up")
        for rank in range(self.ranks):
            self.add(rank)
        return self

    def add(self, rank):
        space, outer, inner = f"tg{rank}", f"tgo{rank}", f"tgi{rank}"
        sh("ip", "netns", "add", space)
        sh("ip", "link", "add", outer, "type", "veth", "peer", "name", inner, "netns", space)
        sh("ip", "link", "set", outer, "master", "tgbridge", "up")
        sh("ip", "-n", space, "addr", "add", f"{address(rank)}/24", "dev", inner)
        for link in (inner, "lo"):
            sh("ip", "-n", space, "link", "set", link, "up")
        if self.gbits:
            sh("ip", "netns", "exec", space, "tc", "qdisc", "add", "dev", inner, "root", "tbf", "rate",
               f"{self.gbits}gbit", "burst", "256kb", "latency", "15ms")

    def __exit__(self, *_):
        for rank in range(self.ranks):
            # The link first: a namespace may live on for a moment, and would keep it.
            subprocess.run(["ip", "link", "del", f"tgo{rank}"], capture_output=True, check=False)
            subprocess.run(["ip", "netns", "del", f"tg{rank}"], capture_output=True, check=False)
        subprocess.run(["ip", "link", "del", "tgbridge"], capture_output=True, check=False)


def agent(folder):
    """What mpirun calls instead of ssh: the namespace of an address."""
    path = pathlib.Path(folder) / "agent"
    path.write_text('#!/bin/sh\nhost=$1; shift; exec ip netns exec tg$((${host##*.} - 1)) sh -c "$*"\n')
    path.chmod(0o755)
    return str(path)


def launcher(ranks, folder):
    if ranks == 1:
        return []
    options = {"plm_rsh_agent": agent(folder), "plm_rsh_no_tree_spawn": "1", "btl": "tcp,self",
               "oob_tcp_if_include": "10.97.0.0/24", "btl_tcp_if_include": "10.97.0.0/24"}
    words = ["ip", "netns", "exec", "tg0", "mpirun", "--allow-run-as-root", "--leave-session-attached", "--bind-to", "none", "-n", str(ranks), "--host",
             ",".join(f"{address(rank)}:1" for rank in range(ranks))]
    for name, value in options.items():
        words += ["--mca", name, value]
    return words


def main():
    parser = step_times.parser(__doc__, {"ranks": 2, "portions": 4, "steps": 20})
    parser.add_argument("--gbits", type=float, nargs="+", default=[0.5, 1, 4])
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        def measure(gbits):
            with Network(args.ranks, gbits):
                return step_times.measure(args, launcher(args.ranks, folder), 1, folder)

        before, wait, numbers = measure(None)
        print(f"{args.ranks} ranks, no limit: {before * 1e3:.1f} ms a step, waiting {wait * 100:.0f} %, {numbers} numbers", flush=True)
        for gbits in args.gbits:
            step, wait, _ = measure(gbits)
            after = measure(None)[0]
            free, before = (before + after) / 2, after  # other programs come and go
            # All computing of the batch, as if by one rank as slow as these are.
            compute = free * args.ranks
            model = step_time(args.ranks, compute, 0, numbers, gbits, args.portions)
            print(f"{args.ranks} ranks, {gbits} Gb/s: {step * 1e3:.1f} ms, {free * 1e3:.1f} without a limit before and after, waiting "
                  f"{wait * 100:.0f} %; the model says {model * 1e3:.1f} ms ({model / step - 1:+.0%})", flush=True)


if __name__ == "__main__":
    main()
