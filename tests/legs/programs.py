#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The programs behind the short tests of a build tree.

    tests/legs/programs.py BUILD REGEX            each program once, as a target of ninja
    tests/legs/programs.py BUILD REGEX --filters  for each test: its name, the path of its program, its filter of GoogleTest

Only tests that are programs of GoogleTest are listed.
"""
import json
import pathlib
import re
import subprocess
import sys


def programs(build, pattern):
    """(name, path, filter) of each short test whose name matches."""
    shown = subprocess.run(["ctest", "--test-dir", build, "-L", "short", "--show-only=json-v1"], check=True,
                           stdout=subprocess.PIPE, text=True).stdout
    for test in json.loads(shown)["tests"]:
        command = test.get("command", [])
        filters = [word for word in command if word.startswith("--gtest_filter=")]
        if filters and re.search(pattern, test["name"]):
            program = next(word for word in command if word.endswith("_test"))  # an emulator may stand before it
            yield test["name"], program, filters[0]


def main():
    found = list(programs(sys.argv[1], sys.argv[2]))
    if "--filters" in sys.argv[3:]:
        print("\n".join("\t".join(row) for row in found))
    else:
        print("\n".join(sorted({pathlib.Path(path).name for _, path, _ in found})))


if __name__ == "__main__":
    main()
