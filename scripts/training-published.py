#!/usr/bin/env python3
"""Trains models as the paper's tables have them, at a reduced scale, and keeps what each run says.

    scripts/training-published.py PARTICLEGS SNAPSHOT WORK RESULTS.json [--quick] [--again] [NAME ...]

SNAPSHOT is a folder of raw columns (nbody128, or samples/nbody64). Models and reference pictures are made
in WORK. Every run is added to RESULTS.json by its name; what stands there is not done again (--again does).
Named runs alone are done where names are given; a name that ends in `*` stands for all that begin so.
--quick: a few steps at stamp size, to see that all of it runs. Standard library only.

A run: its command and the hyper-parameters that differ from the preset's, wall-clock and CPU seconds, load
average, what `compress` said, and scores: PSNR, masked PSNR and SSIM of `render` against `reference`, by
group of views. `scripts/training-published-page.py RESULTS.json` writes the page from it.
"""
import array, json, math, os, random, shutil, subprocess, sys, time

QUICK, AGAIN = "--quick" in sys.argv, "--again" in sys.argv
PROGRAM, SNAPSHOT, WORK, RESULTS, *NAMES = [a for a in sys.argv[1:] if a not in ("--quick", "--again")]

# The published recipe shrunk: resolutions, counts and rates' schedules by SCALE, steps to STEPS.
SCALE, STEPS, BLOCK_STEPS, TUNE_STEPS = (0.05, 60, 40, 40) if QUICK else (0.1, 1600, 400, 400)
SIZE = (288, 162) if QUICK else (576, 324)  # of the last stages, and of the evaluation
SMALL = (96, 54) if QUICK else (192, 108)  # of the first stage, at which the paper evaluates
FRAMES = 2 if QUICK else 8  # a group
MOST = 4000 if QUICK else 30000  # Gaussians a block: never reached, so that counts are the recipe's own
SCORED_OFTEN = "evaluate_views = 4\n"


# Views ------------------------------------------------------------------------------------------------


