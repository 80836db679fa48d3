#!/usr/bin/env python3
"""Draws the four diagrams of docs/law/published.md as SVG: the way from particles to pictures, the VizMapper, the
cameras, training in blocks (standard library only).

    scripts/diagrams.py docs/images
"""
import html
import math
import pathlib
import sys

OUT = pathlib.Path(sys.argv[1])
INK, BLUE, ORANGE, GREY = "#222", "#0072b2", "#d55e00", "#777"


class Page:
    """An SVG of boxes, arrows and words."""

    def __init__(self, name, width, height, title):
        self.name, self.size, self.parts = name, (width, height), []
        self.words(width / 2, 26, title, 17, "middle", weight="bold")

    def words(self, x, y, text, size=13, anchor="middle", colour=INK, weight="normal"):
        for i, line in enumerate(text.split("\n")):
            self.parts.append(f'<text x="{x:.1f}" y="{y + i * size * 1.3:.1f}" font-size="{size}" text-anchor="{anchor}" '
                              f'font-weight="{weight}" fill="{colour}">{html.escape(line)}</text>')

    def box(self, x, y, width, height, text, colour=BLUE, size=13):
        self.parts.append(f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="7" fill="{colour}" fill-opacity=".1" '
                          f'stroke="{colour}" stroke-width="1.6"/>')
        lines = text.count("\n") + 1
        self.words(x + width / 2, y + height / 2 + size * 0.35 - (lines - 1) * size * 0.65, text, size)

    def arrow(self, x1, y1, x2, y2, text="", colour=INK):
        self.parts.append(f'<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" stroke="{colour}" stroke-width="1.6" '
                          f'marker-end="url(#head)"/>')
        if text:
            self.words((x1 + x2) / 2, (y1 + y2) / 2 - 7, text, 11, colour=GREY)

    def path(self, points, colour, width=1.5, dash=""):
        data = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        self.parts.append(f'<polyline points="{data}" fill="none" stroke="{colour}" stroke-width="{width}" stroke-dasharray="{dash}"/>')

    def dot(self, x, y, radius, colour):
        self.parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="{colour}"/>')

    def write(self):
        width, height = self.size
        head = ('<defs><marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
                f'<path d="M0,0 L8,4 L0,8 z" fill="{INK}"/></marker></defs>')
        text = (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
                f'font-family="sans-serif"><rect width="100%" height="100%" fill="#fff"/>{head}\n' + "\n".join(self.parts) + "\n</svg>\n")
        (OUT / f"diagram-{self.name}.svg").write_text(text)


def ways():
    p = Page("ways", 940, 330, "From particles to pictures: compressors of coordinates, the published law, ours")
    for row, (y, colour) in enumerate(((60, GREY), (150, ORANGE), (240, BLUE))):
        p.box(20, y, 120, 60, "particles\n(x, y, z)", INK)
        name = ("SZ3, ZFP, LCP", "published:\nalpha blending", "ours:\noptical depth")[row]
        steps = (("coordinates\nwithin a bound", "particles\ndecoded", "all particles\ndrawn again"),
                 ("Gaussians trained\non pictures", "VizMapper:\nradius, opacity", "sorted\nand blended"),
                 ("Gaussians fitted to\nthe particles' moments", "file: means, shapes,\ncounts", "depths added up,\none tone curve"))[row]
        p.words(180, y - 6, name.replace("\n", " "), 12, "start", colour, "bold")
        for i, step in enumerate(steps):
            x = 180 + 190 * i
            p.arrow(x - 40 if i == 0 else x - 25, y + 30, x - 3, y + 30)
            p.box(x, y, 165, 60, step, colour, 12)
        p.arrow(725, y + 30, 777, y + 30)
        p.box(780, y, 140, 60, "picture at any view,\nradius, opacity", INK, 12)
    p.write()


