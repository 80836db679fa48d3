#!/usr/bin/env python3
"""What 10⁹, 10¹⁰ and 10¹² particles need, from measured costs: the table of docs/results/scale.md.

    scripts/scale-table.py docs/results/job-steps.json

Work is in core seconds and grows with the particles; disks and networks are not in it. Memory follows the
same rule as `plan` (compress/memory.rs).
"""

import json, math, sys

steps = json.load(open(sys.argv[1]))
fast, default = steps["fast"], steps["default"]
MEMORY = 8 << 30  # of a task
RATIO, FLOAT3, RUN = 300, 12, 65536
NODE_CORES = 64
CHUNK = 512 * RUN  # particles of a chunk at most


def share(step, particles):
    return step["cpu_s"] / particles


plan_cost = share(fast["plan"], fast["particles"])
scattered = fast["scatter_one_chunk"]["cpu_s"] + fast["scatter_the_rest"]["cpu_s"]
scatter_cost = scattered / fast["particles"]
fit_cost = {
    "fast": share(fast["fits"][0], fast["fits"][0]["particles"]),
    "default": share(default["fits"][0], default["fits"][0]["particles"]),
}
a_gaussian = {"fast": fast["fits"][0]["bytes"] / fast["fits"][0]["gaussians"], "default": default["fits"][0]["bytes"] / default["fits"][0]["gaussians"]}
merge_cost = fast["merge"]["cpu_s"] / fast["model_bytes"]  # a byte; twice the bytes were in memory


def power(exponent):
    return "10" + str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def number(x, digits=3):
    """`1,790`, `9.8×10⁷`."""
    rounded = float(f"{x:.{digits}g}")
    if rounded < 1e5:
        return f"{rounded:,.10g}"
    exponent = math.floor(math.log10(rounded))
    return f"{rounded / 10**exponent:.{digits}g}×{power(exponent)}"


def size(n):
    for unit, name in ((1e12, "TB"), (1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if n >= unit:
            return f"{n / unit:.3g} {name}"
    return f"{n:.0f} B"


def span(seconds):
    for unit, name in ((86400, "d"), (3600, "h"), (60, "min")):
        if seconds >= unit:
            return f"{seconds / unit:.3g} {name}"
    return f"{seconds:.2g} s"


def of(n):
    model = FLOAT3 * n / RATIO
    a_particle = 2 * FLOAT3 * 1.01 + 260 * 1.01 * FLOAT3 / RATIO / a_gaussian["default"]
    most = (MEMORY - (400 << 20)) / a_particle
    blocks = math.ceil(n / most)
    block = n / blocks
    chunks = math.ceil(n / CHUNK)
    core = {e: n * (plan_cost + scatter_cost + fit_cost[e]) for e in fit_cost}
    yield "input, positions as float32", size(FLOAT3 * n)
    yield "scratch (buckets; 0 where the snapshot is spatially ordered)", size(FLOAT3 * n)
    yield "read and written in all", size(4 * FLOAT3 * n + 2 * model)
    yield "chunks; blocks of at most 8 GiB", f"{chunks:,}; {blocks:,}"
    yield "plan, core time (one process)", span(n * plan_cost)
    yield "... and at 2 GB/s from one node", span(FLOAT3 * n / 2e9)
    yield "scatter, core hours", number(n * scatter_cost / 3600)
    yield "blocks, core hours, default (fast)", f"{number(n * fit_cost['default'] / 3600)} ({number(n * fit_cost['fast'] / 3600)})"
    yield "a block on 4 cores, default (fast)", f"{span(block * fit_cost['default'] / 4)} ({span(block * fit_cost['fast'] / 4)})"
    yield f"node hours ({NODE_CORES} cores), default (fast)", f"{number(core['default'] / 3600 / NODE_CORES)} ({number(core['fast'] / 3600 / NODE_CORES)})"
    yield "bucket entries read (chunks x blocks); bytes in each", f"{number(chunks * blocks, 2)}; {size(FLOAT3 * n / (chunks * blocks))}"
    yield "runs.bin, read by every task", size(89 * n / RUN)
    yield "the model file, ratio 300", size(model)
    yield "merge: depth; core time; memory", f"1; {span(model * merge_cost)}; {size(150e6 + 3 * model)}"
    yield "Gaussians; memory to draw them (160 B)", f"{number(model / a_gaussian['default'], 2)}; {size(160 * model / a_gaussian['default'])}"


sizes = (1e9, 1e10, 1e12)
rows = [list(of(n)) for n in sizes]
print("| | " + " | ".join(power(round(math.log10(n))) for n in sizes) + " |")
print("|---" * (len(sizes) + 1) + "|")
for i, (name, _) in enumerate(rows[0]):
    print(f"| {name} | " + " | ".join(r[i][1] for r in rows) + " |")
