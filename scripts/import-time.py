#!/usr/bin/env python3
"""Seconds that `import particlegs` takes beyond NumPy's, which it needs anyway: the median of several fresh interpreters.

Usage: python scripts/import-time.py [--runs N] [--at-most SECONDS]
Counts what `python -X importtime` says of the package, everything that it imports included, after NumPy was imported.
"""

import argparse
import statistics
import subprocess
import sys


def beyond_numpy() -> float:
    """One fresh interpreter's seconds for the package, NumPy being there."""
    asked = [sys.executable, "-X", "importtime", "-c", "import numpy; import particlegs"]
    said = subprocess.run(asked, check=True, capture_output=True, text=True).stderr
    for line in said.splitlines():
        # import time: self [us] | cumulative | imported package
        columns = line.removeprefix("import time:").split("|")
        if len(columns) == 3 and columns[2].strip() == "particlegs":
            return int(columns[1]) * 1e-6
    raise SystemExit("python -X importtime does not name particlegs")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=5, metavar="N")
    parser.add_argument("--at-most", type=float, metavar="SECONDS", help="fail where it takes longer")
    asked = parser.parse_args()
    # The first import writes bytecode.
    beyond_numpy()
    took = statistics.median(beyond_numpy() for _ in range(max(asked.runs, 1)))
    print(f"import particlegs: {took:.3f} s beyond numpy")
    if asked.at_most is not None and took > asked.at_most:
        raise SystemExit(f"more than {asked.at_most} s")


if __name__ == "__main__":
    main()
