#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds the tables of docs/files.md to the tests that their last column names.

files_table.py DOCS/files.md CASES_TABLE.py TEST_PROGRAM...: each row of a table whose last column is
"test" names tests of the programs, or files of the table of cases; all of them exist, and the tests
pass. A table without such a column, under a heading that has one, is not looked at.
"""

import pathlib
import re
import subprocess
import sys

FEWEST_ROWS = 25  # so that a table whose form has changed is not passed over


def rows(text: str) -> list[tuple[str, list[str]]]:
    """(first cell, names in the last cell) of every row of tables whose last column is "test"."""
    out, inside = [], False
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if not line.startswith("|"):
            inside = False
        elif cells[-1] == "test":
            inside = True
        elif inside and set(cells[-1]) != {"-"}:
            out.append((cells[0], re.findall(r"`([^`]+)`", cells[-1])))
    return out


def tests_of(program: str) -> dict[str, str]:
    """Full names of the tests of a GoogleTest program by their own names."""
    listed = subprocess.run([program, "--gtest_list_tests"], capture_output=True, text=True, check=True)
    out, suite = {}, ""
    for line in listed.stdout.splitlines():
        if line.startswith("  "):
            out[line.split()[0]] = suite + line.split()[0]
        elif line.endswith("."):
            suite = line
    return out


def main() -> int:
    table, cases, programs = sys.argv[1], pathlib.Path(sys.argv[2]).read_text(), sys.argv[3:]
    known = {program: tests_of(program) for program in programs}
    wanted: dict[str, set[str]] = {program: set() for program in programs}
    wrong, found = [], rows(pathlib.Path(table).read_text())
    for feature, names in found:
        if not names:
            wrong.append(f"{feature}: names no test")
        for name in names:
            homes = [program for program in programs if name in known[program]]
            if not homes and f'"{name}"' not in cases:
                wrong.append(f"{feature}: there is no test or case {name}")
            for program in homes:
                wanted[program].add(known[program][name])
    if len(found) < FEWEST_ROWS:
        wrong.append(f"only {len(found)} rows name tests")
    for program, tests in wanted.items():
        if tests and subprocess.run([program, "--gtest_brief=1",
                                     "--gtest_filter=" + ":".join(sorted(tests))]).returncode != 0:
            wrong.append(f"{program}: a test fails")
    print("\n".join(wrong) or f"{len(found)} rows hold")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
