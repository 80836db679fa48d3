"""What all generators share: the command line, files that appear whole, and dataset.json."""

import argparse
import hashlib
import json
import os
import shutil
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np


def arguments(description, options=()):
    """Parse `OUT [--quick] [--seed N]` and the generator's own `options`, pairs of a name and keywords."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("out", metavar="OUT", type=Path, help="folder to write; its name is the data set's")
    parser.add_argument("--quick", action="store_true", help="a tiny version, for tests")
    for name, keywords in options:
        parser.add_argument(name, **keywords)
    return parser.parse_args()


def fail(message):
    """End the program with one line on standard error and exit code 1."""
    sys.exit(f"error: {message}")


def sha256(path):
    """SHA-256 of a file, in hexadecimal."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def packages(*names):
    """Names and installed versions of Python packages, as they stand in dataset.json."""
    return {name: version(name) for name in names}


def command(seed=None, **options):
    """The command that makes this data set again, with OUT in place of the folder."""
    words = ["python", Path(sys.argv[0]).name, "OUT"]
    for name, value in options.items():
        words += [f"--{name}"] if value is True else [f"--{name}", str(value)] if value else []
    return " ".join(words + (["--seed", str(seed)] if seed is not None else []))


class Whole:
    """A folder that appears under its own name only when everything in it is there.

    `with Whole(out) as folder:` gives a scratch folder beside `out`. At the end `dataset.json` is written
    (`describe` must have been called), and the folder takes its name. An existing `out` is refused.
    """

    def __init__(self, out):
        self.out = Path(out)
        self.part = self.out.with_name(self.out.name + ".partial")
        self.description = None

    def __enter__(self):
        if self.out.exists():
            fail(f"{self.out} exists; remove it or name another folder")
        shutil.rmtree(self.part, ignore_errors=True)
        self.part.mkdir(parents=True)
        return self

    def describe(self, **fields):
        """Say what the data set is: the fields of dataset.json but for name and files."""
        self.description = fields

    def __exit__(self, kind, error, trace):
        if kind is not None:
            shutil.rmtree(self.part, ignore_errors=True)
            return
        files = sorted(path for path in self.part.iterdir() if path.is_file())
        record = {"name": self.out.name, **self.description}
        record["files"] = {path.name: {"bytes": path.stat().st_size, "sha256": sha256(path)} for path in files}
        write_json(self.part / "dataset.json", record)
        os.rename(self.part, self.out)


def write_json(path, record):
    """Write a record as indented JSON with a last newline."""
    Path(path).write_text(json.dumps(record, indent=1) + "\n")


def write_columns(folder, positions, meta, velocities=None):
    """Write (N, 3) positions, and velocities in km/s, as little-endian float32 columns xx.f32 ... vx.f32 ..., and meta.json."""
    names = ["xx.f32", "yy.f32", "zz.f32"]
    columns = dict(zip(names, positions.T))
    if velocities is not None:
        columns |= zip(["vx.f32", "vy.f32", "vz.f32"], velocities.T)
        meta = {**meta, "field_units": dict.fromkeys(["vx", "vy", "vz"], "km/s")}
    for name, values in columns.items():
        np.ascontiguousarray(values, dtype="<f4").tofile(folder / name)
    write_json(folder / "meta.json", {"N": len(positions), "dtype": "<f4", "files": names, **meta})
