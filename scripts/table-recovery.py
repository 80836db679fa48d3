#!/usr/bin/env python3
"""Writes OUT/recovery.json and docs/results/recovery.md from what table-recovery.sh measured (standard library only):
    scripts/table-recovery.py OUT_DIR PAGE"""
import json
import os
import sys

out, page = sys.argv[1], sys.argv[2]
MODELS = [f"{r}-default" for r in (30, 65, 100, 300, 1000, 3000)] + ["65-fast", "300-fast"]
XI_LARGEST = 0.1  # xi(r) is judged where the truth's is above this


def load(name):
    with open(os.path.join(out, name)) as f:
        return json.load(f)


def spectrum(s):
    shells = s["spectra"]["shells"]
    ratio = [h["ratio"] for h in shells]
    off = [abs(r - 1) if r is not None else float("inf") for r in ratio]

    def to(limit, good=lambda h, o, limit: o <= limit):
        k = None
        for h, o in zip(shells, off):
            if not good(h, o, limit):
                break
            k = h["k"]
        return k

    worst = max(range(len(off)), key=off.__getitem__)
    above = lambda h, o, limit: h["r"] is not None and h["r"] >= limit
    return {
        "k_max": shells[-1]["k"], "largest_deviation": off[worst], "at_k": shells[worst]["k"],
        "within_1_percent_to": to(0.01), "within_5_percent_to": to(0.05), "within_10_percent_to": to(0.10),
        "r_at_k_max": shells[-1]["r"], "r_above_0_99_to": to(0.99, above), "r_above_0_9_to": to(0.9, above),
    }


def xi_from(s, join=0.98):
    """Smallest r from which on xi is within 10 %: by pair counts below `join`, where all particles or many are
    primaries, and by transform above, where the few primaries of pair counts scatter by 5 to 10 %."""
    pairs, fourier = s["xi_by_pairs"], s["xi_by_transform"]
    truth, edges = pairs["counts"][0]["xi"], pairs["counts"][0]["edges"]
    bins = [(edges[i], pairs["ratio"][i]) for i in range(len(truth)) if truth[i] >= XI_LARGEST and edges[i] < join]
    a, b = fourier["xi"]
    bins += [(e, y / x) for e, x, y in zip(fourier["edges"], a, b) if x >= XI_LARGEST and e >= join]
    start = None
    for r, ratio in sorted(bins, reverse=True):
        if ratio is None or abs(ratio - 1) > 0.1:
            break
        start = r
    return start


def density(s):
    a = s["density"]["agreement"]
    return {"correlation": a["correlation"], "mae": a["mean_absolute_error"]}


def particles(s):
    classes = [dict(c) for c in s["groups"]["classes"]]
    return {
        "groups": [{"from": c["from"], "to": c["to"], "truth": c["groups"][0], "other": c["groups"][1]} for c in classes],
        "groups_within_10_percent_from": s["summary"]["groups_within_10_percent_from"],
        "core_mass": s["summary"]["core_mass"],
        "nearest_mean": s["summary"]["nearest_mean"], "nearest_median": s["summary"]["nearest_median"],
    }


results = []
for name in MODELS:
    made, drawn, direct = load(f"{name}.json"), load(f"{name}-count/stats.json"), load(f"{name}-model/stats.json")
    entry = {
        "model": name, "ratio": made["compression_ratio"], "effort": name.split("-")[1], "gaussians": made["gaussians"],
        "bytes": made["model_bytes"], "seconds": made["seconds"],
        "drawn": {"density": density(drawn), "spectrum": spectrum(drawn), **particles(drawn),
                  "xi_within_10_percent_from": xi_from(drawn)},
        "direct": {"density": density(direct), "spectrum": spectrum(direct)},
    }
    for method in ("spaced", "stratified"):
        s = load(f"{name}-{method}/stats.json")
        entry[method] = {"density": density(s), **particles(s)}
    results.append(entry)
with open(os.path.join(out, "recovery.json"), "w") as f:
    json.dump(results, f, indent=1)
    f.write("\n")

text = []


def line(s=""):
    text.append(s)


def row(*cells):
    line("| " + " | ".join(str(c) for c in cells) + " |")


