#!/usr/bin/env python3
"""Counts the public names of the library (types, traits, functions, constants), as rustdoc lists them, and names
those that nothing outside their crate names and no public field, argument or result has (standard library only):

    scripts/public-names.py [--doc DIR] [--list]

DIR holds the pages of `cargo doc --workspace --no-deps` (target/doc). A name counts once, wherever it can be
reached. Names of other crates are told apart and not bounded; macros are none. Ends with 1 where a bound is
passed or a name is used by nobody.
"""
import argparse
import html.parser
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
# Names at most of what a user imports: 90 and four of the fields that `convert` carries and of lists of centres.
BOUND = 94
BOUNDED = ("particlegs", "particlegs-formats")
APART = ("particlegs-core", "particlegs-train", "particlegs-files")


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


def of_others(doc):
    """Names of the other crates as a crate that re-exports them may list them: the first module, the last part."""
    for crate in APART:
        for name in names(doc, crate):
            parts = name.split("::")
            root = [""] if parts[0] in ("error", parts[-1]) else []
            yield from ((module, parts[-1]) for module in (*root, parts[0], crate.removeprefix("particlegs-")))


def outside(crate):
    """Text that is no part of the crate's own sources: other crates, examples, tests, benchmarks, pages."""
    files = []
    for folder in (ROOT / "crates").iterdir():
        if folder.name != crate:
            files += folder.glob("src/**/*.rs")
        for beside in ("examples", "tests", "benches"):
            files += folder.glob(beside + "/**/*.rs")
    files += [ROOT / "README.md", *(ROOT / "fuzz").glob("**/*.rs")]
    return "\n".join(f.read_text(errors="replace") for f in files if f.is_file())


def signatures(crate):
    """Words of public fields, variants and signatures of the crate: who gets such a value uses its type."""
    words = set()
    for file in (ROOT / "crates" / crate / "src").glob("**/*.rs"):
        text = re.sub(r"//.*", "", file.read_text())
        for found in re.findall(r"pub (?:fn [^{;]*|\w+: [^,\n]*)|^    \w+\(.*\),$|^    fn [^{;]*;", text, re.M):
            words.update(re.findall(r"[A-Z]\w+", found))
    return words


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--doc", type=pathlib.Path, default=ROOT / "target/doc")
    parser.add_argument("--list", action="store_true", help="print every name")
    o = parser.parse_args()
    bounded, unused, others = 0, [], set(of_others(o.doc))
    for crate in BOUNDED + APART:
        own, text = names(o.doc, crate), outside(crate)
        if crate in BOUNDED:
            # rustdoc lists what is re-exported of other crates as well.
            parts = {n: n.split("::") for n in own}
            own = [n for n in own if (parts[n][0] if len(parts[n]) > 1 else "", parts[n][-1]) not in others]
        words = set(re.findall(r"\w+", text)) | signatures(crate)
        idle = [n for n in own if n.split("::")[-1] not in words]
        print(f"{crate}: {len(own)} public names, {len(idle)} used by nobody outside")
        if o.list:
            print("".join(f"    {n}\n" for n in own), end="")
        if crate in BOUNDED:
            bounded += len(own)
            unused += [f"{crate}::{n}" for n in idle]
    print(f"{' and '.join(BOUNDED)}: {bounded} of at most {BOUND}")
    for name in unused:
        print(f"used by nobody: {name}")
    return 1 if bounded > BOUND or unused else 0


if __name__ == "__main__":
    sys.exit(main())
