#!/usr/bin/env python3
"""Steps a second of training by both laws: one snapshot, one fit as the start, one size of picture, in turns.

    scripts/training-steps.py PARTICLEGS SNAPSHOT WORK [ROUNDS]

Whole pictures at 960x540, no coding on the way, no density control. Seconds are those of the log between its
first line of steps and its last, so fit and start are left out. Medians over the rounds; standard library only.
"""
import json, os, statistics, subprocess, sys

PROGRAM, SNAPSHOT, WORK, *ROUNDS = sys.argv[1:]
CONFIG = """evaluate_every = 100000
start = "fit"
[cameras]
frames = 60
wide = 0.0
[[stages]]
iterations = 400
size = [960, 540]
oversample = 1
crop = [0, 0]
internal = 0.05
densify = { every = 0, until = 0, threshold = 0.0 }
"""
LAWS = {
    "optical-depth": ("optical-depth", "[optical_depth]\ncode_every = 0\n"),
    "alpha-blend": ("alpha-blend", ""),
    "alpha-blend, no network": ("alpha-blend", "[alpha_blend]\nvizmapper = false\n"),
}


def steps_a_second(law, changes):
    config, log, said = (os.path.join(WORK, "steps" + e) for e in (".toml", ".jsonl", ".json"))
    with open(config, "w") as f:
        f.write(CONFIG + changes)
    subprocess.run([PROGRAM, "compress", SNAPSHOT, "-o", os.path.join(WORK, "steps.pgs"), "--force", "--certificate=none", "--train", "fast",
                    "--law", law, "--config", config, "--log", log, "--json", said, "--quiet"], check=True, stdout=subprocess.DEVNULL)
    with open(log) as f:
        lines = [line for line in map(json.loads, f) if line["loss"] is not None]
    with open(said) as f:
        gaussians = json.load(f)["gaussians"]
    first, last = next(line for line in lines if line["iteration"] >= 100), lines[-1]
    return (last["iteration"] - first["iteration"]) / (last["seconds"] - first["seconds"]), gaussians


os.makedirs(WORK, exist_ok=True)
found = {name: [] for name in LAWS}
for _ in range(int(ROUNDS[0]) if ROUNDS else 3):
    for name, (law, changes) in LAWS.items():
        found[name].append(steps_a_second(law, changes))
        print(f"{name}: {found[name][-1][0]:.1f}", file=sys.stderr, flush=True)
for name, runs in found.items():
    rates = [r for r, _ in runs]
    print(f"{name}: {statistics.median(rates):.1f} steps/s ({', '.join(f'{r:.1f}' for r in rates)}), {runs[0][1]} Gaussians")
