#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Deliberate faults: does a test see them?

    tests/mutants/mutants.py [NAME...] [--list] [--jobs N]     exit code 1 if one was not seen
    tests/mutants/mutants.py --places                          exit code 1 if the code has one's place no more

Each fault is one replacement in one file of a scratch worktree (build/mutants); its tests are built and run
there, and the fault is taken back. A line for each goes to out/mutants.tsv.
"""
import argparse
import pathlib
import subprocess
import sys
import time
from typing import List, NamedTuple

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCRATCH = ROOT / "build" / "mutants"
OUT = ROOT / "out" / "mutants.tsv"


class Mutant(NamedTuple):
    name: str
    path: str
    old: str
    new: str
    tests: List[str]  # names for ctest


MUTANTS = [
    # Kernels.
    Mutant("the budget of pixels that stop is spent twice", "src/raster/soft_mask/plan.cc",
           "plan.face_error = error * 3 / 4", "plan.face_error = error * 3", ["raster_soft_mask", "raster_extremes"]),
    Mutant("of two faces at one depth the later one is seen", "src/raster/visibility-inl.h",
           "hn::Gt(z, old)", "hn::Ge(z, old)", ["raster_visibility"]),
    Mutant("a texel's centre is at its corner", "src/shade/texture-inl.h",
           "if (!nearest) x = hn::Sub(x, hn::Set(kRun, 0.5f));", "", ["shade", "renderer_simd"]),
    Mutant("averted lights take light away", "src/shade/lambert-inl.h",
           "hn::Max(Dot(n, l.direction), hn::Zero(kRun))", "Dot(n, l.direction)", ["renderer_simd"]),
    Mutant("averted lights pull at normals", "src/shade/lambert-inl.h",
           "hn::IfThenElseZero(hn::Ge(cosine, hn::Zero(kRun)), LoadRun(d_light, i))", "LoadRun(d_light, i)",
           ["renderer_simd"]),
    Mutant("batch norm divides by the variance alone", "src/nn/kernels/batch_norm-inl.h",
           "hn::Add(variance, hn::Set(d, static_cast<float>(p.epsilon)))", "variance", ["nn_ops", "nn_pointwise"]),
    Mutant("Adam's second moment is of the gradient, not of its square", "src/nn/kernels/adam-inl.h",
           "hn::Mul(rest2, hn::Mul(g, g))", "hn::Mul(rest2, g)", ["nn_gemm"]),
    # Readers.
    Mutant("a PNG's checksums are not looked at", "src/io/image_check.cc",
           "if (crc != BigEndian(", "if (false && crc != BigEndian(", ["io_formats"]),
    Mutant("PNM rounds down", "src/io/image_readers.cc", "* 255 + most / 2) / most", "* 255) / most", ["io_formats"]),
    Mutant("SGI images stand on their heads", "src/io/image_readers.cc",
           "const std::size_t y = height - 1 - row % height", "const std::size_t y = row % height", ["io_exr_sgi"]),
    Mutant("indices of an OBJ count from 1 backwards, too", "src/io/obj_statements.cc",
           ": Count(kind) + index;", ": Count(kind) + index - (index < -1);", ["io_obj"]),
    Mutant("an accessor may reach one element too far", "src/io/gltf_model.cc",
           "count_ - 1 > (view.size()", "count_ - 2 > (view.size()", ["io_broken_gltf", "io_gltf_features", "fuzz_replay"]),
    Mutant("a sparse accessor's values are taken by index", "src/io/gltf_model.cc",
           "std::memcpy(own->data() + to * element(), values.bytes_.data() + i * values.stride_, element());",
           "std::memcpy(own->data() + i * element(), values.bytes_.data() + i * values.stride_, element());",
           ["io_gltf_features"]),
    Mutant("arrays in Fortran's order are taken as they lie", "src/io/npz.cc",
           "header->fortran && header->shape.size() > 1", "false", ["io_formats"]),
    Mutant("tensors may be larger than their data", "src/nn/serialize.cc",
           "entry.Size() != end - begin", "entry.Size() < end - begin", ["nn_serialize", "fuzz_replay"]),
    # Training.
    Mutant("the silhouette's gradient lacks a term", "src/train/losses/iou.h",
           "per_truth * s + rest * (1 - s)", "per_truth * s + rest", ["train_losses"]),
    Mutant("a damaged checkpoint is taken", "src/train/run/checkpoint.cc",
           "checksum->second == ChecksumOf(file)) return {};", "true) return {};", ["train_run"]),
    Mutant("the last model of an epoch is never drawn elsewhere", "src/train/data/batches.cc",
           "i > 1; --i)", "i > 2; --i)", ["train_run"]),
    Mutant("a mirrored camera keeps its place", "src/train/data/batches.cc",
           "  out.translation[0] = -out.translation[0];\n", "", ["train_run"]),
    Mutant("Adam's first moment is not corrected", "src/nn/optim.cc",
           "options_.learning_rate / (1.0 - std::pow(options_.beta1, t))", "options_.learning_rate", ["nn_optim"]),
    Mutant("the rate falls along a whole cosine", "src/nn/optim.h",
           "std::numbers::pi * std::min(t, 1.0)", "2 * std::numbers::pi * std::min(t, 1.0)", ["nn_optim"]),
]


def sh(words, cwd=SCRATCH, **options):
    return subprocess.run(words, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                          check=False, **options)


def prepare(build):
    if not SCRATCH.exists():
        subprocess.run(["git", "worktree", "add", "--detach", SCRATCH, "HEAD"], cwd=ROOT, check=True)
    subprocess.run(["git", "checkout", "-q", "--detach",
                    subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, check=True, text=True,
                                   stdout=subprocess.PIPE).stdout.strip()], cwd=SCRATCH, check=True)
    subprocess.run(["git", "checkout", "-q", "--", "."], cwd=SCRATCH, check=True)
    if not (SCRATCH / "build" / "release" / "build.ninja").exists():
        words = ["cmake", "--preset", "release", "-DTILEGRAD_BENCH=OFF", "-DTILEGRAD_PYTHON=OFF"]
        subprocess.run(words + build, cwd=SCRATCH, check=True, stdout=subprocess.DEVNULL)


def known_tests(names):
    """(name, target of ninja) of those that the build has."""
    listed = sh(["tests/legs/programs.py", "build/release", "^(%s)$" % "|".join(names), "--filters"]).stdout
    rows = [line.split("\t") for line in listed.splitlines()]
    return [(name, pathlib.Path(program).name) for name, program, _ in rows]


def places(mutant, root):
    """How often the text to replace stands in its file; anything but 1 is a fault of the list."""
    path = root / mutant.path
    return path.read_text(encoding="utf-8").count(mutant.old) if path.is_file() else 0


def check_places(mutants):
    lost = ["%s: %d places in %s" % (m.name, places(m, ROOT), m.path) for m in mutants if places(m, ROOT) != 1]
    print("\n".join(lost), end="\n" if lost else "")
    return 1 if lost else 0


def seen_by(mutant, jobs):
    """What noticed it: a test, the compiler, or nothing."""
    if places(mutant, SCRATCH) != 1:
        return "NOT APPLIED: %d places" % places(mutant, SCRATCH)
    path = SCRATCH / mutant.path
    text = path.read_text(encoding="utf-8")
    tests = known_tests(mutant.tests)
    if not tests:
        return "NOT APPLIED: no such test"
    try:
        path.write_text(text.replace(mutant.old, mutant.new), encoding="utf-8")
        for test, program in tests:
            if sh(["ninja", "-C", "build/release", "-j%d" % jobs, program]).returncode != 0:
                return "the compiler"
            if sh(["ctest", "--test-dir", "build/release", "-L", "short", "-R", "^%s$" % test]).returncode:
                return test
        return ""
    finally:
        path.write_text(text, encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="parts of names; default: all")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--places", action="store_true")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--cmake", action="append", default=[], help="an option for cmake")
    arguments = parser.parse_args()
    chosen = [m for n in arguments.names or [""] for m in MUTANTS if n in m.name or n in m.path]  # in the order asked for
    if arguments.list:
        print("\n".join("%-60s %s" % (m.name, m.path) for m in chosen))
        return 0
    if arguments.places:
        return check_places(chosen)
    prepare(arguments.cmake)
    OUT.parent.mkdir(parents=True, exist_ok=True)
    missed = 0
    for mutant in chosen:
        start = time.monotonic()
        seen = seen_by(mutant, arguments.jobs)
        missed += not seen or seen.startswith("NOT")
        line = "%s\t%s\t%s" % (mutant.name, mutant.path, seen or "NOTHING")
        print("%s\t%.0f s" % (line, time.monotonic() - start), flush=True)
        with open(OUT, "a", encoding="utf-8") as stream:
            stream.write(line + "\n")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
