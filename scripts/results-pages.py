#!/usr/bin/env python3
"""Puts what `bench` wrote into docs/results: pages, the figures and tables that they show, and the page that lists
all (standard library only).

    scripts/results-pages.py MEASURED docs/results [SUFFIX TITLE WORDS]

With SUFFIX they are further pages, of other data or another commit: datasets-SUFFIX.md, called TITLE, with WORDS
about the data.
"""
import pathlib
import re
import shutil
import sys

measured, docs = map(pathlib.Path, sys.argv[1:3])
suffix, title, words = ("-" + sys.argv[3], *sys.argv[4:]) if len(sys.argv) == 6 else ("", None, None)
figures = docs / "figures"
figures.mkdir(exist_ok=True)
for page in sorted(measured.glob("*.md")):
    text = page.read_text()
    if title:
        text = f"# {title}\n\n{words}\n" + text.split("\n", 1)[1]
    for name in re.findall(r"\(figures/([^)]+)\)", text):
        stem, ending = name.rsplit(".", 1)
        new = f"{stem}{suffix}.{ending}"
        text = text.replace(f"(figures/{name})", f"(figures/{new})")
        shutil.copyfile(measured / "figures" / name, figures / new)
    (docs / f"{page.stem}{suffix}.md").write_text(text)

# The list: the title of every page, and what of it is from where.
lines = ["# Results", "", "Every figure on these pages was written by a program. By `particlegs bench`"
         " ([the laboratory](../guide/laboratory.md); `scripts/results.sh`):", ""]
of_lab = ["By scripts in `lab/`:", ""]
others = ["By scripts, from JSON that lies beside them:", ""]
for page in sorted(docs.glob("*.md")):
    if page.name in ("README.md", "benchmarks.md", "notebook.md"):
        continue
    text = page.read_text()
    title = text.splitlines()[0].lstrip("# ")
    own = others if not re.search(r"`lab/\w+\.py", text) else of_lab
    (lines if "Made by `particlegs bench" in text else own).append(f"- [{title}]({page.name})")
more = ["", "From the repository's benchmarks:", "", "- [Speed of the program's parts](benchmarks.md)", "",
        "What was tried and failed, with figures typed by hand, stands in [the notebook](notebook.md).", ""]
(docs / "README.md").write_text("\n".join(lines + [""] + of_lab + [""] + others + more))

# A figure that no page shows any more is not kept.
shown = {name for page in docs.glob("*.md") for name in re.findall(r"\(figures/([^)]+)\)", page.read_text())}
for path in figures.iterdir():
    if path.name not in shown:
        path.unlink()
