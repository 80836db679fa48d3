#!/usr/bin/env python3
"""Rehearsal of many small blocks through Snakemake: plan, run, kill some, kill Snakemake, finish, merge.

    scripts/rehearse-blocks.py DATA OUT.json [--blocks 1000] [--cores 2] [--work DIR]

Measures what a block costs as a process of its own against what it costs inside one process, what the
engine adds, the merged file's size against one block's, and the merge; checks that the merged file is the
same bytes as that of `compress --blocks K`. Wants the release build (PARTICLEGS) and Snakemake (SNAKEMAKE).
"""

import argparse, filecmp, json, os, pathlib, shutil, signal, subprocess, sys, tempfile, time

PROGRAM = os.environ.get("PARTICLEGS", "target/release/particlegs")
SNAKEMAKE = os.environ.get("SNAKEMAKE", "snakemake")


def timed(*command, out=None, log=None):
    """Runs a command; wall and processor seconds and the peak resident MB, its children's included."""
    start = time.monotonic()
    before = os.times()
    process = subprocess.Popen([str(c) for c in command], stdout=out or log or subprocess.DEVNULL, stderr=log)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"exit {process.returncode}: {' '.join(map(str, command))}")
    after = os.times()
    return {
        "wall_s": round(time.monotonic() - start, 4),
        "cpu_s": round(after.children_user + after.children_system - before.children_user - before.children_system, 4),
        "peak_rss_mb": round(usage.ru_maxrss / 1024, 1),
    }


def descendants(pid):
    """All processes that a process started; they come and go while this looks."""
    try:
        children = [int(p) for task in os.listdir(f"/proc/{pid}/task") for p in open(f"/proc/{pid}/task/{task}/children").read().split()]
    except OSError:
        return []
    return children + [d for c in children for d in descendants(c)]


def blocks_at_work(main):
    """Process number and block of every `particlegs block` under Snakemake."""
    found = []
    for pid in descendants(main):
        try:
            words = open(f"/proc/{pid}/cmdline", "rb").read().split(b"\0")
        except OSError:
            continue
        if len(words) > 3 and os.path.basename(words[0]) == b"particlegs" and words[1] == b"block":
            found.append((pid, words[3]))
    return found


def done(job):
    return sum(1 for _ in (job / "blocks").glob("*.pgs")) if (job / "blocks").is_dir() else 0


def strike(main, number, count, struck):
    """Sends a signal to `count` blocks at work that were not `struck` before: one that fails again and
    again would end the whole run. How many it reached."""
    reached, deadline = 0, time.monotonic() + 60
    while reached < count and time.monotonic() < deadline:
        for pid, block in blocks_at_work(main):
            if block in struck or reached == count:
                continue
            try:
                os.kill(pid, number)
            except ProcessLookupError:
                continue
            struck.add(block)
            reached += 1
        time.sleep(0.002)
    return reached


def engine(snakefile, work, job, cores, blocks):
    """Two runs of Snakemake: the first is struck and killed about the middle, the second finishes."""
    command = [SNAKEMAKE, "--snakefile", snakefile, "--directory", work, "--cores", str(cores), "--quiet", "all"]
    result = {}
    with open(work / "snakemake.log", "w") as log:
        start = time.monotonic()
        first = subprocess.Popen(command, stdout=log, stderr=log)
        while done(job) < blocks // 10 and first.poll() is None:
            time.sleep(0.2)
        struck = set()
        result["killed"] = strike(first.pid, signal.SIGKILL, 10, struck)
        result["told_to_stop"] = strike(first.pid, signal.SIGUSR1, 10, struck)
        while done(job) < blocks // 2 and first.poll() is None:
            time.sleep(0.2)
        if first.poll() is not None:
            sys.exit("Snakemake ended before it was killed: see " + str(work / "snakemake.log"))
        first.kill()
        first.wait()
        time.sleep(2)  # the blocks it left behind end by themselves
        result["first_run"] = {"wall_s": round(time.monotonic() - start, 2), "blocks_done": done(job)}
        subprocess.run(command + ["--unlock"], stdout=log, stderr=log, check=True)
        result["second_run"] = timed(*command, "--rerun-incomplete", log=log)
        result["nothing_to_do"] = timed(*command, log=log)
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--blocks", type=int, default=1000)
    parser.add_argument("--ratio", type=float, default=30, help="at 300 a block of 2000 particles has less room than its head takes")
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--sample", type=int, default=100, help="blocks timed as processes without an engine")
    parser.add_argument("--work", type=pathlib.Path)
    a = parser.parse_args()
    work = a.work or pathlib.Path(tempfile.mkdtemp(prefix="rehearsal-"))
    work.mkdir(parents=True, exist_ok=True)
    job, other, model = work / "job", work / "other", work / "model.pgs"
    common = ["--ratio", a.ratio, "--certificate=none", "--quiet"]
    options = [a.data, "--blocks", a.blocks, *common]
    result = {"data": pathlib.Path(a.data).name, "blocks": a.blocks, "ratio": a.ratio, "cores": a.cores}

    result["one_block"] = timed(PROGRAM, "compress", a.data, *common, "-o", work / "one.pgs", "--force")
    result["one_process"] = timed(PROGRAM, "compress", *options, "-o", work / "direct.pgs", "--force")

    # Blocks as processes, without an engine: what a process adds to what its own sidecar says.
    timed(PROGRAM, "plan", *options, "-o", other)
    result["scatter"] = timed(PROGRAM, "scatter", other, "--quiet")
    step = max(1, a.blocks // a.sample)
    each = [timed(PROGRAM, "block", other, i, "--threads", 1, "--quiet") for i in range(0, a.blocks, step)]
    result["a_block_as_process"] = {k: round(sum(e[k] for e in each) / len(each), 4) for k in each[0]}
    again = [timed(PROGRAM, "block", other, i, "--quiet") for i in range(0, a.blocks, step)]
    result["a_block_already_done"] = {k: round(sum(e[k] for e in again) / len(again), 4) for k in again[0]}
    shutil.rmtree(other)

    snakefile = work / "Snakefile"
    with open(snakefile, "w") as script:
        result["plan"] = timed(PROGRAM, "plan", *options, "-o", job, "--threads", 1, "--emit", "snakemake", out=script)
    text = snakefile.read_text()
    planned = text.split('MODEL = "', 1)[1].split('"', 1)[0]
    snakefile.write_text(text.replace(planned, str(model)))
    result["engine"] = engine(snakefile, work, job, a.cores, a.blocks)
    result["status"] = timed(PROGRAM, "status", job)
    result["verify"] = timed(PROGRAM, "verify", job)
    result["merge"] = timed(PROGRAM, "merge", job, "-o", work / "again.pgs", "--force", "--quiet")

    result["bytes"] = {
        "one_block": (work / "one.pgs").stat().st_size,
        "merged": model.stat().st_size,
        "block_files": sum(p.stat().st_size for p in (job / "blocks").glob("*.pgs")),
        "job_folder": sum(p.stat().st_size for p in job.rglob("*") if p.is_file()),
    }
    result["same_bytes"] = {
        "engine_and_one_process": filecmp.cmp(model, work / "direct.pgs", shallow=False),
        "merged_again": filecmp.cmp(model, work / "again.pgs", shallow=False),
    }
    a.out.write_text(json.dumps(result, indent=2) + "\n")
    print(json.dumps(result, indent=2))
    if not a.work:
        shutil.rmtree(work)
    if not all(result["same_bytes"].values()):
        sys.exit("the merged files differ")


if __name__ == "__main__":
    main()
