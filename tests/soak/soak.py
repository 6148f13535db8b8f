#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Kills the program over and over, with SIGKILL, at random moments of everything that it does.

    tests/soak/soak.py PROGRAM KILLS [--folder FOLDER] [--seed N] [--only NAME]     exit code 1 if anything was lost

After each kill every file that stands under its own name must be whole, and the same command, given again (with --resume
or --force where it wants to be told so), must go on. When it is through, its results must be those of a command that nobody killed: the same bytes,
weights tensor by tensor. Then what the system may refuse is refused to each (refusals.py). Counts are added to
soak.tsv in FOLDER (default out/soak).
"""
import argparse
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import time

from jobs import jobs, prepare
from refusals import Refusals
from whole import Lost, check_folder


class Soak:
    def __init__(self, program, folder, seed):
        self.program, self.folder = program, folder
        self.rng = random.Random(seed)
        self.counts = {}

    def command(self, words):
        return [str(self.program)] + [str(w) for w in words]

    def run(self, words, **options):
        return subprocess.run(self.command(words), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False,
                              text=True, errors="replace", **options)

    def must(self, words, **options):
        done = self.run(words, **options)
        if done.returncode != 0:
            raise Lost("exit code %d of %s:\n%s" % (done.returncode, " ".join(map(str, words)), done.stdout))
        return done

    def killed(self, words, most):
        """Whether it was killed; else it came through."""
        child = subprocess.Popen(self.command(words), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            if child.wait(timeout=self.rng.uniform(0, most)) != 0:
                self.must(words)  # says why
                raise Lost("%s failed once" % words)
            return False
        except subprocess.TimeoutExpired:
            child.send_signal(signal.SIGKILL)
            return child.wait() == -signal.SIGKILL

    def soak(self, job, reference, most, kills):
        """Kills `job` so often; starts anew whenever it came through."""
        done = 0
        while done < kills:
            job.prepare()
            words, rounds, through = job.words, 0, False
            while done < kills and rounds < 12 and not through:
                through = not self.killed(words, most)
                if not through:
                    done, rounds = done + 1, rounds + 1
                if job.out.exists():
                    check_folder(job.out)
                words = job.next()
            if not through:
                self.must(words)
            check_folder(job.out)
            left = [p for p in job.out.rglob("*.tmp")]
            if left:
                raise Lost("%s is left" % left[0])
            if job.results(job.out) != reference:
                raise Lost("%s: another result than without a kill" % job.name)
        self.counts[job.name] = self.counts.get(job.name, 0) + done

    def one(self, job, kills):
        job.prepare()
        start = time.monotonic()
        self.must(job.words)
        took = time.monotonic() - start
        reference = job.results(job.out)
        self.soak(job, reference, 1.2 * took, kills)
        print("%-24s %5d kills, %.2f s without" % (job.name, self.counts[job.name], took), flush=True)
        Refusals(self).all(job, reference)
        shutil.rmtree(job.out, ignore_errors=True)

    def record(self, before, state):
        """Counts of one job, as soon as it is through."""
        with open(self.folder.parent / "soak.tsv", "a", encoding="utf-8") as stream:
            for name, count in self.counts.items():
                if count > before.get(name, 0):
                    stream.write("%s\t%s\t%d\t%s\n" % (time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()), name,
                                                       count - before.get(name, 0), state))


def main():
    os.environ["TILEGRAD_THREADS"] = "1"
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("kills", type=int)
    parser.add_argument("--folder", type=pathlib.Path, default=pathlib.Path("out/soak"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    soak = Soak(arguments.program.resolve(), arguments.folder.resolve() / "work", arguments.seed)
    shutil.rmtree(soak.folder, ignore_errors=True)
    prepare(soak)
    chosen = [j for j in jobs(soak.folder) if arguments.only in j.name]
    lost = 0
    for index, job in enumerate(chosen):
        share = (arguments.kills * (index + 1)) // len(chosen) - (arguments.kills * index) // len(chosen)
        before = dict(soak.counts)
        try:
            soak.one(job, share)
            soak.record(before, "whole")
        except Lost as error:
            print("LOST: %s: %s" % (job.name, error), flush=True)
            soak.record(before, "lost")
            lost += 1
    for name in sorted(soak.counts):
        print("%-24s %5d" % (name, soak.counts[name]))
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
