#!/usr/bin/env python3
"""Compares the package with the command: import, memory, pictures, Ctrl-C. Needs the built package and command.

    python python/bench.py --command target/release/particlegs --snapshot SNAPSHOT [--particles 67108864]

Each number is the median of alternating runs, with its range.
"""

import argparse
import json
import os
import pathlib
import signal
import statistics
import subprocess
import sys
import tempfile
import textwrap
import time


def python(code, *arguments, **options):
    """The output of a new interpreter."""
    run = [sys.executable, "-c", textwrap.dedent(code), *map(str, arguments)]
    return subprocess.run(run, check=True, capture_output=True, text=True, **options).stdout


def said(values, unit, digits=3):
    """Median and range."""
    low, high = min(values), max(values)
    return f"{statistics.median(values):.{digits}f} {unit} ({low:.{digits}f} to {high:.{digits}f})"


def import_time(runs=9):
    """Seconds of `import particlegs` after `import numpy`."""
    code = "import numpy, time; t = time.perf_counter(); import particlegs; print(time.perf_counter() - t)"
    return [float(python(code)) for _ in range(runs)]


def pictures(command, snapshot, folder, runs=15):
    """Seconds of the first picture at 1080p, alternating between package and command."""
    model = folder / "model.pgs"
    make = [command, "compress", snapshot, "-o", model, "--certificate", "none", "--quiet"]
    subprocess.run(make, check=True, stdout=subprocess.DEVNULL)
    ours, theirs = [], []
    code = """
        import sys, time, particlegs as pg
        model = pg.read(sys.argv[1])
        t = time.perf_counter()
        model.render(30, 20)
        print(time.perf_counter() - t)
    """
    for _ in range(runs):
        ours.append(float(python(code, model)))
        draw = [command, "render", model, "--azimuth", "30", "--elevation", "20", "-o", folder / "q"]
        said = subprocess.run([*draw, "--quiet", "--json", "-"], check=True, capture_output=True).stdout
        theirs.append(json.loads(said)["views"][0]["seconds"])
    return ours, theirs


def peaks(command, particles, folder):
    """Peak memory in bytes of the command with a .npy file, and of Python with the array in memory."""
    code = """
        import resource, sys
        import numpy as np
        n = int(sys.argv[1])
        rng = np.random.default_rng(1)
        rows = np.empty((n, 3), dtype=np.float32)
        for i in range(0, n, 1 << 20):
            m = min(1 << 20, n - i)
            rows[i : i + m] = rng.random((m // 64 + 1, 1, 3), dtype=np.float32).repeat(64, 1).reshape(-1, 3)[:m]
            rows[i : i + m] += 0.003 * rng.standard_normal((m, 3), dtype=np.float32)
        if sys.argv[2] == "save":
            np.save(sys.argv[3], rows)
        else:
            import particlegs as pg
            pg.compress(pg.Snapshot(rows), ratio=300, effort="fast", certificate="none")
            print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
    """
    file = folder / "rows.npy"
    python(code, particles, "save", file)
    make = [command, "compress", file, "-o", folder / "rows.pgs", "--ratio", "300", "--effort", "fast"]
    process = subprocess.Popen([*map(str, make), "--certificate", "none", "--quiet"], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    assert status == 0
    theirs = used.ru_maxrss * 1024
    file.unlink()
    return int(python(code, particles, "compress", "-")), theirs


def interrupted(snapshot, runs=16):
    """Seconds from SIGINT to the end of the work, at several times during a fit, with the phase."""
    code = """
        import sys, time, particlegs as pg
        snap = pg.open(sys.argv[1])
        phases = []
        def told(phase, done, total):
            phases.append(phase)
        print("ready", flush=True)
        try:
            pg.compress(snap, ratio=100, progress=told)
        except KeyboardInterrupt:
            print(time.time(), phases[-1] if phases else "", sep=";")
    """
    seconds = []
    for i in range(runs):
        run = [sys.executable, "-c", textwrap.dedent(code), str(snapshot)]
        process = subprocess.Popen(run, stdout=subprocess.PIPE, text=True)
        process.stdout.readline()
        time.sleep(0.2 + 0.8 * i)
        sent = time.time()
        process.send_signal(signal.SIGINT)
        rest = process.communicate()[0].strip()
        if rest:
            ended, phase = rest.split(";")
            seconds.append((float(ended) - sent, phase))
    return seconds


def main():
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--command", type=pathlib.Path, required=True)
    parser.add_argument("--snapshot", type=pathlib.Path, required=True)
    parser.add_argument("--particles", type=int, default=67_108_864, help="of the test of memory; 0 leaves it out")
    parser.add_argument("--runs", type=int, default=7)
    o = parser.parse_args()
    print("import after numpy:", said(import_time(), "s"))
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        ours, theirs = pictures(o.command, o.snapshot, folder, o.runs)
        ratio = statistics.median(a / b for a, b in zip(ours, theirs))
        print("picture at 1080p:", said(ours, "s", 4), "in Python;", said(theirs, "s", 4), "by the command")
        print(f"    ratio {ratio:.2f}")
        stops = interrupted(o.snapshot)
        print("Ctrl-C to the end:", said([t for t, _ in stops], "s"), "longest in phase:", max(stops)[1])
        if o.particles:
            ours, theirs = peaks(o.command, o.particles, folder)
            array = 12 * o.particles
            print(f"{o.particles} positions, an array of {array / 1e9:.2f} GB: peak {ours / 1e9:.2f} GB")
            print(f"    command, which maps the file: {theirs / 1e9:.2f} GB")
            share = (ours - theirs + array) / array
            print(f"    without the command's other memory, relative to the array: {share:.2f}")


if __name__ == "__main__":
    main()