def bounds():
    sides = []
    for name in ("xx", "yy", "zz"):
        column = array.array("f")
        path = os.path.join(SNAPSHOT, name + ".f32")
        with open(path, "rb") as f:
            column.fromfile(f, os.path.getsize(path) // 4)
        sides.append((min(column), max(column)))
    return sides, len(column)


def spiral(center, distance, frames, turn):
    """The published spiral, turned about the vertical so that groups share no pose."""
    loops = math.floor(math.sqrt(frames))
    for i in range(frames):
        t = i / max(frames - 1, 1)
        y = 0.99 * (1 - 2 * t)
        s, angle = math.sqrt(1 - y * y), 2 * math.pi * loops * t + turn
        d = (math.cos(angle) * s, y, math.sin(angle) * s)
        up = [0, 0, 1] if abs(y) > 0.95 else [0, 1, 0]
        yield [c + distance * k for c, k in zip(center, d)], up


def groups():
    """(group, orbit, radius factor, opacity factor); None = Beta(3, 3) in [0.25, 1.75]."""
    for orbit in (1.3, 1.0, 0.85, 0.7, 0.6, 0.5, 0.35):
        yield f"orbit-{orbit}", orbit, None, None
    for orbit in (1.0, 0.7, 0.5):
        yield f"default-{orbit}", orbit, 1.0, 1.0
    for r in (0.5, 1.5, 2.0, 2.5):
        yield f"radius-{r}", 0.7, r, 1.0
    for a in (0.5, 1.5, 2.0, 2.4):
        yield f"opacity-{a}", 0.7, 1.0, a


def views_file(name, size, wanted):
    path = os.path.join(WORK, name + ".json")
    (box, count), views = bounds(), []
    center = [(a + b) / 2 for a, b in box]
    extent = [b - a for a, b in box]
    base = 0.65 * 0.5 * math.dist(extent, [0] * 3) / math.sin(math.radians(15))
    radius = 0.0406 * (math.prod(extent) / count) ** (1 / 3)
    for number, (group, orbit, r, a) in enumerate(groups()):
        if group not in wanted:
            continue
        draw = random.Random(1000 + number)
        within = lambda: 0.25 + 1.5 * draw.betavariate(3, 3)
        # Groups of one orbit with given radius and opacity share their poses, to be compared.
        turn = 0.37 if r else 0.1 + 0.05 * number
        for i, (position, up) in enumerate(spiral(center, orbit * base, FRAMES, turn)):
            views.append({"name": f"{group}_{i:02}", "position": position, "focal_point": center, "view_up": up,
                          "radius": radius * (r or within()), "opacity": 0.05 * (a or within())})
    with open(path, "w") as f:
        json.dump({"width": size[0], "height": size[1], "fov_deg": 30.0, "views": views}, f)
    return path


IN_RANGE = ("orbit-1.0", "orbit-0.7", "orbit-0.5")
SETS = {"all": (SIZE, [g[0] for g in groups()]), "in-range": (SIZE, IN_RANGE), "small": (SMALL, IN_RANGE)}


def run_quietly(*command):
    done = subprocess.run([PROGRAM, *command, "--quiet"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(command)}: {done.stderr.strip()}")


def reference(which, style):
    """The folder of a set's reference pictures in a style, drawn once."""
    folder = os.path.join(WORK, f"reference-{which}-{style}")
    if not os.path.exists(os.path.join(folder, "done")):
        run_quietly("reference", SNAPSHOT, "--views", os.path.join(WORK, which + ".json"), "--style", style, "--out", folder)
        open(os.path.join(folder, "done"), "w").close()
    return folder


def compared(drawn, truth):
    path = os.path.join(WORK, "compared.json")
    run_quietly("compare", drawn, truth, "--json", path)
    found = {}
    with open(path) as f:
        for view in json.load(f)["views"]:
            found.setdefault(view["name"].split("_")[0], []).append(view)
    mean = lambda views, key: round(sum(v[key] for v in views) / len(views), 4)
    return {g: {k: mean(v, k) for k in ("psnr", "masked_psnr", "ssim")} for g, v in found.items()}


def pictures(folder):
    """A fresh folder of pictures, where `compare` finds none of another set's."""
    path = os.path.join(WORK, folder)
    shutil.rmtree(path, ignore_errors=True)
    return path


def scores(model, which):
    out = {}
    for look in ("paraview", "expected"):
        drawn, truth = pictures("drawn"), pictures("truth")
        run_quietly("render", model, "--views", os.path.join(WORK, which + ".json"), "--style", look, "--out", drawn)
        shutil.copytree(reference(which, look), truth, ignore=shutil.ignore_patterns("done"))
        out[look] = compared(drawn, truth)
    return out


# Runs -------------------------------------------------------------------------------------------------


def timed(command):
    """Runs a command; its wall-clock and CPU seconds and the load average about it."""
    load, start = os.getloadavg()[0], time.time()
    process = subprocess.Popen([PROGRAM, *command, "--quiet"], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(f"{' '.join(command)}: exit code {process.returncode}")
    return {"wall_seconds": round(time.time() - start, 2), "cpu_seconds": round(used.ru_utime + used.ru_stime, 2),
            "load_average": [round(load, 2), round(os.getloadavg()[0], 2)]}


def shown(command):
    """The command as a reader would type it."""
    words = ["nbody128" if w == SNAPSHOT and "128" in w else os.path.basename(w) if os.sep in w else w for w in command]
    return "particlegs " + " ".join(words)


def path_of(name):
    return os.path.join(WORK, name + ".pgs")


def last_of_log(path):
    best = {}
    with open(path) as f:
        for line in f:
            entry = json.loads(line)
            if entry["held_out_masked_psnr"] is not None:
                best = entry if entry["held_out_masked_psnr"] > best.get("held_out_masked_psnr", -1) else best
    return {"best_at_step": best.get("iteration"), "gaussians_at_best": best.get("gaussians")}


def train(name, options, changes="", seed=None, which="in-range"):
    """Compresses with training and scores the file."""
    config, said, log = (os.path.join(WORK, f"{name}{end}") for end in (".toml", "-said.json", ".jsonl"))
    command = ["compress", SNAPSHOT, "-o", path_of(name), "--force", *options, "--certificate=none", "--json", said]
    if "--train" in options:
        with open(config, "w") as f:
            f.write(SCORED_OFTEN + changes)
        command += ["--config", config, "--log", log]
    if seed:
        command += ["--seed", str(seed)]
    result = {**timed(command), "command": shown(command), "changes": changes}
    with open(said) as f:
        said = json.load(f)
    result.update({k: said[k] for k in ("particles", "gaussians", "model_bytes", "compression_ratio", "step_factor",
                                       "seconds_by_phase", "trained")})
    if "--train" in options and "--blocks" not in options:
        result.update(last_of_log(log))
    return {**result, "scores": scores(path_of(name), which), "small": scores(path_of(name), "small")}


PAPER = ["--train", "paper", "--law", "alpha-blend", "--scale", str(SCALE), "--iterations", str(STEPS)]
FREE = ["--gaussians", str(MOST)]  # nominal steps of the codec, as many Gaussians as the recipe makes


def paper(name, changes="", law="alpha-blend", which="in-range", seed=None, steps=STEPS):
    options = ["--train", "paper", "--law", law, "--scale", str(SCALE), "--iterations", str(steps), *FREE]
    return train(name, options, changes, seed, which)


def known(name):
    if name not in results or not os.path.exists(path_of(name)):
        keep(name)
    return results[name]


def law_run(name):
    """The optical-depth law at the bytes of the full alpha-blend model; trained for its time, fit included."""
    full = known("full")
    size = ["--size", str(full["model_bytes"])]
    if name == "depth-untrained":
        return train(name, size, which="all")
    fit = known("depth-untrained")["wall_seconds"]
    minutes = max(full["wall_seconds"] - fit, 5) / 60
    scale = SIZE[0] / 1440  # the last stage of `fast` at the size that is scored
    # More steps than the time has room for: rates fall by the time.
    options = [*size, "--train", "fast", "--scale", f"{scale:.3f}", "--iterations", str(5 * STEPS), "--minutes", f"{minutes:.3f}"]
    return train(name, options, which="all")


def reference_scores(_):
    """Of no model: the noise-free picture against ParaView's, and the other look against it."""
    out = {}
    for which in SETS:
        drawn, truth = pictures("drawn"), pictures("truth")
        for folder, style in ((drawn, "response-fxaa"), (truth, "paraview")):
            shutil.copytree(reference(which, style), folder, ignore=shutil.ignore_patterns("done"))
        out[which] = compared(drawn, truth)
    return {"noise_free": out, "size": SIZE, "small_size": SMALL, "frames": FRAMES, "particles": bounds()[1],
            "scale": SCALE, "steps": STEPS, "block_steps": BLOCK_STEPS, "tune_steps": TUNE_STEPS,
            "snapshot": os.path.basename(os.path.normpath(SNAPSHOT))}


ONE_STAGE = f"""[[stages]]
iterations = 39000
size = [1920, 1080]
crop = [0, 0]
oversample = 2
internal = 0.0
densify = {{ every = 100, until = 36000, threshold = 0.0002 }}
"""
NO_DENSIFY = "".join(f"""[[stages]]
iterations = {n}
size = [{w}, {h}]
crop = [0, 0]
oversample = {o}
internal = {i}
densify = {{ every = 0, until = 0, threshold = 0.0 }}
""" for n, w, h, o, i in ((12000, 1920, 1080, 2, 0.0), (15000, 5760, 3240, 1, 0.0), (12000, 5760, 3240, 1, 0.2)))
# Per-block rates of the published artifact (docs/law/published.md, "Blocks, merge, fine-tuning").
BLOCK_RATES = "[alpha_blend]\nleast_opacity = 0.03\nscale_rate = 0.0005\nposition_rate = 0.00008\nposition_rate_end = 0.0000008\n"

ABLATIONS = {
    "no-vizmapper": "[alpha_blend]\nvizmapper = false\n",
    "single-resolution": ONE_STAGE,
    "far-orbit": "[cameras]\norbits = [1.0]\n",
    "no-densify": NO_DENSIFY,
    "no-reset": "[alpha_blend]\nreset_every = 0\n",
    "dssim-0.2": "[loss]\ndssim = 0.2\n",
    "l2": '[loss]\nnorm = "l2"\n',
    "expected": 'target = "expected"\n',
    "start-partition": 'start = "partition"\n',
    "start-fit": 'start = "fit"\n',
}


def blocks(k, changes="", which="in-range", seed=None):
    # The single block's own steps again, so that the row `1` is one of the sweep.
    options = ["--train", "paper", "--law", "alpha-blend", "--scale", str(SCALE), "--iterations", str(BLOCK_STEPS),
               "--gaussians", str(MOST * k), "--blocks", str(k)]
    return lambda name: train(name, options, changes, seed, which)


TUNED_STAGE = """[[stages]]
iterations = 60000
size = [1920, 1080]
crop = [0, 0]
oversample = 2
internal = 0.0
densify = { every = 0, until = 0, threshold = 0.0 }
"""


def can_fine_tune():
    help_ = subprocess.run([PROGRAM, "finetune", "--help"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return help_.returncode == 0


def fine_tune(k, changes="", densify=True):
    """The merged model of k blocks, tuned on the whole; as many Gaussians as the recipe makes, nominal steps."""

    def run(name):
        merged = known(f"blocks-{k}")
        config, said = os.path.join(WORK, name + ".toml"), os.path.join(WORK, name + "-said.json")
        stages = "" if densify else TUNED_STAGE
        text = f"evaluate_views = 4\n{changes}{stages}"
        with open(config, "w") as f:
            f.write(text)
        command = ["finetune", path_of(f"blocks-{k}"), SNAPSHOT, "-o", path_of(name), "--force", "--scale", str(SCALE),
                   "--iterations", str(TUNE_STEPS), "--gaussians", str(2 * MOST * k),
                   "--config", config, "--certificate=none", "--json", said]
        result = {**timed(command), "command": shown(command), "changes": text, "particles": merged["particles"]}
        with open(said) as f:
            said = json.load(f)
        result.update({n: said.get(n) for n in ("gaussians", "model_bytes", "compression_ratio", "step_factor", "trained")})
        return {**result, "scores": scores(path_of(name), "in-range"), "small": scores(path_of(name), "small")}

    return run


def recover(of, method="count", scale=None):
    def run(name):
        known(of)
        drawn, out = os.path.join(WORK, "recovered"), os.path.join(WORK, "stats")
        shutil.rmtree(drawn, ignore_errors=True)
        command = ["recover", path_of(of), "-o", drawn, "--force", "--method", method] + (["--scale", str(scale)] if scale else [])
        result = {**timed(command), "of": of, "method": method, "scale": scale or 1}
        # 16.8 particles a cell and, for neighbours, one particle of 562: as the published table has them.
        thinned = max(round(bounds()[1] / 562), 100)
        grid = round((bounds()[1] / 16.8) ** (1 / 3))
        wanted = ["stats", SNAPSHOT, drawn, "-o", out, "--convention", "paper", "--no-plots"]
        first = [*wanted, "--only", "density,spectrum,neighbours", "--grid", str(grid), "--neighbours", str(thinned)]
        run_quietly(*first)
        with open(os.path.join(out, "stats.json")) as f:
            s = json.load(f)
        shells = [h for h in s["spectra"]["shells"] if h["ratio"] is not None]
        nyquist = math.pi / s["spacing"]
        result.update({
            "command": [shown(command), shown(first)],
            "grid": grid, "thinned_to": thinned,
            "correlation": s["summary"]["density_correlation"], "mae": s["summary"]["density_mean_absolute_error"],
            "lowest_two_power_ratios": [h["ratio"] for h in shells[:2]],
            "power_mean_deviation_to_nyquist": sum(abs(h["ratio"] - 1) for h in shells if h["k"] <= nyquist)
            / max(sum(h["k"] <= nyquist for h in shells), 1),
            "power_within_10_percent_to": s["summary"]["power_within_10_percent_to"],
            "r_above_0_9_to": s["summary"]["r_above_0_9_to"],
            "nearest": [d["mean"] for d in s["neighbours"]["distances"]],
        })
        run_quietly(*wanted, "--only", "neighbours")
        with open(os.path.join(out, "stats.json")) as f:
            result["nearest_of_many"] = [d["mean"] for d in json.load(f)["neighbours"]["distances"]]
        return result

    return run


def turning(_):
    """Pictures of cameras 0.02 degrees apart: what jumps where the order of depths changes."""
    with open(os.path.join(WORK, "all.json")) as f:
        file = json.load(f)
    view = next(v for v in file["views"] if v["name"].startswith("default-0.7"))
    center, d = view["focal_point"], [a - b for a, b in zip(view["position"], view["focal_point"])]
    views = []
    for i in range(13):
        c, s = math.cos(math.radians(0.02 * i)), math.sin(math.radians(0.02 * i))
        turned = [c * d[0] + s * d[2], d[1], c * d[2] - s * d[0]]
        views.append({**view, "name": f"turn_{i:02}", "position": [a + b for a, b in zip(center, turned)]})
    path = os.path.join(WORK, "turning.json")
    with open(path, "w") as f:
        json.dump({"width": 960, "height": 540, "fov_deg": 30.0, "views": views}, f)
    out = {}
    for name in ("full", "depth-untrained"):
        drawn, first, second = pictures("drawn"), pictures("first"), pictures("second")
        run_quietly("render", path_of(name), "--views", path, "--style", "expected", "--out", drawn)
        for folder, ahead in ((first, 0), (second, 1)):
            os.mkdir(folder)
            for i in range(12):
                shutil.copy(os.path.join(drawn, f"turn_{i + ahead:02}.png"), os.path.join(folder, f"turn_{i:02}.png"))
        said = os.path.join(WORK, "compared.json")
        run_quietly("compare", first, second, "--json", said)
        with open(said) as f:
            steps = json.load(f)["views"]
        out[name] = {"largest_differences": [v["largest_difference"] for v in steps], "psnr": [round(v["psnr"], 2) for v in steps]}
    return out


def ablation(name):
    return lambda n: paper(n, ABLATIONS[name], which="all" if name in ("no-vizmapper", "start-fit") else "in-range")


def all_runs():
    yield "reference", reference_scores
    yield "full", lambda n: paper(n, which="all")
    yield "no-vizmapper", ablation("no-vizmapper")
    yield "depth-untrained", law_run
    yield "depth-trained", law_run
    for name in ("start-fit", "single-resolution", "far-orbit"):
        yield name, ablation(name)
    for k in (1, 2, 4, 8):
        yield f"blocks-{k}", blocks(k)
    for of in ("full", "blocks-8"):
        for method in ("count", "volume", "ellipsoid", "grid"):
            yield f"recover-{of}-{method}", recover(of, method)
    for scale in (1.2, 1.5, 1.8, 2, 2.5, 3):
        yield f"recover-full-scale-{scale}", recover("full", "count", scale)
    for of in ("start-fit", "blocks-1", "blocks-2", "blocks-4", "depth-untrained", "depth-trained"):
        yield f"recover-{of}-count", recover(of)
    yield "turning", turning
    if can_fine_tune():
        for k in (1, 2, 4, 8):
            yield f"tuned-{k}", fine_tune(k)
        for k in (1, 2, 4, 8):
            yield f"recover-tuned-{k}-count", recover(f"tuned-{k}")
        yield "tuned-8-no-densify", fine_tune(8, densify=False)
        yield "tuned-8-dssim-1", fine_tune(8, "[loss]\ndssim = 1.0\n")
        yield "tuned-8-dssim-0.1", fine_tune(8, "[loss]\ndssim = 0.1\n")
    for seed in (43, 44):
        yield f"blocks-1-seed-{seed}", blocks(1, seed=seed)
    # The rest beside the single block of the sweep, which has as few steps.
    for name in ("no-densify", "l2", "dssim-0.2", "expected", "start-partition", "start-fit", "no-reset"):
        yield f"short-{name}", lambda n: paper(n, ABLATIONS[n[len("short-"):]], steps=BLOCK_STEPS)
    yield "short-law-depth", lambda n: paper(n, law="optical-depth", steps=BLOCK_STEPS)
    yield "blocks-4-published-rates", blocks(4, BLOCK_RATES)
    for seed in (43, 44):
        yield f"full-seed-{seed}", lambda n, s=seed: paper(n, seed=s)
        yield f"no-vizmapper-seed-{seed}", lambda n, s=seed: paper(n, ABLATIONS["no-vizmapper"], seed=s)


def keep(name):
    results[name] = dict(all_runs())[name](name)
    with open(RESULTS + ".new", "w") as f:
        json.dump(results, f, indent=1)
        f.write("\n")
    os.replace(RESULTS + ".new", RESULTS)
    print(name, results[name].get("wall_seconds", ""), "s", flush=True)


os.makedirs(WORK, exist_ok=True)
results = {}
if os.path.exists(RESULTS):
    with open(RESULTS) as f:
        results = json.load(f)
for which, (size, wanted) in SETS.items():
    views_file(which, size, wanted)
asked = lambda name: any(name == n or n.endswith("*") and name.startswith(n[:-1]) for n in NAMES)
for name, _ in all_runs():
    if NAMES and not asked(name) or name in results and not AGAIN:
        continue
    keep(name)
