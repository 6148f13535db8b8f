# SPDX-License-Identifier: Apache-2.0
"""./run docs: the pages of this repository, the reference of the Python package from its docstrings and
that of the C++ headers, as one site in docs/site that needs no network.

    docs/make_site.py PACKAGE [--keep]

PACKAGE: folder that has the built package tilegrad. MkDocs (Debian: mkdocs) lays out, Doxygen reads the
headers; both are told to take warnings for errors, so that a broken link fails.
"""

import importlib
import inspect
import pathlib
import pkgutil
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
STAGE, SITE = ROOT / "build/docs", ROOT / "docs/site"
LINK = re.compile(r"\]\(([^()\s#]+)")
# In the order of the menu; pages that are not named here follow by name.
MENU = {"Use it": ["fit", "predict", "datasets", "training", "textured", "gan", "photographs", "rendering",
                   "python", "files"],
        "Figures": ["results", "benchmarks", "lab"],
        "Embed it": ["embedding", "conventions", "numerics"],
        "Port to it": ["porting"],
        "Understand it": ["architecture", "math", "adding"]}

CONFIG = """\
site_name: tilegrad
site_description: A differentiable rasterizer for CPUs, and the training system around it
docs_dir: pages
site_dir: {site}
use_directory_urls: false
theme:
  name: mkdocs
  highlightjs: false
  hljs_languages: []
plugins: []
extra_css: [site.css]
markdown_extensions: [tables, fenced_code, toc]
nav:
{nav}
"""

DOXYFILE = """\
PROJECT_NAME = tilegrad
INPUT = {root}/include/tilegrad
OUTPUT_DIRECTORY = {stage}/doxygen
HTML_OUTPUT = cpp
GENERATE_LATEX = NO
EXTRACT_ALL = YES
JAVADOC_AUTOBRIEF = YES
MULTILINE_CPP_IS_BRIEF = YES
FULL_PATH_NAMES = YES
STRIP_FROM_PATH = {root}/include
HAVE_DOT = NO
SEARCHENGINE = NO
QUIET = YES
WARNINGS = NO
WARN_AS_ERROR = NO
FILTER_PATTERNS = *.h="sed -E 's,(^|[[:space:]])// ,\\1/// ,'"
"""


def stage_page(page):
    """A page, and what it shows or links to of the repository, at the same relative places."""
    text = (ROOT / page).read_text()
    target = STAGE / "pages" / page
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(text)
    for link in LINK.findall(text):
        if re.match(r"[a-z]+:", link):
            continue
        linked = ((ROOT / page).parent / link).resolve()
        copy = STAGE / "pages" / linked.relative_to(ROOT)
        if linked.suffix != ".md" and linked.is_file() and not copy.exists():
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(linked, copy)


def tracked_pages():
    return subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "*.md"], cwd=ROOT,
                          capture_output=True, text=True, check=True).stdout.split()


# ---- The Python reference.

def signature_of(value):
    try:
        return str(inspect.signature(value))
    except (TypeError, ValueError):
        return "(...)"


def described(heading, value, level):
    text = inspect.getdoc(value) or ""
    out = f"\n{'#' * level} {heading}\n\n"
    kind = value.fget if isinstance(value, property) else value
    if callable(kind) and not isinstance(value, property):
        name = heading.split(".")[-1].strip("`")
        out += f"    {name}{signature_of(value)}\n\n"
    return out + "\n".join(f"    {line}" if line else "" for line in text.splitlines()) + "\n"


def described_class(name, value):
    out = described(f"`{name}`", value, 3)
    for member, raw in vars(value).items():
        if member.startswith("_"):
            continue
        inner = raw if isinstance(raw, property) else getattr(value, member, None)
        if isinstance(raw, property) or inspect.isroutine(inner):
            out += described(f"`{name}.{member}`", inner, 4)
    return out


def described_module(name):
    module = importlib.import_module(name)
    out = f"\n## `{name}`\n\n" + "\n".join(
        f"    {line}" if line else "" for line in (inspect.getdoc(module) or "").splitlines()) + "\n"
    public = getattr(module, "__all__", None) or [
        member for member, value in vars(module).items() if not member.startswith("_")
        and getattr(value, "__module__", "").startswith(name)]
    for member in sorted(public):
        value = getattr(module, member)
        if inspect.isclass(value):
            out += described_class(member, value)
        elif callable(value):
            out += described(f"`{member}`", value, 3)
    return out


def python_reference():
    import tilegrad
    out = ("# The Python package\n\nFrom its docstrings. The functions `tilegrad.render`, `tilegrad.fit` "
           "and `tilegrad.train` are in `tilegrad._show` and `tilegrad.runs`.\n")
    names = ["tilegrad", "tilegrad._show"]
    names += sorted(info.name for info in pkgutil.iter_modules(tilegrad.__path__, "tilegrad.")
                    if not info.name.rpartition(".")[2].startswith("_"))
    for name in names:
        try:
            out += described_module(name)
        except ImportError as error:
            print(f"NOTE: {name} is left out of the reference: {error}", file=sys.stderr)
    return out


# ---- The site.

def menu(pages):
    known = {name for names in MENU.values() for name in names}
    lines = ["- Home: README.md", "- All pages: docs/README.md"]
    for title, names in MENU.items():
        lines.append(f"- {title}:")
        lines += [f"  - {name}: docs/{name}.md" for name in names if f"docs/{name}.md" in pages]
    others = [page for page in pages if page.startswith("docs/") and page.count("/") == 1
              and pathlib.Path(page).stem not in known | {"README"}]
    lines += ["- More:"] + [f"  - {pathlib.Path(page).stem}: {page}" for page in others]
    lines += [f"  - {pathlib.Path(page).stem.lower()}: {page}"
              for page in ("CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md") if page in pages]
    return "\n".join(lines + ["- Reference:", "  - Python: reference/python.md",
                              "  - C++: reference/cpp.md"])


def main():
    sys.path.insert(0, sys.argv[1])
    shutil.rmtree(STAGE, ignore_errors=True)
    shutil.rmtree(SITE, ignore_errors=True)
    pages = tracked_pages()
    for page in pages:
        stage_page(page)
    reference = STAGE / "pages/reference"
    reference.mkdir()
    (reference / "python.md").write_text(python_reference())
    (reference / "cpp.md").write_text("# The C++ headers\n\nThe public surface, `include/tilegrad`: "
                                      "<a href=\"cpp/files.html\">its files</a>, "
                                      "<a href=\"cpp/annotated.html\">its classes</a>. How to build with "
                                      "it: [embedding](../docs/embedding.md).\n")
    (STAGE / "pages/site.css").write_text("pre { white-space: pre-wrap; }\n")
    (STAGE / "mkdocs.yml").write_text(CONFIG.format(site=SITE, nav=menu(pages)))
    subprocess.run(["mkdocs", "build", "--quiet", "--strict"], cwd=STAGE, check=True)
    (STAGE / "Doxyfile").write_text(DOXYFILE.format(root=ROOT, stage=STAGE))
    subprocess.run(["doxygen", "-q", STAGE / "Doxyfile"], check=True)
    shutil.copytree(STAGE / "doxygen/cpp", SITE / "reference/cpp")
    print(SITE / "index.html")


if __name__ == "__main__":
    main()
