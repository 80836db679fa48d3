#!/usr/bin/env python3
"""Counts the names that a user of the library can reach, and names those of its parts that nobody uses (standard
library only):

    scripts/public-names.py [--doc DIR] [--list]

DIR holds the pages of `cargo doc --workspace --no-deps` (target/doc). What a user can reach is what rustdoc lists for
`particlegs`, whatever crate it comes from: types, traits, functions, constants; a name counts once, wherever it can be
reached. A name of
the crates beneath is used where another crate, an example, a test or a public field,
argument or result has it. Ends with 1 where the bound is passed or a name is used by nobody.
"""
import argparse
import html.parser
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
FACE, BOUND = "particlegs", 200
PARTS = tuple(f"particlegs-{name}" for name in ("particles", "reference", "fit", "measure", "compress", "formats"))


class All(html.parser.HTMLParser):
    """The links of rustdoc's list of all items."""

    def __init__(self):
        super().__init__()
        self.names = []

    def handle_starttag(self, tag, attributes):
        target = dict(attributes).get("href") or ""
        kind = re.fullmatch(r"(?:.*/)?(struct|enum|union|trait|fn|type|constant|static)\.(\w+)\.html", target)
        if tag == "a" and kind:
            self.names.append(target.removesuffix(".html").replace(kind[1] + ".", "").replace("/", "::"))


def names(doc, crate):
    page = All()
    page.feed((doc / crate.replace("-", "_") / "all.html").read_text())
    return sorted(set(page.names))


def outside(crate):
    """Text that is no part of the crate's own sources: other crates, examples, tests, benchmarks, pages."""
    files = []
    for folder in (ROOT / "crates").iterdir():
        if folder.name != crate:
            files += folder.glob("src/**/*.rs")
        for beside in ("examples", "tests", "benches"):
            files += folder.glob(beside + "/**/*.rs")
    files += [ROOT / "README.md", *(ROOT / "fuzz").glob("**/*.rs"), *(ROOT / "python").glob("src/*.rs")]
    return "\n".join(f.read_text(errors="replace") for f in files if f.is_file())


def signatures(crate):
    """Words of public fields, variants and signatures of the crate: who gets such a value uses its type."""
    words = set()
    for file in (ROOT / "crates" / crate / "src").glob("**/*.rs"):
        text = re.sub(r"//.*", "", file.read_text())
        for found in re.findall(r"pub (?:fn (?:[^{;]|;(?= ))*|\w+: [^,\n]*)|^    \w+\(.*\),$|^    fn (?:[^{;]|;(?= ))*;", text, re.M):
            words.update(re.findall(r"[A-Z]\w+", found))
    return words


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--doc", type=pathlib.Path, default=ROOT / "target/doc")
    parser.add_argument("--list", action="store_true", help="print every name")
    o = parser.parse_args()
    face = sorted({n.split("::")[-1] for n in names(o.doc, FACE)})
    if o.list:
        print("".join(f"    {n}\n" for n in face), end="")
    print(f"{FACE}: {len(face)} of at most {BOUND} names that a user can reach")
    unused = []
    for crate in PARTS:
        words = set(re.findall(r"\w+", outside(crate))) | signatures(crate)
        # Names without a page of their own there are other crates'.
        own = [n for n in names(o.doc, crate) if re.search(rf"\b{n.split('::')[-1]}\b", sources(crate))]
        unused += [f"{crate}::{n}" for n in own if n.split("::")[-1] not in words]
    for name in unused:
        print(f"used by nobody: {name}")
    return 1 if len(face) > BOUND or unused else 0


def sources(crate):
    """What the crate defines."""
    text = "".join(f.read_text() for f in (ROOT / "crates" / crate / "src").glob("**/*.rs"))
    return " ".join(re.findall(r"\b(?:struct|enum|trait|fn|type|const|static) (\w+)", text))


if __name__ == "__main__":
    sys.exit(main())
