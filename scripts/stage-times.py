#!/usr/bin/env python3
"""Processor seconds of a compression by stage, beside what each must move and compute at least: prints docs/results/stages.md.

usage: scripts/stage-times.py PARTICLEGS NAME=SNAPSHOT[,COLUMN...]@RATIO [...] > docs/results/stages.md

PARTICLEGS is built with CARGO_PROFILE_RELEASE_DEBUG=1; Linux's `perf` looks at its stack some ten thousand times a run,
and a sample counts for the first stage below whose functions are on the stack. `quick` certificates, two threads.
"""
import json
import re
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from math import log2
from pathlib import Path

STAGES = [
    ("power held", r"held_power|codec::balance"),
    ("certificate: pictures of all particles", r"reference::"),
    ("certificate: subset of the same bytes", r"codec::points|score::subset"),
    ("certificate: the rest", r"measure::|fit::recover|particles::neighbours|particles::select|core::render|core::picture"),
    ("coding", r"core::codec|compress::size"),
    ("scan", r"particles::blocks|local_bounds|blake3|SnapshotScan"),
    ("copy", r"fit::store|ParticleStore"),
    ("partition", r"fit::partition|fit::cut|fit::moments::sums|fit::best_cuts"),
    ("search of candidates", r"overlap_tree|Candidates"),
    ("E step", r"em_kernel|em::expect"),
    ("M step", r"em::maximise|em::gather|em::unfocus|fit::prior"),
    ("exchanges", r"split_merge|fit::gain|transmittance"),
    ("regrouping", r"em::regroup|em::reorder|CountingSort|ParticleGroups|fit::moments"),
]
# E steps, searches and rounds of each effort (fit/effort.rs).
WORK = {"fast": (1, 1, 0), "default": (26, 4, 6)}
CANDIDATES = 12


def least(stage, n, k, effort):
    """Bytes to move and operations to compute, at least: a particle has 12 bytes, a candidate 48 bytes of sums."""
    steps, searches, rounds = WORK[effort]
    cached = max(log2(12 * n / 2e6), 1)  # levels of cuts above what 2 MB of cache hold
    return {
        "scan": (12 * n, 9 * n),
        "copy": (24 * n, 6 * n),
        "partition": (24 * n * cached, 20 * n * log2(max(k, 2))),
        "search of candidates": (searches * 100 * k, searches * k * 60 * 40),
        "E step": (steps * (12 * n + 48 * CANDIDATES * k), steps * n * CANDIDATES * 50),
        "M step": (steps * 48 * CANDIDATES * k, steps * k * (CANDIDATES * 60 + 300)),
        "exchanges": (rounds * 12 * n, rounds * (n * 40 + k * CANDIDATES * 300)),
        "regrouping": (rounds * 28 * n, rounds * 20 * n),
    }.get(stage)


def processor_seconds():
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def profile(binary, files, ratio, effort, folder):
    report, data = folder / "said.json", folder / "perf.data"
    n = 0
    for path in map(Path, files):
        sizes = [f.stat().st_size for f in (path.glob("*.f32") if path.is_dir() else [path])]
        n = max(n, max(sizes) // 4)
    rate = 997 if n < 1e7 else 197 if n < 1e8 else 29
    command = [binary, "compress", *files, "--ratio", ratio, "--effort", effort, "--certificate", "quick", "--threads", "2",
               "-o", str(folder / "m.pgs"), "--force", "-q", "--json", str(report)]
    earlier = processor_seconds()
    subprocess.run(["perf", "record", "-q", "-F", str(rate), "--call-graph", "dwarf,8192", "-o", str(data), *command], check=True,
                   stderr=subprocess.DEVNULL)
    processor = processor_seconds() - earlier
    script = subprocess.Popen(["perf", "script", "-i", str(data), "-F", "ip,sym"], stdout=subprocess.PIPE, text=True,
                              stderr=subprocess.DEVNULL)
    seconds, stack = Counter(), []
    for line in script.stdout:
        if line.strip():
            stack.append(line)
        elif stack:
            text = "".join(stack)
            seconds[next((name for name, pattern in STAGES if re.search(pattern, text)), "system, and not known")] += 1 / rate
            stack = []
    return json.loads(report.read_text()), processor, seconds


def main():
    binary, *cases = sys.argv[1:]
    version = subprocess.run([binary, "--version"], capture_output=True, text=True, check=True).stdout.strip()
    print("# Where the time of a compression goes\n")
    print("```sh\nscripts/stage-times.py particlegs " + " ".join(re.sub(r"[^=,]*/", "", c) for c in cases) + "\n```\n")
    print(f"{version}. Processor seconds by a sampling profiler (its own work included: 5 to 10 %), and the gigabytes "
          "to move and the billions of operations that each stage needs at least. A core moves about 10 GB/s and computes 20 "
          "to 50 billion float32 operations a second. Stages without such a bound have a dash.\n")
    for case in cases:
        name, rest = case.split("=")
        files, ratio = rest.rsplit("@", 1)
        for effort in WORK:
            with tempfile.TemporaryDirectory() as folder:
                report, processor, seconds = profile(binary, files.split(","), ratio, effort, Path(folder))
            n, k = report["particles"], report["gaussians"]
            print(f"## {name}: {n:,} particles, {k:,} Gaussians, `--effort {effort}`: {report['seconds']:.1f} s, "
                  f"{processor:.1f} processor s\n")
            print("| stage | processor s | share, % | GB at least | billion operations at least |")
            print("|---|---:|---:|---:|---:|")
            total = sum(seconds.values())
            for stage in [s for s, _ in reversed(STAGES)] + ["system, and not known"]:
                bound = least(stage, n, k, effort)
                cells = [f"{b / 1e9:.2g}" for b in bound] if bound else ["–", "–"]
                print(f"| {stage} | {seconds[stage]:.2f} | {100 * seconds[stage] / total:.0f} | " + " | ".join(cells) + " |")
            print(f"| all | {total:.2f} | 100 | | |\n", flush=True)


main()
