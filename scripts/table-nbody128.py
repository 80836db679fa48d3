#!/usr/bin/env python3
"""Prints the tables of docs/results/nbody128.md from what table-nbody128.sh wrote (standard library only)."""
import json
import os
import sys

out = sys.argv[1]
NINE = [f"{orbit}_{i:02d}" for orbit in ("far", "mid", "near") for i in range(3)]
EXTRA = ["large_radius", "inside", "high_opacity"]


def scores(name):
    with open(os.path.join(out, name + ".json")) as f:
        return {p["name"]: p for p in json.load(f)["views"]}


def row(*cells):
    print("| " + " | ".join(str(c) for c in cells) + " |")


def db(v):
    return "identical" if v is None else f"{v:.2f}"


print("### All particles against VTK (PSNR over all pixels; response: masked PSNR)\n")
row("view", "paraview-no-fxaa", "paraview", "response", "response-fxaa")
row(*["---"] * 5)
tables = [scores("reference-" + s) for s in ("paraview-no-fxaa", "paraview", "response", "response-fxaa")]
for view in NINE + EXTRA:
    row(view, db(tables[0][view]["psnr"]), db(tables[1][view]["psnr"]),
        *(f'{db(t[view]["psnr"])} / {db(t[view]["masked_psnr"])}' for t in tables[2:]))

print("\n### Models against VTK's `paraview` (masked PSNR, dB)\n")
row("model", "Gaussians", "bytes", "ratio", "bytes a Gaussian", "seconds", "nine views", "far_00", "mid_00", "near_00", *EXTRA)
row(*["---"] * 13)
for name in ["300-fast", "300-default"] + [f"{r}-default" for r in (30, 65, 100, 1000, 3000)]:
    if not os.path.exists(os.path.join(out, name + "-paraview.json")):
        continue
    s = scores(name + "-paraview")
    with open(os.path.join(out, name + "-compress.json")) as f:
        c = json.load(f)
    nine = sum(s[v]["masked_psnr"] for v in NINE) / 9
    row(name, c["gaussians"], c["model_bytes"], f'{c["compression_ratio"]:.1f}', f'{c["bytes_per_gaussian"]:.2f}',
        f'{c["seconds"]:.1f}', f"{nine:.2f}", *(db(s[v]["masked_psnr"]) for v in ("far_00", "mid_00", "near_00", *EXTRA)))
