#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds files, functions and parameter lists to their limits; prints the median of each folder.

    tests/structure/sizes.py        exit code 0 if everything is within its limits

Functions are found by universal-ctags; a function's lines run from its name to its closing brace. A
limit that cannot be kept has its exception below, with the reason and a limit of its own. An exception
that is no longer needed is an error, too, so that the lists shrink with their reasons.
"""
import collections
import json
import pathlib
import statistics
import subprocess
import sys
from typing import Dict, Iterable, List, NamedTuple

ROOT = pathlib.Path(__file__).resolve().parents[2]
CPP = (".h", ".cc", ".c")
FOLDERS = ("src", "include", "python", "bench", "examples", "tests")

FILE_LINES = 500
FUNCTION_LINES = 50
MEDIAN_LINES = 10  # of a folder's functions: must stay below
PARAMETERS = 7  # C++; Python has keyword arguments

# Path -> (limit, reason).
LONG_FILES = {}

# (path, function) -> (limit, reason).
LONG_FUNCTIONS = {}

# (path, function) -> (limit, reason).
ADJOINT = "an adjoint of a reference: what went in, what came out, and the derivative of each"
LONG_PARAMETER_LISTS = {
    ("src/compat/pytorch3d_fragment.h", "FragmentBackward"): (8, ADJOINT),
    ("src/io/gltf_model.cc", "KeepEncoded"): (9, "tinygltf's callback"),
    ("src/raster/interpolate_ref.h", "InterpolateRefBackward"): (9, ADJOINT),
    ("src/train/data/sources/procedural.cc", "ChairBack"): (8, "measures of a piece of furniture"),
    ("src/train/data/sources/procedural.cc", "Wings"): (8, "measures of a pair of wings"),
}
# Their lambdas take the arguments of the Python function that they bind.
KEYWORD_ARGUMENTS = "python/bindings/"


class Function(NamedTuple):
    path: str
    name: str
    line: int
    lines: int
    parameters: int


def files() -> List[str]:
    """Every C++ and Python file that git tracks or would track."""
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "-z"], cwd=ROOT, check=True,
                            capture_output=True, text=True).stdout.split("\0")
    return sorted(f for f in listed
                  if f.endswith(CPP + (".py",)) and f.startswith(FOLDERS) and (ROOT / f).is_file())


def count_parameters(signature: str) -> int:
    """Of "(const std::map<int,int>& a,int b)": 2."""
    inside = signature.strip()[1:signature.rfind(")")].strip()
    if inside in ("", "void"):
        return 0
    depth = commas = 0
    for character in inside:
        depth += (character in "(<[{") - (character in ")>]}")
        commas += character == "," and depth == 0
    return commas + 1


def functions(paths: Iterable[str]) -> List[Function]:
    command = ["ctags", "--options=NONE", "--languages=C++,Python", "--langmap=C++:+.h.c", "--kinds-C++=f",
               "--kinds-Python=fm", "--fields=+neS", "--output-format=json", "-f", "-", "-L", "-"]
    tags = subprocess.run(command, cwd=ROOT, input="\n".join(paths), check=True, capture_output=True,
                          text=True).stdout
    found = []
    for tag in map(json.loads, tags.splitlines()):
        name = "lambda" if tag["name"].startswith("__anon") else tag["name"]
        found.append(Function(tag["path"], name, tag["line"], tag["end"] - tag["line"] + 1,
                              count_parameters(tag.get("signature", "()"))))
    return found


class Check:
    """Compares numbers with their limits, and remembers which exceptions were needed."""

    def __init__(self, exceptions: Dict, unit: str):
        self.exceptions, self.unit, self.needed = exceptions, unit, set()
        self.errors: List[str] = []

    def hold(self, key, place: str, number: int, limit: int) -> None:
        if number > limit and key in self.exceptions:
            self.needed.add(key)
            limit = self.exceptions[key][0]
        if number > limit:
            self.errors.append(f"{place}: {number} {self.unit}, at most {limit}")

    def finish(self) -> List[str]:
        return self.errors + [f"{key}: its exception from the limit of {self.unit} is not needed; remove it"
                              for key in self.exceptions if key not in self.needed]


def check_files(paths: List[str]) -> List[str]:
    check = Check(LONG_FILES, "lines")
    for path in paths:
        lines = (ROOT / path).read_bytes().count(b"\n")
        check.hold(path, path, lines, FILE_LINES)
    return check.finish()


def check_functions(found: List[Function]) -> List[str]:
    lines, parameters = Check(LONG_FUNCTIONS, "lines"), Check(LONG_PARAMETER_LISTS, "parameters")
    for function in found:
        key, place = (function.path, function.name), f"{function.path}:{function.line}: {function.name}"
        lines.hold(key, place, function.lines, FUNCTION_LINES)
        if not function.path.endswith(".py") and not function.path.startswith(KEYWORD_ARGUMENTS):
            parameters.hold(key, place, function.parameters, PARAMETERS)
    return lines.finish() + parameters.finish()


def check_medians(found: List[Function]) -> List[str]:
    errors, by_folder = [], collections.defaultdict(list)
    for function in found:
        by_folder[function.path.split("/")[0]].append(function.lines)
    for folder, lines in sorted(by_folder.items()):
        median = statistics.median(lines)
        print(f"{folder:9}{len(lines):5} functions: median {median:g} lines, "
              f"p90 {sorted(lines)[len(lines) * 9 // 10]}, longest {max(lines)}")
        if median >= MEDIAN_LINES:
            errors.append(f"{folder}/: the median function has {median:g} lines, must be below {MEDIAN_LINES}")
    return errors


def main() -> int:
    paths = files()
    found = functions(paths)
    if len(found) < 1000:  # ctags changed its ways: everything would pass
        print(f"sizes: only {len(found)} functions found in {len(paths)} files", file=sys.stderr)
        return 1
    errors = check_medians(found) + check_files(paths) + check_functions(found)
    for error in errors:
        print(error, file=sys.stderr)
    return 1 if errors else 0


if __name__ == "__main__":
    sys.exit(main())
