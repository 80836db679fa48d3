"""Check made data sets: check.py PARTICLEGS DIR [AGAIN]. Exit code 1 at the first that is wrong.

Every file has its stated size and SHA-256; the program finds the particles, the box and the unit that
dataset.json states; AGAIN, made anew, holds the same bytes.
"""

import json
import subprocess
import sys
from pathlib import Path

from common import fail, sha256

NAMES = ["galaxy", "melt", "crystal", "box-a", "box-b", "box-c-z1", *(f"region-{i}" for i in range(1, 6)), "p3m", "water"]
# Of others: made where their files are named.
OTHERS = ["abacus-mini", "adk"]
# Particles that follow from the definitions alone: full, quick.
COUNTS = {"melt": (500_000, 4_000), "water": (12_288, 648)} | {name: (128**3, 32**3) for name in ("box-a", "box-b", "box-c-z1", "p3m")}


def described(program, folder):
    """What `particlegs info --json -` says of a folder."""
    run = subprocess.run([program, "info", str(folder), "--json", "-"], capture_output=True, text=True)
    if run.returncode:
        fail(f"{folder.name}: particlegs info says: {run.stderr.strip()}")
    return json.loads(run.stdout)


def compare(name, what, found, stated):
    """Fail with one line where two facts differ."""
    if found != stated:
        fail(f"{name}: {what}: {found} found, {stated} expected")


def check(program, folder):
    """Compare one data set's files, and what the program reads, with its dataset.json."""
    name, record = folder.name, json.loads((folder / "dataset.json").read_text())
    compare(name, "name", record["name"], name)
    for file, stated in record["files"].items():
        path = folder / file
        compare(name, file, (path.stat().st_size, sha256(path)), (stated["bytes"], stated["sha256"]))
    if name in COUNTS:
        compare(name, "particles", record["particles"], COUNTS[name]["--quick" in record["command"]])
    said = described(program, folder / record.get("open", ["."])[0])
    compare(name, "particles read", said["particles"], record["particles"])
    compare(name, "species", len(said["species"]), 4 if name == "galaxy" else 1)
    compare(name, "unit", said["meta"]["length_unit"], record["unit"].split(",")[0])
    cell = said["meta"]["cell"]
    lengths = cell and [round(cell["vectors"][axis][axis], 4) for axis in range(3)]
    compare(name, "box", lengths, record["box"] and [round(edge, 4) for edge in record["box"]])
    compare(name, "periodic", cell is not None and all(cell["periodic"]), record["periodic"])
    return record


def apart(records):
    """Fail unless the five regions are disjoint: no two share a volume."""
    corners = [record["parameters"]["region"] for name, record in records.items() if name.startswith("region-")]
    for i, (low, high) in enumerate(corners):
        for other, far in corners[:i]:
            if all(a < d and c < b for a, b, c, d in zip(low, high, other, far)):
                fail(f"regions at {low} and {other} overlap")


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit("usage: check.py PARTICLEGS DIR [AGAIN]")
    program, *folders = sys.argv[1:]
    names = NAMES + [name for name in OTHERS if (Path(folders[0]) / name).exists()]
    first = {name: check(program, Path(folders[0]) / name) for name in names}
    apart(first)
    for folder in folders[1:]:
        for name in names:
            compare(name, "bytes made again", check(program, Path(folder) / name)["files"], first[name]["files"])
    for name, record in first.items():
        print(f"{name:11} {record['particles']:9} particles  {record['description']}")


if __name__ == "__main__":
    main()
