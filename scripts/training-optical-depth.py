#!/usr/bin/env python3
"""Trains the optical-depth law on nbody128 at ratio 300, scores each model against VTK's twelve pictures and its
particles' statistics against the snapshot's, and keeps all of it.

    scripts/training-optical-depth.py PARTICLEGS DATA REFERENCE WORK RESULTS.json [NAME ...]

DATA holds xx.f32 yy.f32 zz.f32; REFERENCE views.json and paraview/. What RESULTS.json holds is kept unless named.
`scripts/training-optical-depth-page.py RESULTS.json` writes the page from it.
"""
import json, os, resource, subprocess, sys, time

PROGRAM, DATA, REFERENCE, WORK, RESULTS, *NAMES = sys.argv[1:]

# The stages of `fast` with density control in the first third.
STAGE = """[[stages]]
iterations = {}
size = {}
oversample = 1
crop = [0, 0]
internal = 0.05
densify = {{ every = {}, until = 1200, threshold = 0.0 }}
"""
DENSITY_CONTROL = STAGE.format(3000, [960, 540], 150) + STAGE.format(600, [1440, 810], 0)

# Name, options of compress, lines of its TOML.
RUNS = [
    ("untrained", [], ""),
    ("fast", ["--train", "fast"], ""),
    ("best", ["--train", "best"], ""),
    ("alpha-blend", ["--train", "fast", "--law", "alpha-blend"], ""),
    ("not-settled", ["--train", "fast"], "[optical_depth]\nsettle_from = 1.0\n"),
    ("rounding-unknown", ["--train", "fast"], "[optical_depth]\ncode_every = 0\n"),
    ("counts-fixed", ["--train", "fast"], "[optical_depth.rates]\nplace = 1.0\nshape = 1.0\ncount = 0.0\n"),
    ("counts-slow", ["--train", "fast"], "[optical_depth.rates]\nplace = 1.0\nshape = 1.0\ncount = 0.1\n"),
    ("not-calm", ["--train", "fast"], "[optical_depth]\ncalm = 0.0\n"),
    ("no-wide-views", ["--train", "fast"], "[cameras]\nwide = 0.0\n"),
    ("many-wide-views", ["--train", "fast"], "[cameras]\nwide = 0.4\n"),
    ("l1", ["--train", "fast"], "[loss]\nnorm = \"l1\"\nsmooth = 0.03\n"),
    ("target-paraview", ["--train", "fast"], "target = \"paraview\"\n"),
    ("density-control", ["--train", "fast"], DENSITY_CONTROL),
]


def particlegs(*args):
    subprocess.run([PROGRAM, *args, "--quiet"], check=True, stdout=subprocess.DEVNULL)


def path(*parts):
    return os.path.join(WORK, *parts)


def load(name):
    with open(path(name)) as f:
        return json.load(f)


def run(name, options, toml):
    model = path(name + ".pgs")
    if toml:
        with open(path(name + ".toml"), "w") as f:
            f.write(toml)
        options = [*options, "--config", path(name + ".toml")]
    cpu = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.time()
    particlegs("compress", DATA, "-o", model, "--force", "--certificate=none", *options, "--json", path(name + ".json"))
    wall = time.time() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    said = load(name + ".json")
    out = {
        "command": "particlegs compress nbody128 --certificate none " + " ".join(o for o in options if not o.endswith(".toml") and o != "--config"),
        "config": toml,
        "wall_seconds": round(wall, 1),
        "cpu_seconds": round(after.ru_utime + after.ru_stime - cpu.ru_utime - cpu.ru_stime, 1),
        "load_average": os.getloadavg()[0],
        **{k: said[k] for k in ("gaussians", "model_bytes", "compression_ratio", "step_factor", "seconds_by_phase")},
        "trained": [t["scores"] for t in said["trained"]],
    }
    particlegs("render", model, "--views", os.path.join(REFERENCE, "views.json"), "--style", "paraview", "--out", path(name))
    particlegs("compare", path(name), os.path.join(REFERENCE, "paraview"), "--json", path(name + "-scores.json"))
    out["views"] = {v["name"]: v["masked_psnr"] for v in load(name + "-scores.json")["views"]}
    subprocess.run(["rm", "-rf", path("particles")], check=True)
    particlegs("recover", model, "-o", path("particles"), "--force", "--method", "count")
    particlegs("stats", DATA, path("particles"), "-o", path(name + "-stats"), "--grid", "50", "--spectrum-grid", "512",
               "--only", "density,spectrum,groups", "--no-plots")
    out["science"] = science(load(os.path.join(name + "-stats", "stats.json")))
    subprocess.run(["rm", "-rf", path("particles")], check=True)
    return out


def science(s):
    shells, classes = s["spectra"]["shells"], s["groups"]["classes"]
    return {
        "correlation": s["summary"]["density_correlation"],
        "mae": s["summary"]["density_mean_absolute_error"],
        "power_ratio_lowest": [h["ratio"] for h in shells[:2]],
        "largest_power_deviation": s["summary"]["largest_power_deviation"],
        "groups": [[c["from"], *c["groups"]] for c in classes],
        "core_mass": s["summary"]["core_mass"],
    }


results = {}
if os.path.exists(RESULTS):
    with open(RESULTS) as f:
        results = json.load(f)
os.makedirs(WORK, exist_ok=True)
for name, options, toml in RUNS:
    if NAMES and name not in NAMES or not NAMES and name in results:
        continue
    results[name] = run(name, options, toml)
    with open(RESULTS, "w") as f:
        json.dump(results, f, indent=1)
        f.write("\n")
    print(name, results[name]["wall_seconds"], "s", flush=True)
