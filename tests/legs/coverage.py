#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Which lines of the readers (src/io) their tests and the seeds of the fuzz targets reach.

    tests/legs/coverage.py BUILD OUT [TEST...]    exit code 1 if it is less than 90 % of lines

BUILD was compiled by clang with -fprofile-instr-generate -fcoverage-mapping; TEST are programs in it. What
each child process does counts, too. Figures by file go to OUT/coverage.md, lines that nothing reached to
OUT/coverage.txt.
"""
import json
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
WANTED = 90.0


def run(programs, out):
    for old in out.glob("*.profraw"):
        old.unlink()
    environment = dict(os.environ, LLVM_PROFILE_FILE=str(out / "%p-%m.profraw"), TILEGRAD_FUZZ_MUTATIONS="200")
    for program in programs:
        done = subprocess.run([program], env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
        if done.returncode != 0:
            print("coverage: %s: exit code %d" % (program.name, done.returncode), file=sys.stderr)


def of_readers(path):
    return os.path.relpath(path, ROOT).startswith("src/io/")


def measure(programs, out):
    """Of each file in src/io (path, lines, lines that were reached). llvm-cov's own filter does not know relative paths."""
    merged = out / "all.profdata"
    subprocess.run(["llvm-profdata-14", "merge", "-sparse", "-o", merged] + sorted(out.glob("*.profraw")), check=True)
    words = ["-instr-profile=%s" % merged, programs[0]] + ["-object=%s" % p for p in programs[1:]]
    text = subprocess.run(["llvm-cov-14", "export", "-summary-only"] + words, check=True, stdout=subprocess.PIPE).stdout
    files = [f for f in json.loads(text)["data"][0]["files"] if of_readers(f["filename"])]
    shown = subprocess.run(["llvm-cov-14", "show", "-show-regions=0"] + words + [f["filename"] for f in files], check=True,
                           stdout=subprocess.PIPE)
    (out / "coverage.txt").write_bytes(shown.stdout)
    lines = [(f["filename"], f["summary"]["lines"]) for f in files]
    return [(os.path.relpath(name, ROOT), n["count"], n["covered"]) for name, n in lines]


def table(files):
    rows = sorted((100 * reached / max(count, 1), name, count) for name, count, reached in files)
    lines = ["| file | lines | reached |", "| --- | --: | --: |"]
    lines += ["| %s | %d | %.1f %% |" % (name, count, percent) for percent, name, count in rows]
    total = sum(count for _, count, _ in files)
    percent = 100 * sum(reached for *_, reached in files) / max(total, 1)
    lines.append("| all | %d | %.1f %% |" % (total, percent))
    return "\n".join(lines) + "\n", percent


def main():
    build, out = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
    out.mkdir(parents=True, exist_ok=True)
    programs = [p for name in sys.argv[3:] for p in build.glob("tests/**/" + name)]
    run(programs, out)
    text, percent = table(measure(programs, out))
    (out / "coverage.md").write_text(text, encoding="utf-8")
    print(text)
    return 0 if percent >= WANTED else 1


if __name__ == "__main__":
    sys.exit(main())
