#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""clang-tidy over .cc files, those again only of which something has changed since they passed.

    tests/legs/tidy.py BUILD FILE...    exit code 1 if one does not pass

BUILD has compile_commands.json. What passed is kept in BUILD/passed, one empty file each: its name is the hash of the
file after preprocessing (with comments, because NOLINT is one), of .clang-tidy and of clang-tidy's version. So a run
that was stopped goes on where it was.
"""
import concurrent.futures
import hashlib
import json
import os
import pathlib
import shlex
import signal
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
TIDY, CLANG = "clang-tidy-14", "clang++-14"
EXTRA = "-Wno-unknown-warning-option"  # the commands are for g++


def commands(build):
    """The directory and words of each source's compile command, by its path."""
    entries = json.loads((build / "compile_commands.json").read_text())
    return {pathlib.Path(e["directory"], e["file"]).resolve(): (e["directory"], shlex.split(e["command"])) for e in entries}


def preprocessed(directory, words):
    """The source after preprocessing, as clang-tidy sees it, but for line numbers of system headers."""
    compiler = next(i for i, word in enumerate(words) if not word.endswith("ccache"))
    flags = words[compiler + 1:]
    output = flags.index("-o")
    flags = flags[:output] + flags[output + 2:]
    return subprocess.run([CLANG, EXTRA, *flags, "-E", "-C"], cwd=directory, check=True, stdout=subprocess.PIPE).stdout


class Tidy:
    def __init__(self, build):
        self.build = build
        self.commands = commands(build)
        self.passed = build / "passed"
        self.passed.mkdir(exist_ok=True)
        version = subprocess.run([TIDY, "--version"], check=True, stdout=subprocess.PIPE).stdout
        self.common = version + (ROOT / ".clang-tidy").read_bytes()

    def mark(self, file):
        """Where it says that this file passed as it is now."""
        text = preprocessed(*self.commands[file])
        return self.passed / hashlib.sha256(self.common + str(file).encode() + text).hexdigest()

    def check(self, file):
        """(whether it passed, whether it had before, what clang-tidy printed)"""
        if file not in self.commands:
            return False, False, "%s: no target compiles it\n" % os.path.relpath(file, ROOT)
        try:
            mark = self.mark(file)
        except subprocess.CalledProcessError:
            return False, False, "%s: preprocessing failed\n" % os.path.relpath(file, ROOT)
        if mark.exists():
            return True, True, ""
        done = subprocess.run([TIDY, "-p", str(self.build), "--quiet", "--extra-arg=" + EXTRA, str(file)], check=False,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        if done.returncode == 0:
            mark.touch()
        return done.returncode == 0, False, done.stdout + done.stderr


def progress(done, count, start):
    left = (time.monotonic() - start) / done * (count - done)
    print("clang-tidy: %d of %d files, %d min %02d s left" % (done, count, left // 60, left % 60), flush=True)


def stop_early(pool):
    """On Ctrl-C, begins no other file."""
    def stop(number, frame):
        pool.shutdown(wait=False, cancel_futures=True)
        sys.exit(128 + number)
    signal.signal(signal.SIGINT, stop)


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    tidy, files = Tidy(pathlib.Path(sys.argv[1]).resolve()), [pathlib.Path(f).resolve() for f in sys.argv[2:]]
    failed, known, start = [], 0, time.monotonic()
    with concurrent.futures.ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        results = {pool.submit(tidy.check, file): file for file in files}
        stop_early(pool)
        for done, result in enumerate(concurrent.futures.as_completed(results), 1):
            passed, before, text = result.result()
            known += before
            if not passed:
                failed.append(os.path.relpath(results[result], ROOT))
                print(text, end="")
            if done % 20 == 0 or done == len(files):
                progress(done, len(files), start)
    print("clang-tidy: %d of %d files passed, %d of them as they were" % (len(files) - len(failed), len(files), known))
    if failed:
        sys.exit("clang-tidy: failed: " + " ".join(failed))


if __name__ == "__main__":
    main()