def head(*cells):
    row(*cells)
    row(*["---"] * len(cells))


def percent(v, digits=1):
    return "-" if v is None or v == float("inf") else f"{100 * v:.{digits}f} %"


def wave(k, k_max):
    if k is None:
        return "nowhere"
    return f"{k:.2f} (all)" if k >= k_max else f"{k:.2f}"


def off(c):
    return f'{c["other"]} ({100 * (c["other"] / c["truth"] - 1):+.1f} %)' if c["truth"] else str(c["other"])


def name_of(e):
    return e["model"].replace("-", ", ")


truth = results[0]["drawn"]["groups"]
line("# What recovered particles are good for: nbody128")
line("")
line("**Hand-typed in part**: the tables come from `recovery.json`; figures in the sentences below them (`scripts/recovery-notes.md`) are typed by hand.")
line()
line("Made by `scripts/table-recovery.sh DATA OUT` from nbody128 (2 097 152 particles, periodic box of 50 Mpc/h, particles' Nyquist frequency 8.04 h/Mpc). Every figure is of the file as decoded, against the snapshot. The commands for one model:")
line()
line("```")
line("particlegs compress nbody128 -o m.pgs --ratio 300 --effort default --certificate none")
line("particlegs recover m.pgs -o particles                              # method count, seed 42")
line("particlegs stats nbody128 particles -o s --grid 50 --spectrum-grid 512")
line("particlegs stats nbody128 m.pgs -o s-model --only density,spectrum --grid 50 --spectrum-grid 512")
line("particlegs recover m.pgs -o spaced --method spaced                 # and stratified")
line("particlegs stats nbody128 spaced -o s-spaced --grid 50 --only density,groups,neighbours")
line("```")
line()
line("Density: nearest grid point, 50^3 cells of 16.8 particles. P(k): triangular-shaped clouds, two grids of 512^3 half a cell apart, window divided out, shot noise subtracted; r(k) with the noise of the particles in it. xi(r), where the truth's is above 0.1: pair counts below 1 Mpc/h, 10 bins a decade from 0.0195 on; by transform above (pair counts are of a sample of primaries there, and scatter by 5 to 10 %). Groups: friends of friends, 0.2 of the mean spacing, periodic. Core mass: median over groups of 100 to 299 particles of other / truth within 0.05 Mpc/h of the truth's centre.")
line()
line("## Particles drawn by `count` (the default)")
line()
head("ratio, effort", "Gaussians", "density: correlation", "MAE of delta", "P(k): largest deviation (at k)", "within 1 % to k", "within 5 % to k", "r(k) at 8", "r >= 0.99 to k", "r >= 0.9 to k", "xi within 10 % from r")
for e in results:
    d, s = e["drawn"]["density"], e["drawn"]["spectrum"]
    xi = e["drawn"]["xi_within_10_percent_from"]
    row(name_of(e), e["gaussians"], f'{d["correlation"]:.4f}', f'{d["mae"]:.4f}', f'{percent(s["largest_deviation"])} ({s["at_k"]:.2f})',
        wave(s["within_1_percent_to"], s["k_max"]), wave(s["within_5_percent_to"], s["k_max"]), f'{s["r_at_k_max"]:.3f}',
        wave(s["r_above_0_99_to"], s["k_max"]), wave(s["r_above_0_9_to"], s["k_max"]), "nowhere" if xi is None else f"{xi:.3f}")
line()
line("k in h/Mpc, r in Mpc/h; `(all)`: as far as was measured.")
line()
head("ratio, effort", *[f'groups of {c["from"]}' + (f' to {c["to"]}' if c["to"] else " and more") + f' (truth {c["truth"]})' for c in truth], "within 10 % from", "core mass", "nearest neighbour: mean", "median")
for e in results:
    d = e["drawn"]
    from_ = d["groups_within_10_percent_from"]
    row(name_of(e), *map(off, d["groups"]), "no size" if from_ is None else from_, "-" if d["core_mass"] is None else f'{d["core_mass"]:.2f}',
        f'{d["nearest_mean"]:.3f}', f'{d["nearest_median"]:.3f}')
