#!/usr/bin/env python3
"""Benchmarks of two commits, run in turns on this machine, as a table of medians and their ratio.

Usage: scripts/compare-commits.py BEFORE AFTER [BENCH...] [--rounds N]
  BEFORE AFTER  commits, such as main~1 and main; `.` is the work tree as it is
  BENCH         benchmarks by name (default: all): codec fit reference render read verbs
  --rounds N    times that each is run, in turns (default: 3); the median of the rounds' medians counts

Each commit is built in a worktree of its own below the target folder. The table goes to standard output, as Markdown, and
leaves out what only one of the two has. GPU kernels are measured by `particlegs bench gpu`.
"""

import argparse
import json
import platform
import re
import statistics
import subprocess
import sys
from pathlib import Path

BENCHES = ("codec", "fit", "reference", "render", "read", "verbs")
UNITS = {"ns": 1e-9, "µs": 1e-6, "ms": 1e-3, "s": 1.0}


def run(*command: str, cwd: Path) -> str:
    return subprocess.run(command, cwd=cwd, check=True, text=True, stdout=subprocess.PIPE).stdout


def tree_of(root: Path, commit: str) -> Path:
    """The folder with a commit's files."""
    if commit == ".":
        return root
    metadata = json.loads(run("cargo", "metadata", "--no-deps", "--format-version", "1", "--locked", cwd=root))
    name = run("git", "rev-parse", "--verify", commit + "^{commit}", cwd=root).strip()
    tree = Path(metadata["target_directory"]) / "benchmarks" / name[:12]
    if not tree.exists():
        run("git", "worktree", "add", "--detach", str(tree), name, cwd=root)
    return tree


def medians(tree: Path, bench: str) -> dict[str, float]:
    """Seconds of each case, by the table that divan prints: fastest, slowest, median, mean. None without the benchmark."""
    # A commit has it in a crate of its own choice.
    package = next((f.parts[-3] for f in tree.glob(f"crates/*/benches/{bench}.rs")), None)
    if package is None:
        return {}
    printed = run("cargo", "bench", "--locked", "-q", "-p", package, "--bench", bench, cwd=tree)
    found, group = {}, ""
    for line in printed.splitlines():
        name = re.match(r"[│ ]*[├╰]─ (\S+)", line)
        if not name:
            continue
        times = re.findall(r"([\d.]+) (ns|µs|ms|s)\b", line)
        inner = line.startswith(("│", " "))
        if not inner:
            group = name[1]
        if len(times) == 4:
            value, unit = times[2]
            found[f"{bench}: {group} {name[1]}" if inner else f"{bench}: {name[1]}"] = float(value) * UNITS[unit]
    return found


def shown(seconds: float) -> str:
    return next(f"{seconds / size:.3g} {unit}" for unit, size in reversed(UNITS.items()) if seconds >= size or unit == "ns")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before")
    parser.add_argument("after")
    parser.add_argument("bench", nargs="*", choices=[[], *BENCHES], default=[], metavar="BENCH")
    parser.add_argument("--rounds", type=int, default=3)
    a = parser.parse_args()
    root = Path(__file__).resolve().parent.parent
    trees = [tree_of(root, commit) for commit in (a.before, a.after)]
    measured: list[dict[str, list[float]]] = [{}, {}]
    for number in range(a.rounds):
        for bench in a.bench or BENCHES:
            for tree, times in zip(trees, measured):
                for name, seconds in medians(tree, bench).items():
                    times.setdefault(name, []).append(seconds)
            print(f"round {number + 1}: {bench}", file=sys.stderr)
    cpu = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text()) if Path("/proc/cpuinfo").exists() else None
    commits = [run("git", "rev-parse", "--short", "HEAD", cwd=tree).strip() for tree in trees]
    print(f"{cpu[1] if cpu else platform.processor()}; {a.rounds} rounds in turns, medians.\n")
    print(f"| benchmark | {commits[0]} | {commits[1]} | after / before |\n|---|---|---|---|")
    for name, before in measured[0].items():
        if after := measured[1].get(name):
            b, c = statistics.median(before), statistics.median(after)
            print(f"| {name} | {shown(b)} | {shown(c)} | {c / b:.2f} |")


if __name__ == "__main__":
    main()
