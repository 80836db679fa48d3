#!/usr/bin/env python3
"""Compresses nbody128 at growing tilings and full scale, and keeps what each run says.

    scripts/full-scale.py PARTICLEGS SNAPSHOT WORK RESULTS.json [NAME ...]

SNAPSHOT is nbody128 (2.1 M particles); tilings of it and models are made in WORK. Every run is added to
RESULTS.json by its name; named runs alone are done where names are given. A run: wall-clock seconds by
phase, CPU seconds (which other work on the machine changes little), peak anonymous memory (RssAnon,
sampled every 50 ms), size, scores of the certificate.
`scripts/full-scale-page.py RESULTS.json` writes the page from it.
"""
import json, os, subprocess, sys, time

PROGRAM, SNAPSHOT, WORK, RESULTS, *NAMES = sys.argv[1:]
SMALL = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "samples", "nbody64")
TILES = {"2.1M": None, "16.8M": "2,2,2", "67M": "2,4,4", "268M": "2,8,8"}


def snapshot(size):
    if size == "0.26M":
        return SMALL
    if TILES.get(size) is None:
        return SNAPSHOT
    folder = os.path.join(WORK, "nbody128-" + size)
    if not os.path.exists(os.path.join(folder, "meta.json")):
        subprocess.run([PROGRAM, "convert", SNAPSHOT, "-o", folder, "--tile", TILES[size], "--quiet"], check=True)
    return folder


def run(name, size, options):
    model = os.path.join(WORK, name + ".pgs")
    command = ["compress", snapshot(size), "-o", model, "--force", *options, "--json", os.path.join(WORK, "said.json"), "--quiet"]
    start = time.time()
    process = subprocess.Popen([PROGRAM, *command])
    peak = 0
    while True:
        done, status, used = os.wait4(process.pid, os.WNOHANG)
        if done:
            break
        with open(f"/proc/{process.pid}/status") as f:
            peak = max([peak] + [int(l.split()[1]) for l in f if l.startswith("RssAnon")])
        time.sleep(0.05)
    if status:
        sys.exit(f"{name}: status {status}")
    with open(os.path.join(WORK, "said.json")) as f:
        said = json.load(f)
    keep = ("particles", "gaussians", "model_bytes", "compression_ratio", "step_factor", "seconds_by_phase", "certificate")
    return {
        "command": "particlegs compress nbody128-" + size + " " + " ".join(options),
        "wall_seconds": round(time.time() - start, 2),
        "cpu_seconds": round(used.ru_utime + used.ru_stime, 2),
        "peak_anonymous_mib": peak // 1024,
        "load_average": os.getloadavg()[0],
        **{k: said[k] for k in keep},
    }


def all_runs():
    for ratio in ("290", "3000", "65"):
        for blocks in ("1", "8"):
            yield f"ratio-{ratio}-blocks-{blocks}", "268M", ["--ratio", ratio, "--blocks", blocks]
    for blocks in ("1", "8"):
        yield f"fast-290-blocks-{blocks}", "268M", ["--effort", "fast", "--ratio", "290", "--blocks", blocks]
    yield "fast-290-memory-1G", "268M", ["--effort", "fast", "--ratio", "290", "--memory", "1GB"]
    for size in ("0.26M", "2.1M", "16.8M", "67M"):
        yield f"growth-{size}", size, ["--ratio", "290"]
        yield f"growth-fast-{size}", size, ["--ratio", "290", "--effort", "fast"]


results = {}
if os.path.exists(RESULTS):
    with open(RESULTS) as f:
        results = json.load(f)
for name, size, options in all_runs():
    if NAMES and name not in NAMES or not NAMES and name in results:
        continue
    results[name] = run(name, size, options)
    with open(RESULTS, "w") as f:
        json.dump(results, f, indent=1)
        f.write("\n")
    print(name, results[name]["wall_seconds"], "s", flush=True)
