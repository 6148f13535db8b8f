#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""No comma joins two statements of C or C++ outside the header of a `for`. Exit code 0 if so.

Works from the inside out: a pass replaces each pair of brackets that holds no other by one character, and looks at
the statements of a block, or at what stands in parentheses. Declarations and folds keep their commas; macros are
not looked into.
"""
import pathlib
import re
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from typing import List

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDERS = ("src/", "include/", "python/", "bench/", "examples/", "tests/")

# What replaces them: @ parentheses, # square brackets, ` a block, $ other braces, " a string.
NOT_CODE = re.compile(r"""//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|(?<!\w)'(?:\\.|[^'\\\n])+'"""
                      r"""|^[ \t]*\#(?:\\\n|[^\n])*""", re.S | re.M)
PAIR = re.compile(r"\([^()[\]{}]*\)|\[[^()[\]{}]*\]|\{[^()[\]{}]*\}")
TEMPLATE_ARGUMENTS = re.compile(r"(?<=\w)<[^<>;=!|?]*>")
# Ends before parentheses whose commas separate arguments, and before an empty block.
TAKES_ARGUMENTS = re.compile(r"(?:(?<!\breturn)(?<!\bif)(?<!\bwhile)(?<!\bswitch)[\w>)\]}@#$]|\boperator\W+)\s*$")
TAKES_BLOCK = re.compile(r"(?:[@#)\]]|\b(?:else|do|const|noexcept|override))\s*$")
LAMBDA = re.compile(r"#\s*(?:@\s*)?(?:mutable\s*|->[\w:<>&*,\s]+)?`")
INTRODUCTION = re.compile(r"(?:\s+|(?:else|do)\b|(?:if|for|while|switch)\b\s*(?:constexpr\s*)?@"
                          r"|(?:case\b.*?|\w+\s*)(?<!:):(?!:))*", re.S)
DECLARATION = re.compile(r"(?!(?:return|throw|delete)\b)(?:alignas@\s*)?(?:[\w:]+(?:[*&]+\s*|\s+))+[*&]*\w"
                         r"|[\w:]+@\s*(?:noexcept\s*)?:|(?:explicit|using|template|operator)\b")
SAMPLE = """int F(std::map<int, int> m) {
  int a = 1, b = G(m, [&] { return a; });
  for (a = 0, b = 1; a < b; ++a, ++b) G(a, b);
  if (a == b) a = 2, b = 3;
  const auto h = [&](int c, int d) { m = {{1, 2}}, a = c; };
  return H(h), b;
}
"""


class Reader:
    """Finds the lines of one file on which a comma joins statements."""

    def __init__(self, code: str):
        self.lines: List[int] = []
        code, count = NOT_CODE.sub(lambda m: keep_lines('"' if m[0][0] in "R\"'" else " ", m[0]), code), 1
        while count:
            code, count = PAIR.subn(self.replace, code)
        self.read_statements(code, 0, code)

    def replace(self, pair: re.Match) -> str:
        code, start, inside = pair.string, pair.start(), pair[0][1:-1]
        before = code[max(0, start - 100):start]
        if pair[0][0] == "(":
            if "," in without_templates(inside) and "..." not in inside and not TAKES_ARGUMENTS.search(before):
                self.lines.append(line_of(code, start))
            return keep_lines("@", pair[0])
        if pair[0][0] == "[":
            return keep_lines("#", pair[0])
        inside = without_lambdas(inside)
        if not (";" in inside or "`" in inside or not inside.strip() and TAKES_BLOCK.search(before)):
            return keep_lines("$", pair[0])
        self.read_statements(code, start + 1, inside)
        return keep_lines("`", pair[0])

    def read_statements(self, code: str, start: int, text: str) -> None:
        for statement in re.split("([;`])", text):
            begin = INTRODUCTION.match(statement).end()
            plain = without_templates(statement[begin:])
            if "," in plain and not DECLARATION.match(plain):
                self.lines.append(line_of(code, start + begin))
            start += len(statement)


def keep_lines(replacement: str, text: str) -> str:
    return replacement + "\n" * text.count("\n")


def line_of(code: str, at: int) -> int:
    return code.count("\n", 0, at) + 1


def without_lambdas(text: str) -> str:
    return LAMBDA.sub(lambda m: "$" + re.sub(r"[^\n]", " ", m[0][1:]), text)


def without_templates(text: str) -> str:
    count = 1
    while count and "," in text:
        text, count = TEMPLATE_ARGUMENTS.subn("_", text)
    return text


def check(path: str) -> List[str]:
    return [f"{path}:{line}: a comma joins statements" for line in sorted(Reader((ROOT / path).read_text()).lines)]


def main() -> int:
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "*.h", "*.cc", "*.c"], cwd=ROOT,
                            check=True, capture_output=True, text=True).stdout.split()
    paths = [p for p in listed if p.startswith(FOLDERS) and (ROOT / p).is_file()]
    if Reader(SAMPLE).lines != [5, 4, 6]:  # from the inside out
        print("commas: does not find those of its own sample", file=sys.stderr)
        return 1
    with ProcessPoolExecutor() as pool:
        wrong = [line for lines in pool.map(check, paths, chunksize=20) for line in lines]
    print(f"{len(paths)} files")
    for line in wrong:
        print(line, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
