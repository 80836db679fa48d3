#!/usr/bin/env python3
"""Finds names that do not say what they are (standard library only):

    scripts/names.py [--list]

The name of a type is wrong where its last word is a participle (`Kept`, `BlocksDrawn`), and unclear where it stands for
two things: it is defined more than once in the sources. The name of a local is empty where it could be that of any other
(`found`, `own`). Documentation states; it does not ask. Ends with 1 where there are more of these than the bounds below,
which only ever fall. CONTRIBUTING.md has the rules.
"""
import argparse
import collections
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
SOURCES = ("crates/*/src", "python/src")
RUST = ("crates/*/src", "crates/*/tests", "crates/*/benches", "python/src", "fuzz")
PARTICIPLES_MOST = 0
SHARED_MOST = 10
LOCALS_MOST = 0
QUESTIONS_MOST = 0
# One in every command: what stands on its command line.
CONVENTIONS = {"Arguments"}
# Participles that do not end in -ed.
IRREGULAR = set(
    "Begun Bound Built Cut Done Drawn Fallen Felt Found Given Gone Grown Heard Held Hidden Kept Known Laid Left Lit "
    "Lost Made Met Put Read Run Said Seen Sent Set Shown Shut Spent Split Spread Stood Taken Thrown Told Torn Worn "
    "Written".split()
)
# Nouns that look like participles.
NOUNS = set(
    "Bed Bound Coding Listing Whitening Coloring Cut Drawing Embed Encoding Ending Feed Linking Need Opening Packing Read Reading Run "
    "Finding Scaling Seed Set Setting Smoothing Speed Split Spread String Thinning Tiling Timing Training Tuning".split()
)
KINDS = "struct|enum|trait|union|type"
DEFINITION = re.compile(rf"^\s*(?:pub(?:\([^)]*\))?\s+)?(?:unsafe\s+)?(?:{KINDS})\s+([A-Z]\w*)", re.M)


LOCAL = re.compile(r"\blet (?:mut )?(own|of|found|what|there|told|asked|kept|made)\b")
QUESTION = re.compile(r"^\s*//[/!].*\?\s*$")


def lines(pattern):
    """Lines of Rust with a pattern, as `path:line: text`."""
    for folder in (folder for source in RUST for folder in ROOT.glob(source)):
        for path in sorted(path for path in folder.rglob("*.rs") if "target" not in path.parts):
            for number, line in enumerate(path.read_text().splitlines(), 1):
                if pattern.search(line):
                    yield f"{path.relative_to(ROOT)}:{number}: {line.strip()}"


def is_participle(name):
    words = re.findall(r"[A-Z][a-z]*", name)
    last = words[-1] if words else name
    return last not in NOUNS and (last in IRREGULAR or re.fullmatch(r"[A-Z][a-z]+(ed|ing)", last) is not None)


def definitions():
    """Files by the name of each type that they define; associated types are the trait's."""
    found = collections.defaultdict(list)
    for source in SOURCES:
        for path in sorted(p for folder in ROOT.glob(source) for p in folder.rglob("*.rs")):
            for match in DEFINITION.finditer(path.read_text()):
                associated = match[0].startswith(" ") and re.search(r"\btype\s", match[0])
                if not associated:
                    found[match[1]].append(path.relative_to(ROOT))
    return found


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--list", action="store_true", help="print the names and the files that define them")
    arguments = parser.parse_args()
    found = definitions()
    participles = sorted(name for name in found if is_participle(name))
    shared = sorted(name for name, files in found.items() if len(files) > 1 and name not in CONVENTIONS)
    locals_ = list(lines(LOCAL))
    questions = list(lines(QUESTION))
    groups = (
        ("participles", [f"{name}: {', '.join(map(str, found[name]))}" for name in participles], PARTICIPLES_MOST),
        ("names of several things", [f"{name}: {', '.join(map(str, found[name]))}" for name in shared], SHARED_MOST),
        ("empty names of locals", locals_, LOCALS_MOST),
        ("questions in documentation", questions, QUESTIONS_MOST),
    )
    print(f"{len(found)} names of types; " + ", ".join(f"{len(names)} {title}" for title, names, _ in groups))
    wrong = False
    for title, names, most in groups:
        if arguments.list:
            print(f"\n{title}:", *names, sep="\n  ")
        if len(names) > most:
            print(f"error: {len(names)} {title}, {most} at most; --list shows them", file=sys.stderr)
            wrong = True
    return int(wrong)


if __name__ == "__main__":
    sys.exit(main())
