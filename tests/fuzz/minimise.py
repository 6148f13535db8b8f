#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Chooses the few inputs of long fuzzing that the tests run for ever.

    tests/fuzz/minimise.py BUILD [TARGET...] [--most 24]

Of what fuzz.py kept in out/fuzz/TARGET/corpus, inputs are taken to tests/fuzz/corpus/TARGET one after the other, each
time the one that reaches most code that neither the target's seeds nor those before it reach. Large ones are left out.
"""
import argparse
import hashlib
import pathlib
import shutil
import subprocess
import tempfile

from fuzz import HERE, OUT, programs, write_seeds

MOST_BYTES = 2048


def coverage(program, folders):
    """Of each file the edges that it reaches, as libFuzzer's merge finds them."""
    with tempfile.TemporaryDirectory() as scratch:
        control = pathlib.Path(scratch) / "control"
        merged = pathlib.Path(scratch) / "merged"
        merged.mkdir()
        subprocess.run([program, "-merge=1", "-timeout=20", "-rss_limit_mb=3000", "-merge_control_file=%s" % control, merged, *folders],
                       check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        lines = control.read_text().splitlines()
    count = int(lines[0])
    files = [pathlib.Path(line) for line in lines[2:2 + count]]
    reached = {}
    for line in lines[2 + count:]:
        words = line.split()
        if words[0] == "COV":
            reached[files[int(words[1])]] = set(words[2:])
    return reached


def choose(reached, seeds, most):
    covered = set().union(*(edges for path, edges in reached.items() if path.parent == seeds))
    left = {path: edges for path, edges in reached.items() if path.parent != seeds and path.stat().st_size <= MOST_BYTES}
    chosen = []
    while left and len(chosen) < most:
        best = max(sorted(left), key=lambda path: (len(left[path] - covered), -path.stat().st_size))
        if not left[best] - covered:
            break
        covered |= left.pop(best)
        chosen.append(best)
    return chosen


def minimise(program, name, most):
    folder, kept = OUT / name, HERE / "corpus" / name
    seeds = folder / "seeds"
    seeds.mkdir(parents=True, exist_ok=True)
    write_seeds(program, seeds)
    folders = [seeds] + [p for p in (folder / "corpus", kept) if p.is_dir()]
    chosen = [path.read_bytes() for path in choose(coverage(program, folders), seeds, most)]
    shutil.rmtree(kept, ignore_errors=True)
    for data in chosen:
        kept.mkdir(parents=True, exist_ok=True)
        (kept / hashlib.sha256(data).hexdigest()[:12]).write_bytes(data)
    return chosen


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build")
    parser.add_argument("targets", nargs="*")
    parser.add_argument("--most", type=int, default=24)
    arguments = parser.parse_intermixed_args()
    known = programs(arguments.build)
    for name in arguments.targets or known:
        chosen = minimise(known[name], name, arguments.most)
        print("%-16s %3d inputs, %6d bytes" % (name, len(chosen), sum(map(len, chosen))), flush=True)


if __name__ == "__main__":
    main()
