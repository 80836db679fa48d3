#!/usr/bin/env python3
"""What each effort of the fit takes and gives: prints docs/results/effort.md.

usage: scripts/effort-page.py PARTICLEGS NAME=SNAPSHOT[,COLUMN...]@RATIO [...] > docs/results/effort.md

Each effort makes three models of each snapshot, at ratios 1 % apart and with other views and halves (fits of nearly
one size differ as much as two random starts). Differences are to `best`, model by model; +- is their spread.
"""
import json
import re
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

EFFORTS = ["best", "default", "fast"]
COLUMNS = [
    ("`paraview`, dB", 3), ("`expected`, dB", 3), ("6 radii, dB", 2), ("held-out bits", 3),
    ("groups of 20 to 49: number", 3), ("found", 3), ("mass of large groups", 3), ("density in cells, r", 4),
]


def run(*command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return done.stdout, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def figures(certificate):
    orbits = certificate["orbits"]
    mean = lambda style: statistics.mean(o[style]["masked_psnr"] for o in orbits)
    large = [s["paraview"]["mean"]["masked_psnr"] for s in certificate["pictures"]["settings"] if s["radius"] == 6]
    groups = [g for g in certificate["groups"] if g["groups"] > 0]
    masses = [g["mass"] for g in groups[1:] if g["mass"] is not None]
    return [
        mean("paraview"), mean("expected"), statistics.mean(large), certificate["held_out"]["bits"],
        groups[0]["number"], groups[0]["completeness"], statistics.mean(masses), certificate["densities"][0]["correlation"],
    ]


def models(binary, files, ratio, effort, folder):
    rows, seconds = [], []
    for seed, share in [(1, 0.99), (2, 1.0), (3, 1.01)]:
        out = str(folder / "m.pgs")
        options = ["--ratio", f"{ratio * share:g}", "--effort", effort, "--seed", str(seed), "-o", out, "-q", "--force"]
        seconds.append(run(binary, "compress", *files, *options, "--certificate", "none")[1])
        run(binary, "compress", *files, *options, "--certificate", "full")
        rows.append(figures(json.loads(run(binary, "info", out, "--json", "-")[0])["certificate"]))
    return rows, statistics.median(seconds)


def main():
    binary, *cases = sys.argv[1:]
    version = run(binary, "--version")[0].decode().strip()
    print("# What each effort takes and gives\n")
    print("```sh\nscripts/effort-page.py particlegs " + " ".join(re.sub(r"[^=,]*/", "", c) for c in cases) + "\n```\n")
    print(f"{version}. Models of the same size; processor seconds without the certificate, median of three. "
          "Figures of `best` with their spread, then differences to it with theirs: three models each, "
          "at ratios 1 % apart and with other views and held-out halves.\n")
    for case in cases:
        name, rest = case.split("=")
        paths, ratio = rest.rsplit("@", 1)
        with tempfile.TemporaryDirectory() as folder:
            results = {e: models(binary, paths.split(","), float(ratio), e, Path(folder)) for e in EFFORTS}
        best, best_seconds = results["best"]
        print(f"## {name} at ratio {ratio}\n")
        print("| effort | processor s | " + " | ".join(c for c, _ in COLUMNS) + " |")
        print("|---|---|" + "---|" * len(COLUMNS))
        for effort, (rows, seconds) in results.items():
            cells = []
            for k, (_, digits) in enumerate(COLUMNS):
                values = [row[k] - (0 if effort == "best" else reference[k]) for row, reference in zip(rows, best)]
                sign = "" if effort == "best" else "+"
                cells.append(f"{statistics.mean(values):{sign}.{digits}f} ± {statistics.stdev(values):.{digits}f}")
            print(f"| `{effort}` | {seconds:.1f} ({seconds / best_seconds:.2f}) | " + " | ".join(cells) + " |")
        print(flush=True)


main()
