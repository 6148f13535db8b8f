#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What documents and comments refer to is there. Exit code 0 if so.

Links of Markdown pages: relative ones lead to a file, and with #... to a heading of it. Names of C++ and Python
files, those that move with the code: a name with a folder must be the end of a file's path; a bare name, some file's
name; files of other projects are listed below. Documents name a function as `path/file.h`: `Function`, `Another`.
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
LINK = re.compile(r"!?\[[^\]]*\]\(([^()\s]+)\)")
HEADING = re.compile(r"^#+ +(.*?) *$", re.M)


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


def prose(text):
    """Without code, in which brackets mean something else."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
    text = re.sub(r"^(    |\t).*$", "", text, flags=re.M)
    return re.sub(r"`[^`\n]*`", "", text)


def anchors(page):
    """The names that readers give to headings: GitHub, and MkDocs by its default."""
    names = set()
    for heading in HEADING.findall(re.sub(r"^```.*?^```", "", page.read_text(), flags=re.S | re.M)):
        heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        plain = re.sub(r"[^\w\- ]", "", heading.replace("`", "").lower())
        names.add(plain.replace(" ", "-"))
    return names


def problem_of(page, target):
    """What is wrong with a link of a page; None if nothing is."""
    if re.match(r"[a-z]+:", target):
        return None  # the tests ask nobody outside
    name, _, anchor = target.partition("#")
    path = (page.parent / name).resolve() if name else page
    if not path.exists():
        return "there is no such file"
    if anchor and path.suffix == ".md" and anchor not in anchors(path):
        return "there is no such heading"
    return None


def check_links(paths: List[str]) -> List[str]:
    links, wrong = 0, []
    for name in paths:
        page = ROOT / name
        for target in LINK.findall(prose(page.read_text(encoding="utf-8"))):
            links += 1
            problem = problem_of(page, target)
            if problem:
                wrong.append(f"{name}: {target}: {problem}")
    print(f"{links} links in {len(paths)} pages")
    return wrong if links > 50 else [*wrong, f"only {links} links found"]


def check_names(paths: List[str]) -> List[str]:
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
    print(f"{count} names of files in documents and comments")
    return wrong if count > 100 else [*wrong, f"only {count} names of files found in {len(paths)} files"]


def main() -> int:
    paths = files()
    wrong = check_links([p for p in paths if p.endswith(".md")]) + check_names(paths)
    print("\n".join(wrong), file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
