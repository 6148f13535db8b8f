#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The programs behind the short tests of a build tree.

    tests/legs/programs.py BUILD REGEX            each program once, as a target of ninja
    tests/legs/programs.py BUILD REGEX --filters  for each test: its name, the path of its program, its filter of GoogleTest

Only tests that are programs of GoogleTest are listed.
"""
import pathlib
import re
import sys

# As CMake writes them: add_test(io_obj "BUILD/tests/io_test" "--gtest_filter=..." ...). An emulator may stand before the program.
# (ctest's own list leaves out programs that are not built yet.)
TEST = re.compile(r'^add_test\((?:\[=*\[)?(\w+)(?:\]=*\])? .*?"([^"]*_test)" "(--gtest_filter=[^"]*)"', re.MULTILINE)


def programs(build, pattern):
    """(name, path, filter) of each short test whose name matches."""
    for path in sorted(pathlib.Path(build).glob("*/**/CTestTestfile.cmake")):
        for name, program, chosen in TEST.findall(path.read_text()):
            if re.search(pattern, name) and not name.endswith("_long"):
                yield name, program, chosen


def main():
    found = list(programs(sys.argv[1], sys.argv[2]))
    if "--filters" in sys.argv[3:]:
        print("\n".join("\t".join(row) for row in found))
    else:
        print("\n".join(sorted({pathlib.Path(path).name for _, path, _ in found})))


if __name__ == "__main__":
    main()
