#!/usr/bin/env python3
"""Writes docs/results/training-optical-depth.md from RESULTS.json of training-optical-depth.py (standard library only):
    scripts/training-optical-depth-page.py RESULTS.json"""
import json, os, sys

with open(sys.argv[1]) as f:
    results = json.load(f)
here = os.path.dirname(os.path.abspath(__file__))
VIEWS = [f"{o}_0{i}" for o in ("far", "mid", "near") for i in range(3)]
OTHERS = ["large_radius", "inside", "high_opacity"]


def nine(r):
    return sum(r["views"][v] for v in VIEWS) / len(VIEWS)


def table(head, rows):
    line = lambda cells: "| " + " | ".join(cells) + " |"
    return "\n".join([line(head), line(["---"] * len(head)), *map(line, rows)]) + "\n"


base = results["untrained"]
gain = lambda r, v: f"{r['views'][v] - base['views'][v]:+.2f}"
scores, science, how = [], [], []
for name, r in results.items():
    worst = min((v for v in r["views"] if v != "high_opacity"), key=lambda v: r["views"][v] - base["views"][v])
    scores.append([name, str(r["model_bytes"]), f"{nine(r):.2f}", f"{nine(r) - nine(base):+.2f}", *[gain(r, v) for v in OTHERS],
                   f"{worst} {gain(r, worst)}"])
    s = r["science"]
    power = ", ".join(f"{p:.4f}" for p in s["power_ratio_lowest"])
    groups = "; ".join(f"{c[2]} of {c[1]}" for c in s["groups"])
    science.append([name, f"{s['correlation']:.5f}", f"{s['mae']:.4f}", power, f"{100 * s['largest_power_deviation']:.1f} %", groups,
                    f"{s['core_mass']:.2f}"])
    seconds = r["seconds_by_phase"]
    trained = ", ".join(f"{a:.2f} to {b:.2f}" for a, b in r["trained"]) or "-"
    config = "`" + r["config"].strip().replace("\n", "; ") + "`" if r["config"] else ""
    how.append([name, f"`{r['command']}`", config, f"{r['wall_seconds']:.0f}", f"{seconds.get('train', 0):.0f}", f"{r['cpu_seconds']:.0f}",
                f"{r['load_average']:.1f}", trained])

page = f"""# Training by the optical-depth law: nbody128 at ratio 300

Made by `scripts/training-optical-depth.py PARTICLEGS nbody128 REFERENCE WORK docs/results/training-optical-depth.json`, then
`scripts/training-optical-depth-page.py` (2 097 152 particles, two Xeon cores, other work beside: see the load), **by the fit before the shapes' prior**: from today's
untrained start (30.86 dB) training gains -0.45 to +0.1 dB at ratio 300 and 0.15 to 0.5 dB at 1000 and 3000. Every model has the bytes of
ratio 300, default effort, and is scored as decoded, masked PSNR in dB against VTK's `paraview` pictures. "Nine views" is the mean of far, mid,
near _00 to _02; other columns are gains over the untrained model.

The rows named
alpha-blend are our preset (`--train fast --law alpha-blend`), not the published recipe, at its own number of steps: the schedules that `--iterations` once
left unshrunk do not touch them.

{table(["run", "bytes", "nine views", "gain", *OTHERS, "worst of the views but high_opacity"], scores)}
### Statistics of as many particles drawn from the model (`recover --method count`, `stats --grid 50 --spectrum-grid 512`)

{table(["run", "density correlation", "MAE of delta", "P(k) over truth, two lowest bins", "largest deviation to 8 h/Mpc", "groups of 20-49; 50-99; 100 and more", "core mass"], science)}
### How each was made

{table(["run", "command", "changes", "seconds", "of which training", "CPU seconds", "load", "held-out views, dB"], how)}
"""
with open(os.path.join(here, "..", "docs", "results", "training-optical-depth.md"), "w") as f:
    f.write(page)