def network():
    p = Page("vizmapper", 900, 300, "VizMapper: what radius and opacity change of a Gaussian (published law)")
    for i, text in enumerate(("mean log-scale of\nthe Gaussian", "its opacity\n(logit)", "particle radius\nover the default", "opacity\nover the default")):
        p.box(20, 50 + 58 * i, 170, 48, text, GREY, 12)
        p.arrow(190, 74 + 58 * i, 257, 135 + 14 * i)
    p.box(260, 105, 180, 90, "perceptron,\nthe same weights\nfor all Gaussians", ORANGE)
    for i, (text, y) in enumerate((("factor on its scale\nwithin the trained range", 75), ("factor on its opacity\nwithin the trained range", 175))):
        p.arrow(440, 135 + 30 * i, 507, y + 26)
        p.box(510, y, 190, 52, text, ORANGE, 12)
        p.arrow(700, y + 26, 757, 150)
    p.box(760, 120, 120, 60, "Gaussian\nas it is drawn", INK, 12)
    p.words(450, 286, "Ours has none of it: a radius scales the depth and widens the footprint in closed form, an opacity scales the depth.", 12, colour=BLUE)
    p.write()


def cameras():
    p = Page("cameras", 760, 430, "Cameras: three orbits about the box, each a spiral")
    def seen(x, y, z):
        a, e = math.radians(28), math.radians(18)
        x, z = x * math.cos(a) - z * math.sin(a), x * math.sin(a) + z * math.cos(a)
        return 330 + 165 * x, 235 - 165 * (y * math.cos(e) - z * math.sin(e))
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    # Half an edge of a cube whose half diagonal is base distance times sin 15 deg / 0.65.
    h = math.sin(math.radians(15)) / 0.65 / math.sqrt(3)
    for a in corners:
        for b in corners:
            if a < b and sum(i != j for i, j in zip(a, b)) == 1:
                p.path([seen(*(h * v for v in a)), seen(*(h * v for v in b))], INK, 1.2)
    frames = 60
    for distance, colour, dash in ((1.0, BLUE, ""), (0.7, ORANGE, ""), (0.5, "#009e73", "")):
        places = []
        for i in range(frames):
            t = i / (frames - 1)
            y = 0.99 * (1 - 2 * t)
            s, angle = math.sqrt(1 - y * y), 2 * math.pi * math.floor(math.sqrt(frames)) * t
            places.append(seen(distance * math.cos(angle) * s, distance * y, distance * math.sin(angle) * s))
        p.path(places, colour, 0.8, "3 3")
        for x, y in places:
            p.dot(x, y, 2.4, colour)
    for i, (text, colour) in enumerate((("far, 1.0 base distances", BLUE), ("mid, 0.7", ORANGE), ("near, 0.5", "#009e73"), ("box of the particles", INK))):
        p.dot(560, 120 + 26 * i, 5, colour)
        p.words(575, 124 + 26 * i, text, 13, "start")
    p.words(560, 260, "Base distance: 0.65 of what\nResetCamera takes. A fifth of\nthe last stage's cameras stand\ninside the box.", 12, "start", GREY)
    p.write()


def blocks():
    p = Page("blocks", 940, 300, "Training in blocks (published), and blocks without training (ours)")
    p.box(20, 110, 110, 70, "particles", INK)
    p.arrow(130, 145, 167, 145)
    p.box(170, 110, 120, 70, "k-d tree:\nblocks of equal\ncounts", GREY, 12)
    for i, name in enumerate(("block 1", "block 2", "block K")):
        y = 55 + 75 * i
        p.arrow(290, 145, 337, y + 25)
        p.box(340, y, 170, 50, f"{name}: trained (fitted)\nin its own frame", ORANGE, 12)
        p.arrow(510, y + 25, 557, 145)
    p.words(425, 198, "⋮", 16, colour=GREY)
    p.box(560, 110, 130, 70, "merged:\nglobal frame", ORANGE, 12)
    p.arrow(690, 145, 737, 105)
    p.box(740, 75, 180, 60, "published: fine-tuned on\nall particles' pictures", ORANGE, 12)
    p.arrow(690, 145, 737, 195)
    p.box(740, 165, 180, 60, "ours: nothing left to do,\ndepths add exactly", BLUE, 12)
    p.write()


for draw in (ways, network, cameras, blocks):
    draw()
