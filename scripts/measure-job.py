#!/usr/bin/env python3
"""What each step of a job folder costs, as JSON: plan, scatter, block, merge, status, verify.

    scripts/measure-job.py DATA OUT.json [--blocks 8] [--fits 2] [--effort default] [--work DIR]

`--fits N`: blocks that are timed (spread over all); then the others are done too, without being timed on
their own, unless `--no-merge`. Wants the release build (PARTICLEGS). Peak memory is anonymous (RssAnon):
mapped snapshots are the system's to drop.
"""

import argparse, json, os, pathlib, shutil, subprocess, sys, tempfile, threading, time

PROGRAM = os.environ.get("PARTICLEGS", "target/release/particlegs")


def peak_anonymous(pid, found):
    while True:
        try:
            for line in open(f"/proc/{pid}/status"):
                if line.startswith("RssAnon"):
                    found[0] = max(found[0], int(line.split()[1]))
        except (OSError, IndexError):
            return
        time.sleep(0.05)


def timed(*command):
    command = [str(c) for c in (PROGRAM, *command)]
    start, found = time.monotonic(), [0]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    watcher = threading.Thread(target=peak_anonymous, args=(process.pid, found), daemon=True)
    watcher.start()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"exit {process.returncode}: {' '.join(command)}")
    return {
        "command": " ".join(["particlegs", *(pathlib.Path(c).name for c in command[1:])]),
        "wall_s": round(time.monotonic() - start, 3),
        "cpu_s": round(usage.ru_utime + usage.ru_stime, 3),
        "peak_anonymous_mb": round(found[0] / 1024, 1),
        "read_mb": round(usage.ru_inblock * 512 / 1e6, 1),
        "written_mb": round(usage.ru_oublock * 512 / 1e6, 1),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--blocks", type=int, default=8)
    parser.add_argument("--fits", type=int, default=2)
    parser.add_argument("--effort", default="default")
    parser.add_argument("--ratio", type=float, default=300)
    parser.add_argument("--no-merge", action="store_true")
    parser.add_argument("--work", type=pathlib.Path)
    a = parser.parse_args()
    work = a.work or pathlib.Path(tempfile.mkdtemp(prefix="measure-"))
    work.mkdir(parents=True, exist_ok=True)
    job = work / "job"
    plan = ["plan", a.data, "--blocks", a.blocks, "--effort", a.effort, "--ratio", a.ratio, "--certificate=none", "-o", job, "--quiet"]
    result = {"data": pathlib.Path(a.data).name, "blocks": a.blocks, "effort": a.effort, "ratio": a.ratio, "plan": timed(*plan)}
    manifest = json.loads((job / "plan.json").read_text())
    result["particles"], result["chunks"] = manifest["plan"]["metadata"]["count"], manifest["chunks"]
    if result["chunks"]:
        result["scatter_one_chunk"] = timed("scatter", job, 0, "--quiet")
        result["scatter_the_rest"] = timed("scatter", job, "--quiet")
    first = range(0, a.blocks, max(1, a.blocks // max(1, a.fits)))
    result["fits"] = []
    for i in first:
        fit = timed("block", job, i, "--quiet")
        report = json.loads((job / "blocks" / f"{i:05}.json").read_text())
        fit.update({k: report[k] for k in ("particles", "gaussians", "bytes")}, seconds=dict(report["seconds"]))
        result["fits"].append(fit)
    result["block_already_done"] = timed("block", job, 0, "--quiet")
    if not a.no_merge:
        for i in range(a.blocks):
            timed("block", job, i, "--quiet")
        result["status"] = timed("status", job, "--quiet")
        result["verify"] = timed("verify", job, "--quiet")
        result["merge"] = timed("merge", job, "-o", work / "model.pgs", "--force", "--quiet")
        result["model_bytes"] = (work / "model.pgs").stat().st_size
    files = lambda pattern: sum(p.stat().st_size for p in job.glob(pattern))
    result["bytes"] = {"plan.json": files("plan.json"), "runs.bin": files("runs.bin"), "scatter": files("scatter/*")}
    a.out.write_text(json.dumps(result, indent=2) + "\n")
    print(json.dumps(result, indent=2))
    if not a.work:
        shutil.rmtree(work)


if __name__ == "__main__":
    main()