line()
line("Nearest neighbours: other / truth.")
line()
line("## The model directly (its mixture integrated over the cells; no draw, no shot noise)")
line()
head("ratio, effort", "density: correlation", "MAE of delta", "P(k): largest deviation (at k)", "within 1 % to k", "within 5 % to k", "r(k) at 8", "r >= 0.99 to k", "r >= 0.9 to k")
for e in results:
    d, s = e["direct"]["density"], e["direct"]["spectrum"]
    row(name_of(e), f'{d["correlation"]:.4f}', f'{d["mae"]:.4f}', f'{percent(s["largest_deviation"])} ({s["at_k"]:.2f})',
        wave(s["within_1_percent_to"], s["k_max"]), wave(s["within_5_percent_to"], s["k_max"]), f'{s["r_at_k_max"]:.3f}',
        wave(s["r_above_0_99_to"], s["k_max"]), wave(s["r_above_0_9_to"], s["k_max"]))
line()
line("## Other ways to draw")
line()
line("`spaced` mends the spacing and moves other statistics; `stratified` thins the shot noise of counts and makes spacings too even.")
line()
head("ratio, effort", "method", "MAE of delta", *[f'{c["from"]}' + (f' to {c["to"]}' if c["to"] else "+") for c in truth], "core mass", "nearest: mean", "median")
for e in results:
    for method in ("count", "spaced", "stratified"):
        d = e["drawn"] if method == "count" else e[method]
        row(name_of(e), f"`{method}`", f'{d["density"]["mae"]:.4f}', *map(off, d["groups"]), "-" if d["core_mass"] is None else f'{d["core_mass"]:.2f}',
            f'{d["nearest_mean"]:.3f}', f'{d["nearest_median"]:.3f}')
line()

line("## Which analyses are supported")
line()
line("From the figures above alone. **yes**: within the first limit; *care*: within the second; no: neither.")
line()


def grade(value, good, fair):
    return "no" if value is None else "**yes**" if value <= good else "*care*" if value <= fair else "no"


def worst_group(e, k):
    c = e["drawn"]["groups"][k]
    return abs(c["other"] / c["truth"] - 1) if c["truth"] else None


def first_off(e, k):
    """Largest deviation that P(k) is known to stay within up to k."""
    s = e["drawn"]["spectrum"]
    for limit, key in ((0.01, "within_1_percent_to"), (0.05, "within_5_percent_to"), (0.1, "within_10_percent_to")):
        if s[key] is not None and s[key] >= min(k, s["k_max"]):
            return limit
    return None


def phases(e, k):
    s = e["drawn"]["spectrum"]
    for loss, key in ((0.01, "r_above_0_99_to"), (0.1, "r_above_0_9_to")):
        if s[key] is not None and s[key] >= min(k, s["k_max"]):
            return loss
    return None


def spacing(e, method):
    d = e["drawn"] if method == "count" else e[method]
    return max(abs(d["nearest_mean"] - 1), abs(d["nearest_median"] - 1))


ANALYSES = [
    ("density on cells of 1 Mpc/h: 1 - correlation", "0.002 / 0.01", lambda e: grade(1 - e["drawn"]["density"]["correlation"], 0.002, 0.01)),
    ("counts in these cells: MAE of delta", "0.21 / 0.3", lambda e: grade(e["drawn"]["density"]["mae"], 0.21, 0.3)),
    ("P(k) to 2 h/Mpc", "1 % / 5 %", lambda e: grade(first_off(e, 2), 0.01, 0.05)),
    ("P(k) to 8 h/Mpc", "1 % / 5 %", lambda e: grade(first_off(e, 8), 0.01, 0.05)),
    ("phases (cross-correlation) to 2 h/Mpc: 1 - r", "0.01 / 0.1", lambda e: grade(phases(e, 2), 0.01, 0.1)),
    ("phases to 8 h/Mpc: 1 - r", "0.01 / 0.1", lambda e: grade(phases(e, 8), 0.01, 0.1)),
    ("xi(r) within 10 % from r", "0.1 / 0.2 Mpc/h", lambda e: grade(e["drawn"]["xi_within_10_percent_from"], 0.1, 0.2)),
    ("number of groups of 100 and more", "5 % / 10 %", lambda e: grade(worst_group(e, 2), 0.05, 0.1)),
    ("number of groups of 50 to 99", "5 % / 10 %", lambda e: grade(worst_group(e, 1), 0.05, 0.1)),
    ("number of groups of 20 to 49", "5 % / 10 %", lambda e: grade(worst_group(e, 0), 0.05, 0.1)),
    ("mass in the cores of groups of 100 to 299: 1 - median", "5 % / 20 %", lambda e: grade(None if e["drawn"]["core_mass"] is None else abs(1 - e["drawn"]["core_mass"]), 0.05, 0.2)),
    ("nearest neighbours, `count`: mean and median", "5 % / 15 %", lambda e: grade(spacing(e, "count"), 0.05, 0.15)),
    ("nearest neighbours, `spaced`: mean and median", "5 % / 15 %", lambda e: grade(spacing(e, "spaced"), 0.05, 0.15)),
    ("positions of single particles, velocities, histories, merger trees", "never", lambda e: "no"),
]
head("analysis", "limits", *[name_of(e) for e in results])
for what, limits, judge in ANALYSES:
    row(what, limits, *[judge(e) for e in results])
