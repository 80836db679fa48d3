"""The rows of tests/options/cases.json through the package and the command; crates/particlegs runs them in Rust."""

import json
import subprocess
import warnings
from pathlib import Path

import pytest

import particlegs as pg

ROOT = Path(__file__).parents[2]
CASES = json.loads((ROOT / "tests/options/cases.json").read_text())
SAMPLE = ROOT / "samples/nbody64"
KEYWORDS = {"from": "from_size", "particles": "n"}
# The package has no jobs.
JOB_PARTS = ("scatter", "block")
ROWS = [(verb, row) for verb, rows in CASES.items() for row in rows]


def paths_of(row):
    columns = ["yy", "xx", "zz"] if row.get("input") == "another snapshot" else []
    return [SAMPLE / f"{name}.f32" for name in columns] or [SAMPLE]


def region_of(row):
    return (0, 12.5, 0, 25, 0, 25) if row.get("input") == "a region" else None


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    path = tmp_path_factory.mktemp("options") / "m.pgs"
    pg.compress(pg.open(SAMPLE, every=16), gaussians=60, effort="fast").save(path)
    return path


def model_of(row, made):
    return ROOT / "tests/options/altered.pgs" if row.get("model") == "altered" else made


def by_package(verb, row, made, folder):
    """Notes, the error and the JSON of a row."""
    keywords = {KEYWORDS.get(name, name.replace("-", "_")): value for name, value in row["options"].items()}
    record = None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            snapshot = pg.open(paths_of(row), every=16, region=region_of(row))
            model = pg.read(model_of(row, made))
            if verb == "compress":
                pg.compress(snapshot, **keywords)
            elif verb == "series":
                pg.compress_series([SAMPLE], folder / "run.pgs", **keywords)
            elif verb == "convert":
                snapshot.save(folder / row["output"], overwrite=True)
            elif verb == "render":
                model.render(**{"size": (32, 32), **keywords})
            elif verb == "eval":
                model.eval(snapshot, **keywords)
            elif verb == "merge":
                model.merge(model, **keywords)
            elif verb == "stats":
                pg.stats(snapshot, model, **keywords)
            elif verb == "haloes":
                pg.haloes(model, **keywords)
            elif verb == "export":
                model.export(folder / row["output"], overwrite=True, **keywords)
            elif verb == "verify":
                record = model.verify(snapshot if "input" in row else None, **keywords)
            elif verb == "recover":
                model.recover(**keywords)
            else:
                getattr(model, verb)(**keywords)
            error = None
        except (ValueError, MemoryError, OSError) as refused:
            error = str(refused)
    return [str(w.message) for w in caught], error, record


def by_command(verb, row, made, folder, command):
    words = [command, verb]
    words += [str(p) for p in paths_of(row)] if verb in ("compress", "plan") else [str(model_of(row, made))]
    if verb == "verify" and "input" in row:
        words += [str(p) for p in paths_of(row)]
    inputs = {
        "stats": [SAMPLE, made],
        "series": [SAMPLE],
        "convert": [SAMPLE],
        "eval": [made, SAMPLE],
        "merge": [made, made],
    }
    words[2:] = [str(p) for p in inputs[verb]] if verb in inputs else words[2:]
    if verb in ("compress", "plan", "convert", "eval") or (verb == "verify" and "input" in row):
        words += ["--every", "16"]
    if region := region_of(row):
        words += [f"--region={','.join(map(str, region))}"]
    if verb in JOB_PARTS:
        plan = [command, "plan", SAMPLE, "--every=16", "--gaussians=50", "--blocks=2", "-o", folder / "job", "--quiet"]
        subprocess.run(plan, check=True)
        words[2:] = [str(folder / "job"), str(row["options"]["number"])]
    elif verb not in ("verify", "eval"):
        outputs = {
            "compress": "c.pgs",
            "plan": "planned",
            "render": "r.png",
            "simplify": "s.pgs",
            "series": "run.pgs",
            "merge": "mm.pgs",
            "recover": "drawn",
            "haloes": "h.csv",
            "stats": "stats",
        }
        words += ["-o", str(folder / (outputs.get(verb) or row["output"]))]
        words += [] if verb in ("stats", "render") else ["--force"]
    options = {} if verb in JOB_PARTS else row["options"]
    if verb == "render":
        options = {"size": [32, 32], "projection": "orthographic" if "width" in options else "perspective", **options}
    for name, value in options.items():
        name = {"cells": "grid", "layers": "layer"}.get(name, name)
        between = "x" if name == "size" else ","
        text = between.join(map(str, value)) if isinstance(value, list) else str(value)
        words += [f"--{name}"] if value is True else [f"--{name}={text}"]
    done = subprocess.run([*words, "--json", "-"], capture_output=True, text=True, cwd=folder)
    lines = done.stderr.splitlines()
    notes = [line.removeprefix("note: ") for line in lines if line.startswith("note: ")]
    errors = [line.removeprefix("error: ") for line in lines if line.startswith("error: ")]
    record = json.loads(done.stdout) if done.stdout.startswith("{") else None
    assert (done.returncode != 0) == bool(errors), done.stderr
    return notes, "\n".join(errors) or None, record


@pytest.mark.parametrize(("verb", "row"), ROWS, ids=[f"{verb} {row['options']}" for verb, row in ROWS])
def test_package_and_command_say_what_the_table_says(verb, row, made, tmp_path, command):
    results = [by_command(verb, row, made, tmp_path, command)]
    if verb not in ("plan", *JOB_PARTS):
        results.insert(0, by_package(verb, row, made, tmp_path))
    for notes, error, record in results:
        wrong = record["wrong"] if record and "wrong" in record else error
        expected = row.get("error", row.get("wrong"))
        assert (expected is None) == (wrong is None), wrong
        assert expected is None or expected in wrong
        if "notes" in row:
            assert len(notes) == len(row["notes"]), notes
            assert all(text in note for text, note in zip(row["notes"], notes)), notes
        if "certificate" in row:
            assert record["certificate"] == row["certificate"]
    if verb == "verify" and "error" not in row:
        of_package, of_command = (record for _, _, record in results)
        assert {key: of_package[key] for key in of_command} == of_command
