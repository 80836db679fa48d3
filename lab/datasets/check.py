"""Check made data sets: check.py PARTICLEGS DIR [AGAIN]. Exit code 1 at the first that is wrong.

Every file has its stated size and SHA-256; the program counts the particles and finds the box and unit that
dataset.json states; AGAIN, made anew, holds the same bytes.
"""

import json
import subprocess
import sys
from pathlib import Path

from common import fail, sha256

QUICK = {"galaxy": 14987, "melt": 4000, "box-a": 32768, "box-b": 32768, "box-c-z1": 32768}


def described(program, folder):
    """What `particlegs info --json -` says of a folder."""
    run = subprocess.run([program, "info", str(folder), "--json", "-"], capture_output=True, text=True)
    if run.returncode:
        fail(f"{folder.name}: particlegs info says: {run.stderr.strip()}")
    return json.loads(run.stdout)


def check(program, folder):
    """Compare one data set with its dataset.json; returns the record."""
    record = json.loads((folder / "dataset.json").read_text())
    for name, file in record["files"].items():
        path = folder / name
        if path.stat().st_size != file["bytes"] or sha256(path) != file["sha256"]:
            fail(f"{path} is not the file that dataset.json describes")
    said = described(program, folder)
    print(folder.name, json.dumps(said)[:3000]) if "-v" in sys.argv else None
    return record, said