line()

at = next(e for e in results if e["model"] == "300-default")
d, s = at["drawn"], at["drawn"]["spectrum"]
xi = d["xi_within_10_percent_from"]
floors = [
    ("density correlation", f'{d["density"]["correlation"]:.4f}', "0.998", "0.9993", d["density"]["correlation"] >= 0.998, d["density"]["correlation"] >= 0.9993),
    ("MAE of delta, `count`", f'{d["density"]["mae"]:.4f}', "0.21", "0.15", d["density"]["mae"] <= 0.21, d["density"]["mae"] <= 0.15),
    ("the same, `stratified`", f'{at["stratified"]["density"]["mae"]:.4f}', "0.21", "0.15", at["stratified"]["density"]["mae"] <= 0.21, at["stratified"]["density"]["mae"] <= 0.15),
    ("largest deviation of P(k) to 8 h/Mpc", percent(s["largest_deviation"]), "5 %", "1 %", s["largest_deviation"] <= 0.05, s["largest_deviation"] <= 0.01),
    ("r(k) there", f'{s["r_at_k_max"]:.3f}', "measured", "", True, None),
    ("xi(r) within 10 % for r above, Mpc/h", "nowhere" if xi is None else f"{xi:.3f}", "0.2", "0.1", xi is not None and xi <= 0.2, xi is not None and xi <= 0.1),
    ("groups of 100 and more", percent(worst_group(at, 2)), "5 %", "3 %", worst_group(at, 2) <= 0.05, worst_group(at, 2) <= 0.03),
    ("groups of 50 to 99", percent(worst_group(at, 1)), "25 %", "10 %", worst_group(at, 1) <= 0.25, worst_group(at, 1) <= 0.1),
    ("groups of 20 to 49", percent(worst_group(at, 0)), "30 %", "10 %", worst_group(at, 0) <= 0.3, worst_group(at, 0) <= 0.1),
    ("core mass, groups of 100 to 299", f'{d["core_mass"]:.2f}', "measured", "0.8", True, d["core_mass"] >= 0.8),
    ("nearest neighbours, `spaced`: mean; median", f'{at["spaced"]["nearest_mean"]:.3f}; {at["spaced"]["nearest_median"]:.3f}', "0.85-1.15; 0.7-1.4", "0.95-1.05; 0.9-1.1",
     0.85 <= at["spaced"]["nearest_mean"] <= 1.15 and 0.7 <= at["spaced"]["nearest_median"] <= 1.4, 0.95 <= at["spaced"]["nearest_mean"] <= 1.05 and 0.9 <= at["spaced"]["nearest_median"] <= 1.1),
]
line("## Ratio 300, default effort, against what was aimed at")
line()
head("", "measured", "floor", "stretch", "floor met", "stretch met")
for what, value, floor, stretch, a, b in floors:
    row(what, value, floor, stretch, "yes" if a else "**no**", "" if b is None else "yes" if b else "no")
line()
notes = os.path.join(os.path.dirname(os.path.abspath(__file__)), "recovery-notes.md")
if os.path.exists(notes):
    text.append(open(notes).read().rstrip())
with open(page, "w") as f:
    f.write("\n".join(text) + "\n")
