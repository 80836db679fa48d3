#!/usr/bin/env python3
"""The pictures of docs/guide/certificate.md: what each figure looks like when it fails.

usage: scripts/certificate-pictures.py [OUT=docs/images]

Needs target/release/particlegs and pillow. All pictures are the program's own, of the bundled sample and of a crystal
of 16^3 atoms; this script makes the input, puts panels side by side and writes what they are above them.
"""
import json
import pathlib
import struct
import subprocess
import sys
import tempfile

from PIL import Image, ImageDraw, ImageFont

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = ROOT / "target/release/particlegs"
SAMPLE = ROOT / "samples/nbody64"
PANEL = (480, 270)
HEAD = 30


def run(*words):
    subprocess.run([PROGRAM, *map(str, words), "--quiet"], check=True, stdout=subprocess.DEVNULL)


def montage(path, panels, levels=200):
    """Panels side by side, each with its words above."""
    gap = 6
    (width, height), n = PANEL, len(panels)
    sheet = Image.new("RGB", (n * width + (n - 1) * gap, height + HEAD), "white")
    font = ImageFont.load_default(16)
    for i, (words, file) in enumerate(panels):
        picture = Image.open(file).convert("RGB").resize(PANEL, Image.LANCZOS)
        sheet.paste(picture, (i * (width + gap), HEAD))
        ImageDraw.Draw(sheet).text((i * (width + gap) + 4, 6), words, fill="black", font=font)
    sheet.quantize(levels, dither=Image.NONE).save(path, optimize=True)


def crystal(folder, edge=16):
    folder.mkdir()
    for k, axis in enumerate("xyz"):
        values = [(i // edge**k) % edge + 0.5 for i in range(edge**3)]
        (folder / f"{axis}{axis}.f32").write_bytes(struct.pack(f"<{len(values)}f", *values))
    (folder / "meta.json").write_text(json.dumps({"box": edge}))


def seen(work, name, out, source, *how):
    """One picture: of a model by `render`, of particles by `reference`."""
    command = "render" if str(source).endswith(".pgs") else "reference"
    run(command, source, *how, "-o", work / f"{name}.png")
    return work / f"{name}.png" if out is None else out


def main():
    out = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "docs/images")
    with tempfile.TemporaryDirectory() as folder:
        work = pathlib.Path(folder)
        small, good = work / "small.pgs", work / "good.pgs"
        run("compress", SAMPLE, "-o", small, "--ratio", 1000, "--certificate", "quick", "--json", work / "small.json")
        run("compress", SAMPLE, "-o", good, "--ratio", 300, "--certificate", "none")
        certificate = json.loads((work / "small.json").read_text())["certificate"]
        kept = certificate["subset"]["kept"]
        subset = work / "subset"
        run("convert", SAMPLE, "--sample", kept, "-o", subset)
        r0 = 0.0406 * 25 / 64
        look = ["--size", "960x540", "--azimuth", 30, "--elevation", 20]

        def panel(name, source, *how):
            return seen(work, name, None, source, *look, *how)

        def trio(file, radius, *how):
            scale = (64**3 / kept) ** 0.5
            montage(out / file, [
                ("all 262 144 particles", panel("a", SAMPLE, "--radius", radius, *how)),
                ("model of 3.1 kB (ratio 1000)", panel("b", small, "--radius", radius, *how)),
                (f"{kept} particles in as many bytes", panel("c", subset, "--radius", radius * scale, *how)),
            ])

        trio("certificate-large-radius.png", 6 * r0)
        close = ["--distance", 0.15, "--radius", r0]
        montage(out / "certificate-close-up.png", [
            ("all particles, from within", panel("d", SAMPLE, *close)),
            ("model of 10 kB (ratio 300)", panel("e", good, *close)),
            ("model of 3.1 kB (ratio 1000)", panel("f", small, *close)),
        ])
        window = ["--style", "density", "--projection", "orthographic", "--size", "960x540", "--center", "12.5,12.5,12.5",
                  "--width", 25, "--depth", 5, "--no-annotations", "--range", "3,3000"]
        montage(out / "certificate-density.png", [
            ("surface density, all particles", seen(work, "g", None, SAMPLE, *window, "--smooth", 16)),
            ("model of 10 kB (ratio 300)", seen(work, "h", None, good, *window)),
            ("model of 3.1 kB (ratio 1000)", seen(work, "i", None, small, *window)),
        ])
        atoms, model = work / "atoms", work / "crystal.pgs"
        crystal(atoms)
        run("compress", atoms, "-o", model, "--certificate", "none")
        large = ["--size", "960x540", "--azimuth", 20, "--elevation", 15, "--radius", 0.2, "--opacity", 0.3]
        montage(out / "certificate-crystal.png", [
            ("a crystal of 4096 atoms", seen(work, "j", None, atoms, *large)),
            ("its model at ratio 8: the box", seen(work, "k", None, model, *large)),
        ])


main()
