#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Files that documents and comments name exist, and so do functions in them. Exit code 0 if so.

A name with a folder must be the end of a file's path; a bare name, some file's name. Names of C++ and Python
files only, those that move with the code; files of other projects are listed below. Documents name a function
as `path/file.h`: `Function`, `Another`.
"""
import pathlib
import re
import subprocess
import sys
from typing import Iterator, List, Tuple

ROOT = pathlib.Path(__file__).resolve().parents[2]
NAME = re.compile(r"(?<![\w./<*{-])((?:[\w.-]+/)*[\w-]+\.(?:h|cc|py|sh))(?![\w*])")
NAMES_IN_FILE = re.compile(r"`([\w./-]+\.(?:h|cc|py))`: ((?:`\w+`(?:, )?)+)")
COMMENT = re.compile(r"(?://|#).*")
# Of other projects, or written by the program.
FOREIGN = {"app.cc"}
# Names that stand for any: x.h, x_ref.h; and mine and softras, the
# examples of the pages on adding things.
ANY = re.compile(r"(.*/)?((x|mine|softras)(_ref|-inl|_test|_bench)?|cmd_mine|mine/\w+)\.(h|cc)")


def files() -> List[str]:
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "-z"], cwd=ROOT, check=True,
                            capture_output=True, text=True).stdout.split("\0")
    return [f for f in listed if f and (ROOT / f).is_file()]


def named(path: str) -> Iterator[Tuple[int, str]]:
    """(line, name) of every file that a document, or a comment of a source file, names."""
    document = path.endswith(".md")
    for number, line in enumerate((ROOT / path).read_text(encoding="utf-8").splitlines(), 1):
        comment = None if document or re.match(r"\s*#\s*include", line) else COMMENT.search(line)
        text = line if document else comment.group() if comment else ""
        for name in NAME.findall(text):
            yield number, name


def missing_functions(path: str) -> List[str]:
    """Names in documents that the file beside them does not hold; files are given from the root."""
    wrong = []
    for file, names in NAMES_IN_FILE.findall((ROOT / path).read_text(encoding="utf-8")):
        if ANY.fullmatch(file):
            continue
        text = (ROOT / file).read_text(encoding="utf-8") if (ROOT / file).is_file() else ""
        wrong += [f"{path}: {file} has no {name}" for name in re.findall(r"\w+", names)
                  if not re.search(rf"\b{name}\b", text)]
    return wrong


def main() -> int:
    paths = files()
    ends = {"/".join(p.split("/")[i:]) for p in paths for i in range(p.count("/") + 1)}
    count, wrong = 0, []
    for path in paths:
        if not path.endswith((".md", ".h", ".cc", ".py", "CMakeLists.txt")) or path == "CHANGELOG.md":
            continue
        if path.endswith(".md"):
            wrong += missing_functions(path)
        for line, name in named(path):
            count += 1
            name = re.sub(r"^(\.\./)+", "", name)
            if name not in ends and name not in FOREIGN and not ANY.fullmatch(name):
                wrong.append(f"{path}:{line}: there is no {name}")
    if count < 100:
        wrong.append(f"only {count} names of files found in {len(paths)} files")
    print(f"{count} names of files in documents and comments")
    print("\n".join(wrong), file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
