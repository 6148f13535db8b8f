#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs fuzz targets and counts what they did.

    tests/fuzz/fuzz.py BUILD SECONDS [TARGET...] [--jobs N]    exit code 1 if anything was found

A target begins with its seeds, tests/fuzz/corpus/TARGET and what earlier runs kept in
out/fuzz/TARGET/corpus. Executions are added to out/fuzz/executions.tsv, a line a run. What breaks a target
lies in out/fuzz/TARGET afterwards; once it is mended it moves to tests/fuzz/found/TARGET under a name that
says what it was, where the tests run it for ever (replay_test.cc).
"""
import argparse
import collections
import concurrent.futures
import os
import pathlib
import re
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
HERE = ROOT / "tests" / "fuzz"
OUT = ROOT / "out" / "fuzz"
FOUND = ("crash-*", "timeout-*", "leak-*", "oom-*")
MOST_BYTES = collections.defaultdict(lambda: 4096, exr=16384, checkpoint=16384, assimp=65536)


def programs(build):
    folder = pathlib.Path(build) / "tests" / "fuzz"
    return {p.name[len("fuzz_"):]: p for p in sorted(folder.glob("fuzz_*"))
            if p.is_file() and os.access(p, os.X_OK)}


def write_seeds(program, folder):
    subprocess.run([program], env=dict(os.environ, TILEGRAD_FUZZ_SEEDS=str(folder)), check=True,
                   stdout=subprocess.DEVNULL)


def found_in(folder):
    return sorted(p for pattern in FOUND for p in folder.glob(pattern))


def command(program, name, seconds):
    folder = OUT / name
    for part in ("corpus", "seeds"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    write_seeds(program, folder / "seeds")
    # Entropic scheduling took 25 % (gltf) to 60 % (obj) of the time.
    words = [program, "-max_total_time=%d" % seconds, "-print_final_stats=1", "-timeout=20", "-entropic=0",
             "-rss_limit_mb=3000", "-max_len=%d" % MOST_BYTES[name], "-artifact_prefix=%s/" % folder]
    dictionary = HERE / "dictionaries" / (name + ".dict")
    if dictionary.exists():
        words.append("-dict=%s" % dictionary)
    words += [folder / "corpus", folder / "seeds"]
    return words + [p for p in (HERE / "corpus" / name, HERE / "found" / name) if p.is_dir()]


def fuzz(program, name, seconds):
    """(executions, seconds, files that were found, the last lines of output)"""
    words = command(program, name, seconds)
    before = set(found_in(OUT / name))
    start = time.monotonic()
    log = OUT / name / "log"
    with open(log, "w", encoding="utf-8") as stream:
        code = subprocess.run(words, stdout=stream, stderr=subprocess.STDOUT, check=False).returncode
    text = log.read_text(encoding="utf-8", errors="replace")
    runs = re.search(r"stat::number_of_executed_units:\s*(\d+)", text)
    if runs:
        executions = int(runs.group(1))
    else:  # it ended before it could say: what it said last
        executions = max([int(n) for n in re.findall(r"^#(\d+)\t", text, re.M)] or [0])
    found = [p for p in found_in(OUT / name) if p not in before]
    tail = "\n".join(text.splitlines()[-60:])
    if code != 0 and not found:
        found = [log]
    return executions, time.monotonic() - start, found, tail


def record(name, executions, seconds, found):
    line = "%s\t%s\t%.0f\t%d\t%d\n" % (time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()), name, seconds,
                                       executions, len(found))
    with open(OUT / "executions.tsv", "a", encoding="utf-8") as stream:
        stream.write(line)


def run(chosen, seconds, jobs):
    failed = False
    OUT.mkdir(parents=True, exist_ok=True)
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        running = {pool.submit(fuzz, program, name, seconds): name for name, program in chosen.items()}
        for done in concurrent.futures.as_completed(running):
            name = running[done]
            executions, took, found, tail = done.result()
            record(name, executions, took, found)
            print("%-16s %10d executions, %4.0f s, %d found" % (name, executions, took, len(found)), flush=True)
            for path in found:
                failed = True
                print("%s\nFOUND: %s\n" % (tail, path), flush=True)
    return 1 if failed else 0


def totals():
    """Executions and seconds by target, of all runs recorded in out/fuzz."""
    table = collections.defaultdict(lambda: [0, 0])
    path = OUT / "executions.tsv"
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        _, name, seconds, executions, _ = line.split("\t")
        table[name][0] += int(executions)
        table[name][1] += int(seconds)
    return table


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build")
    parser.add_argument("seconds", type=int, nargs="?", default=20)
    parser.add_argument("targets", nargs="*")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    arguments = parser.parse_intermixed_args()
    known = programs(arguments.build)
    unknown = [t for t in arguments.targets if t not in known]
    if unknown:
        print("fuzz: no target %s; there are: %s" % (unknown[0], " ".join(known)), file=sys.stderr)
        return 2
    chosen = {name: known[name] for name in arguments.targets or known}
    code = run(chosen, arguments.seconds, arguments.jobs)
    table = totals()
    print("in all runs so far: %d executions in %d s" % (sum(t[0] for t in table.values()),
                                                         sum(t[1] for t in table.values())))
    return code


if __name__ == "__main__":
    sys.exit(main())
