# SPDX-License-Identifier: Apache-2.0
"""Every link of the Markdown pages that git tracks leads somewhere: relative ones to a file that is
there, and with #... to a heading of it."""

import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
LINK = re.compile(r"!?\[[^\]]*\]\(([^()\s]+)\)")
HEADING = re.compile(r"^#+ +(.*?) *$", re.M)


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


def main():
    files = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "*.md"], cwd=ROOT,
                           capture_output=True, text=True, check=True).stdout.split()
    links, wrong = 0, []
    for name in files:
        page = ROOT / name
        if not page.exists():
            continue
        for target in LINK.findall(prose(page.read_text())):
            links += 1
            problem = problem_of(page, target)
            if problem:
                wrong.append(f"{name}: {target}: {problem}")
    print(f"{links} links in {len(files)} pages")
    sys.exit("\n".join(wrong) if wrong or links < 50 else 0)


if __name__ == "__main__":
    main()
