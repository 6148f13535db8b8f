#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Kills the program over and over, with SIGKILL, at random moments of everything that it does.

    tests/soak/soak.py PROGRAM KILLS [--folder FOLDER] [--seed N]     exit code 1 if anything was lost

After each kill every file that stands under its own name must be whole, and the same command, given again,
must go on. When it is through, its results must be those of a command that nobody killed: the same bytes,
weights tensor by tensor. Then a full disk, a folder that cannot be written, few file handles, little memory and
a reader that goes away: each ends in a message, and what was written before stays whole. Counts are added to
soak.tsv in FOLDER (default out/soak).
"""
import argparse
import json
import os
import pathlib
import random
import resource
import shutil
import signal
import struct
import subprocess
import sys
import time
import zipfile
import zlib

TINY = """name = "tiny"
[task]
kind = "%s"
[network]
%s
[schedule]
batch = 4
steps = %d
checkpoint_every = 2
log_every = 1
sample_every = 6
"""
NETWORKS = {
    "single_image": "channels = 2\ncode = 8\nhidden1 = 8\nhidden2 = 8\ntemplate_level = 1",
    "textured_image": "base = 2\nmost = 4\nlevels = 2\nlatent = 6\nhidden = 5\nlight_width = 4\ntemplate_level = 1",
    "classify": "channels = 4\nmost = 8\nlevels = 2",
}
STEPS = {"single_image": 30, "textured_image": 6, "classify": 30}


class Lost(Exception):
    """Something was lost, or half-written, or unclear."""


# ---- Whether a file is whole.

def check_png(data):
    at = 8
    while True:
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 4:at + 8 + length]
        if struct.unpack(">I", data[at + 8 + length:at + 12 + length])[0] != zlib.crc32(body):
            raise Lost("a chunk of a PNG is damaged")
        at += 12 + length
        if kind == b"IEND":
            return


def check_safetensors(data):
    size = struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8:8 + size])
    end = max([t["data_offsets"][1] for name, t in header.items() if name != "__metadata__"] or [0])
    if len(data) != 8 + size + end:
        raise Lost("a checkpoint is cut short")


def check_glb(data):
    if data[:4] != b"glTF" or struct.unpack("<I", data[8:12])[0] != len(data):
        raise Lost("a GLB is cut short")


def check_lines(data):
    for line in data.decode().split("\n")[:-1]:  # the last one may be cut: appended, not replaced
        json.loads(line)


def check_npz(path):
    with zipfile.ZipFile(path) as archive:
        if archive.testzip():
            raise Lost("an array is damaged")


def check_html(data):
    if b"</html>" not in data:
        raise Lost("a page is cut short")


def check_webp(data):
    if struct.unpack("<I", data[4:8])[0] + 8 != len(data):
        raise Lost("an animation is cut short")


CHECKS = {".png": check_png, ".safetensors": check_safetensors, ".glb": check_glb, ".html": check_html,
          ".json": lambda data: json.loads(data), ".jsonl": check_lines, ".webp": check_webp}


def check_folder(folder):
    """Everything that stands under its own name is whole."""
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        if path.name.endswith(".tmp") or path.name == "lock":
            continue
        try:
            if path.suffix == ".npz":
                check_npz(path)
            elif path.suffix in CHECKS:
                CHECKS[path.suffix](path.read_bytes())
        except Exception as error:
            raise Lost("%s: %s: %s" % (path, type(error).__name__, error)) from error


# ---- Results: what must be the same in the end.

def tensors_of(path):
    """The bytes of all tensors and their names; not the metadata, which holds seconds."""
    data = path.read_bytes()
    size = struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8:8 + size])
    header.pop("__metadata__", None)
    return sorted((name, t["shape"], data[8 + size + t["data_offsets"][0]:8 + size + t["data_offsets"][1]])
                  for name, t in header.items())


def newest_weights(folder):
    files = sorted((folder / "checkpoints").glob("step_*.safetensors"))
    if not files:
        raise Lost("%s has no checkpoint" % folder)
    return files[-1].name, tensors_of(files[-1])


def bytes_of(folder, patterns):
    """Contents by name."""
    files = sorted({p for pattern in patterns for p in folder.glob(pattern) if p.is_file()})
    if not files:
        raise Lost("%s has nothing like %s" % (folder, patterns))
    return {str(p.relative_to(folder)): p.read_bytes() for p in files}


class Job:
    """A command, the folder it writes, and what of it must be the same in the end."""

    def __init__(self, name, words, out, results, again=(), before=None):
        self.name, self.words, self.out = name, words, out
        self.results, self.again, self.before = results, list(again), before
        # Whether there is something to go on with: a command that wants to be told is told.
        self.begun = lambda folder: any(folder.glob("checkpoints/*.safetensors"))


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
            child.wait()
            return True

    def soak(self, job, reference, most, kills):
        """Kills `job` so often; starts anew whenever it came through."""
        done = 0
        while done < kills:
            if job.out.exists():
                shutil.rmtree(job.out)
            if job.before:
                job.before()
            words, rounds, through = job.words, 0, False
            while done < kills and rounds < 12 and not through:
                through = not self.killed(words, most)
                if not through:
                    done, rounds = done + 1, rounds + 1
                if job.out.exists():
                    check_folder(job.out)
                words = job.words + (job.again if job.begun(job.out) else [])
            if not through:
                self.must(words)
            check_folder(job.out)
            left = [p for p in job.out.rglob("*.tmp")]
            if left:
                raise Lost("%s is left" % left[0])
            if job.results(job.out) != reference:
                raise Lost("%s: another result than without a kill" % job.name)
        self.counts[job.name] = self.counts.get(job.name, 0) + done

    def jobs(self):
        f = self.folder
        data, views = f / "data", f / "views"
        yield Job("dataset", ["dataset", "--source", "procedural", "--per-class", "3", "--size", "16", "--views", "2",
                              "--out", f / "dataset"], f / "dataset",
                  lambda out: bytes_of(out, ["dataset.json", "models.jsonl", "models/*/*.npz", "contact_sheet.png"]))
        for kind in NETWORKS:
            config = f / (kind + ".toml")
            config.write_text(TINY % (kind, NETWORKS[kind], STEPS[kind]))
            run = f / ("run_" + kind)
            yield Job("train " + kind, ["train", "--config", config, "--data", data, "--out", run], run,
                      newest_weights, ["--resume"])
        run = f / "trained"
        yield Job("fit", ["fit", views, "--out", f / "fit", "--steps", "20", "--template-level", "2"], f / "fit",
                  lambda out: bytes_of(out, ["*.glb"]), ["--resume"])

        def fresh(name):
            def copy():
                shutil.copytree(run, f / name)
            return copy
        yield Job("eval", ["eval", "--run", f / "e", "--data", data, "--views-per-model", "1"], f / "e",
                  lambda out: bytes_of(out, ["eval.json", "eval.md"]), before=fresh("e"))
        yield Job("report", ["report", "--run", f / "r", "--data", data, "--models", "1"], f / "r",
                  lambda out: bytes_of(out, ["summary.png"]), before=fresh("r"))
        yield Job("predict", ["predict", "--run", run, "--refine", "1", "--out", f / "p", f / "view.png"], f / "p",
                  lambda out: bytes_of(out, ["*.glb", "*.png"]))
        yield Job("render", ["render", f / "ball.obj", "--size", "300", "--out", f / "d" / "drawn.png"], f / "d",
                  lambda out: bytes_of(out, ["*.png"]))

    def prepare(self):
        f = self.folder
        f.mkdir(parents=True, exist_ok=True)
        self.must(["dataset", "--source", "procedural", "--per-class", "3", "--size", "16", "--views", "2", "--out",
                   f / "data"])
        config = f / "trained.toml"
        config.write_text(TINY % ("single_image", NETWORKS["single_image"], 2))
        self.must(["train", "--config", config, "--data", f / "data", "--out", f / "trained"])
        self.must(["dataset-view", "--data", f / "data", "--split", "test", "--out", f / "view.png"])
        (f / "ball.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n")
        self.must(["views", f / "ball.obj", "--views", "4", "--size", "24", "--out", f / "views"])


# ---- What the system refuses.

def limit(which, most):
    return lambda: resource.setrlimit(which, (most, most))


def check_refusals(soak):
    """Each: (what, exit code and message); raises Lost where the message does not say it."""
    f = soak.folder
    words = ["train", "--config", f / "single_image.toml", "--data", f / "data", "--out", f / "refused"]

    def refused(what, done, *parts):
        if done.returncode == 0:
            raise Lost("%s: it went well" % what)
        if done.returncode < 0:
            raise Lost("%s: ended by signal %d:\n%s" % (what, -done.returncode, done.stdout))
        if not any(part in done.stdout for part in parts):
            raise Lost("%s: unclear: %s" % (what, done.stdout))
        if (f / "refused").exists():
            check_folder(f / "refused")
        soak.counts[what] = soak.counts.get(what, 0) + 1

    refused("few file handles", soak.run(words, preexec_fn=limit(resource.RLIMIT_NOFILE, 6)), "Too many open files",
            "file handles", "descriptors")
    shutil.rmtree(f / "refused", ignore_errors=True)
    refused("little memory", soak.run(words, preexec_fn=limit(resource.RLIMIT_AS, 180 << 20)), "memory")
    shutil.rmtree(f / "refused", ignore_errors=True)
    refused("large files", soak.run(words, preexec_fn=limit(resource.RLIMIT_FSIZE, 4096)), "File too large", "too large")
    shutil.rmtree(f / "refused", ignore_errors=True)
    soak.must(words)
    check_folder(f / "refused")
    shutil.rmtree(f / "refused")
    # A reader that goes away: no message can be written, but the run is whole.
    with subprocess.Popen(soak.command(words), stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as child:
        child.stdout.close()
        child.wait()
    check_folder(f / "refused")
    shutil.rmtree(f / "refused")
    soak.counts["a reader that goes away"] = soak.counts.get("a reader that goes away", 0) + 1
    if os.geteuid() == 0:
        check_disks(soak, words, refused)


def check_disks(soak, words, refused):
    """A disk that fills at any moment, and one that cannot be written: with root only."""
    disk = soak.folder / "disk"
    disk.mkdir(exist_ok=True)
    place = words[:-1] + [disk / "run"]
    for kib in (64, 160, 256, 400, 700):
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=%dk" % kib, "tmpfs", disk], check=True)
        try:
            done = soak.run(place)
            if done.returncode != 0:
                refused("full disk", done, "No space left")
            check_folder(disk)
            subprocess.run(["mount", "-o", "remount,size=64m", disk], check=True)
            resumed = soak.run(place + ["--resume"])
            if resumed.returncode != 0:
                raise Lost("a run does not go on once there is space:\n" + resumed.stdout)
            check_folder(disk)
            subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
            refused("read-only disk", soak.run(place + ["--resume", "--steps", "60"]), "Read-only file system")
        finally:
            subprocess.run(["umount", disk], check=True)


def main():
    os.environ["TILEGRAD_THREADS"] = "1"
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("kills", type=int)
    parser.add_argument("--folder", type=pathlib.Path, default=pathlib.Path("out/soak"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    soak = Soak(arguments.program.resolve(), arguments.folder.resolve(), arguments.seed)
    shutil.rmtree(soak.folder / "work", ignore_errors=True)
    soak.folder = soak.folder / "work"
    soak.prepare()
    jobs = [j for j in soak.jobs() if arguments.only in j.name]
    code = 0
    try:
        for index, job in enumerate(jobs):
            share = (arguments.kills * (index + 1)) // len(jobs) - (arguments.kills * index) // len(jobs)
            if job.before:
                job.before()
            start = time.monotonic()
            soak.must(job.words)
            took = time.monotonic() - start
            reference = job.results(job.out)
            soak.soak(job, reference, 1.2 * took, share)
            print("%-24s %5d kills, %.2f s without" % (job.name, soak.counts[job.name], took), flush=True)
            shutil.rmtree(job.out)
        if not arguments.only:
            check_refusals(soak)
    except Lost as error:
        print("LOST: %s" % error)
        code = 1
    with open(soak.folder.parent / "soak.tsv", "a", encoding="utf-8") as stream:
        for name, count in soak.counts.items():
            stream.write("%s\t%s\t%d\t%s\n" % (time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()), name, count,
                                               "lost" if code else "whole"))
    for name in sorted(soak.counts):
        print("%-24s %5d" % (name, soak.counts[name]))
    return code


if __name__ == "__main__":
    sys.exit(main())
