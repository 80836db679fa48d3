"""A reader of model files (.pgs) written from the words of docs/format.md alone, to hold that page and the
program's own reader to each other. Sections (1, 2, ...) are the page's.

    python3 pgs.py MODEL.pgs                every decoded number, as hexadecimal bits, one line a Gaussian
    python3 pgs.py --cut PREFIX MODEL.pgs   PREFIX-0.pgs, ..: open files that end within a section
"""
import json
import math
import struct
import sys
import zlib
from bisect import bisect_right
from operator import eq

import numpy as np

MAGIC = bytes.fromhex("89504753 0D0A1A0A")


class Corrupt(Exception):
    """The file is not what the page describes."""


class Unsupported(Exception):
    """A compatibility error: use a newer program."""


def check(condition, what):
    if not condition:
        raise Corrupt(what)


# ---------------------------------------------------------------- 1. The file

def sections(data, wanted=1):
    """(tag, content, place) of every section, and whether the file, which is of the `wanted` kind, is open."""
    check(data[:8] == MAGIC, "magic")
    check(len(data) >= 24, "shorter than a head")
    check(zlib.crc32(data[:20]) == struct.unpack_from("<I", data, 20)[0], "checksum of the head")
    major, minor, kind, reserved, length = struct.unpack_from("<4BQ", data, 8)
    if major != 1 or kind != wanted:
        raise Unsupported(f"major version {major}, kind {kind}")
    check(reserved == 0 or minor > 0, "reserved byte")
    check(length in (0, len(data)), "length of the file")
    found, at = [], 24
    while at < len(data):
        size, crc = struct.unpack_from("<QI", data, at + 4) if at + 16 <= len(data) else (len(data), 0)
        if size > len(data) - at - 16:
            check(length == 0, "length of a section")
            break
        tag, content = data[at : at + 4], data[at + 16 : at + 16 + size]
        check(zlib.crc32(content, zlib.crc32(data[at : at + 12])) == crc and tag.isalpha(), f"section {tag}")
        found.append((tag, content, at))
        at += 16 + size
    return found, length == 0


def belongs(tag, content):
    """The number of the block that a section belongs to, or None."""
    if not tag[1:2].islower():
        return None
    check(len(content) >= 4, "number of a block")
    return struct.unpack_from("<I", content)[0]


# What a section may follow, those that may stand anywhere left out.
AFTER = {b"META": [b""], b"CERT": [b"META"], b"VIZM": [b"META", b"CERT"], b"LAYR": [b"META", b"CERT", b"VIZM", b"BLOK"],
         b"BLOK": [b"LAYR", b"BLOK"], b"FiNE": [b"BLOK", b"FiNE"]}


def read(data):
    """A whole file: metadata, certificate, network, and layers as (name, blocks)."""
    found, is_open = sections(data)
    model = {"open": is_open, "layers": [], "cert": {}, "vizm": None}
    blocks, entries, listed = [], [], None  # stages of every block; what an index says
    fields = []  # sections of fields, then of their correlations
    before, left, last = b"", 0, (0, 0)
    for tag, content, place in found:
        number = belongs(tag, content)
        if tag == b"iNDX":
            check(before and listed is None and len(content) % 24 == 0, "index")
            listed = list(struct.iter_unpack("<4sIQQ", content))
            continue
        entries.append((tag, 0xFFFFFFFF if number is None else number, place, len(content)))
        if tag not in AFTER:
            check(before, "order")
            if tag[:1].isupper():
                raise Unsupported(f"section {tag}")
            if tag in (b"fiEL", b"shAR", b"fiCO"):
                fields.append((number, tag, content[4:]))
            continue
        check(before in AFTER[tag] and (left > 0) == (tag == b"BLOK"), "order")
        before = tag
        if tag == b"META":
            model["meta"] = metadata(content)
        elif tag == b"CERT":
            model["cert"] = certificate(content)
        elif tag == b"VIZM":
            check(model["meta"]["law"] == 2, "a network")
            model["vizm"] = network(content)
        elif tag == b"LAYR":
            check(content and len(content) == content[0] + 5, "length of a layer's head")
            name, left = content[1:-4].decode(), struct.unpack("<I", content[-4:])[0]
            check(left and len(model["layers"]) < 1024, "number of blocks or layers")
            check(not model["layers"] or model["layers"][-1][0] < name, "order of layers")
            model["layers"].append((name, []))
        elif tag == b"BLOK":
            blocks.append([content])
            model["layers"][-1][1].append(blocks[-1])
            left -= 1
        else:
            check(number < len(blocks) and (len(blocks[number]), number) > last, "order of stages")
            last = len(blocks[number]), number
            blocks[number].append(content[4:])
    check(blocks and (is_open or left == 0), "blocks are missing")
    check(all(e[1] in (0xFFFFFFFF, *range(len(blocks))) for e in entries), "a section of a block that there is not")
    check(listed is None or listed == entries or is_open and all(map(eq, listed, entries)), "index")
    model["layers"] = [(name, [Block(stages) for stages in own]) for name, own in model["layers"] if own]
    for _, own in model["layers"]:
        keys = [(*b.lo, *b.hi, b.bytes) for b in own]
        check(keys == sorted(keys), "order of blocks")
    check_sums(model, is_open)
    all_blocks = [block for _, own in model["layers"] for block in own]
    species, listed = model["meta"]["species"], model["meta"]["fields"]
    joint = [b for name, own in model["layers"] if name == "+".join(s[0] for s in species) for b in own]
    shares = [("species=" + name, 1, 0, True) for name, *_ in species]
    for number, tag, content in sorted(fields, key=lambda f: f[1] == b"fiCO"):
        # An open file may lack the blocks that its last sections belong to.
        if number < len(all_blocks) and all_blocks[number].whole:
            block = all_blocks[number]
            read = read_correlation if tag == b"fiCO" else read_field
            read(block, content, listed if tag != b"shAR" else shares if block in joint else [])
    for block in all_blocks:
        for classes in [*classes_of(listed), *([shares] if block in joint else [])]:
            last_class(block, [name for name, *_ in classes])
    model["masses"] = masses_of(model)
    separate(model, species, [name for name, *_ in shares])
    return model


# ---------------------------------------------------------------- 16. Series

MOVE_KINDS = ("place", "first", "size", "shape", "count", "mass")
EDGES = (2, 5, 10, 20, 40), (1, 2, 4), (0.7, 1.0, 1.5)


def read_series(data):
    """The last frame of a series."""
    for model in frames_of(data):
        pass
    return model


def frames_of(data):
    """The frames of a series, one after the other."""
    (index, *others), _ = sections(data, 2)
    check(index[0] == b"FRMS", "index of frames")
    clock, number = struct.unpack_from("<BI", index[1])
    check(clock < 4 and 1 <= number <= 1 << 20 and len(index[1]) == 5 + 25 * number, "index of frames")
    frames = [(place + 16, content) for tag, content, place in others if tag == b"FRAM"]
    model, before, key = None, None, None
    for kind, time, place, length in struct.iter_unpack("<BdQQ", index[1][5:]):
        check(kind < 3 and math.isfinite(time), "index of frames")
        if kind == 0:
            continue
        check(before is None and kind == 1 or before is not None and time > before, "clock")
        at, content = frames.pop(0)
        check((at, len(content)) == (place, length), "place of a frame")
        if kind == 1:
            model, key = read(content), sections(content)[0][0][1]
            check(model["meta"]["law"] == 1 and not model["meta"]["species"], "kind of a keyframe")
            for block in (b for _, own in model["layers"] for b in own):
                n = len(block.counts)
                block.velocities, block.unrests, block.histories = [None] * n, [0] * n, [[0] * 11] * n
                block.models = ChangeModels(MOVE_KINDS)
        else:
            model = changed(model, key, content, time - before)
        before = time
        yield model
    check(not frames, "frames")


def raw_fields(content):
    found, at = {}, 0
    while at < len(content):
        tag, length = struct.unpack_from("<BH", content, at)
        found[tag], at = content[at + 3 : at + 3 + length], at + 3 + length
    return found


def changed(model, key, data, elapsed):
    found, _ = sections(data, 3)
    fields = {**raw_fields(key), **raw_fields(found[0][1])}
    joined = b"".join(struct.pack("<BH", tag, len(v)) + v for tag, v in sorted(fields.items()))
    new = {"open": False, "vizm": None, "meta": metadata(joined), "cert": {}, "layers": []}
    moves = [content for tag, content, _ in found if tag == b"MoVE"]
    cells = [spanned(m["meta"]["cell"]) for m in (model, new)]
    certificates = [content for tag, content, _ in found if tag == b"CERT"]
    check(len(certificates) <= 1, "certificates of a change")
    if certificates:
        new["cert"] = certificate(certificates[0])
    for name, blocks in model["layers"]:
        new["layers"].append((name, [Change(block, moves.pop(0)[4:], cells, elapsed) for block in blocks]))
    check(not moves, "blocks of a change")
    of = lambda layers: [block for _, own in layers for block in own]
    all_blocks, before, known = of(new["layers"]), of(model["layers"]), new["meta"]["fields"]
    alike = [k for k in known if k in model["meta"]["fields"]]
    for tag, content, _ in found:
        if tag in (b"fiEL", b"fiMO"):
            number = struct.unpack_from("<I", content)[0]
            check(tag == b"fiEL" or known[content[4]] in alike, "a field of the frame before")
            read_field(all_blocks[number], content[4:], known, before[number] if tag == b"fiMO" else None)
    for tag, content, _ in found:
        if tag == b"fiCO":
            read_correlation(all_blocks[struct.unpack_from("<I", content)[0]], content[4:], known)
    check_sums(new, False)
    new["masses"] = masses_of(new)
    return new


def spanned(cell):
    """A cell that counts, with the inverse of its vectors."""
    if cell is None or not any(cell[0]) or any(v == (0.0, 0.0, 0.0) for v in cell[1]):
        return None
    periodic, v, corner = cell
    cross = lambda a, b: (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    rows = [cross(v[1], v[2]), cross(v[2], v[0]), cross(v[0], v[1])]
    volume = v[0][0] * rows[0][0] + v[0][1] * rows[0][1] + v[0][2] * rows[0][2]
    if volume == 0:
        return None
    return periodic, v, corner, [[rows[a][k] / volume for a in range(3)] for k in range(3)]


def fractions(cell, d):
    periodic, _, _, inverse = cell
    return [(d[0] * inverse[0][a] + d[1] * inverse[1][a]) + d[2] * inverse[2][a] if periodic[a] else 0.0
            for a in range(3)]


def combined(vectors, numbers):
    return [(numbers[0] * vectors[0][k] + numbers[1] * vectors[1][k]) + numbers[2] * vectors[2][k] for k in range(3)]


def carried(cells, x):
    old, new = cells
    if old is None or new is None or old == new:
        return list(x)
    d = [v - c for v, c in zip(x, old[2])]
    p = fractions(old, d)
    return [((v - a) + b) + c for v, a, b, c in zip(d, combined(old[1], p), combined(new[1], p), new[2])]


def image(cell, x):
    if cell is None:
        return x
    p = fractions(cell, [v - c for v, c in zip(x, cell[2])])
    shift = combined(cell[1], [0.0 if 0.0 <= f <= 1.0 else float(math.floor(f)) for f in p])
    return [v - s for v, s in zip(x, shift)]


class Change:
    """A block of a frame, of that of the frame before."""

    weighted = property(lambda self: self.masses is not None)
    shaded, whole = 0, True

    def __init__(self, block, content, cells, elapsed):
        head = struct.unpack_from("<6dQdI5fd2f", content)
        self.lo, self.hi, (self.count, self.mass, new) = head[0:3], head[3:6], head[6:9]
        steps, scale, gains = head[9:14], head[14], head[15:17]
        check(all(0 < s < 1e6 for s in steps) and 0 < scale < math.inf, "steps of a change")
        check(1 <= self.count <= 1 << 53 and 0 < self.mass < math.inf, "particles of a change")
        at = struct.calcsize("<6dQdI5fd2f")
        self.columns, self.fields, self.correlations = {"mean": [], "cov": []}, {}, {}
        self.velocities, self.unrests, self.histories, self.weights, self.each = [], [], [], [], []
        self.stayed = []  # numbers of the Gaussians in the frame before
        self.start(block, Stream(content[at + new :]), (steps, scale, gains), cells, elapsed)
        self.counts, self.masses = [], [] if block.weighted else None
        added = Block([content[at : at + new]]) if new else None
        left, mass = self.count - (added.count if new else 0), self.mass - (added.mass if new else 0)
        check((left > 0) == bool(self.weights), "particles of a change")
        if self.weights:
            self.counts = largest_remainder(self.weights, left)
        if self.weights and block.weighted:
            self.masses = scaled([e * n for e, n in zip(self.each, self.counts)], mass)
        if new:
            check(added.weighted == block.weighted and not added.shaded and added.whole, "new Gaussians")
            self.counts += added.counts
            self.velocities += [None] * len(added.counts)
            self.unrests += [0] * len(added.counts)
            self.histories += [[0] * 11] * len(added.counts)
            if block.weighted:
                self.masses += added.masses
            for name in self.columns:
                self.columns[name] += added.columns[name]
        self.opacities = self.greys = None

    def start(self, block, stream, told, cells, elapsed):
        steps, scale, gains = told
        self.models = block.models
        places, before = [], 0
        for i, (mean, cov) in enumerate(zip(block.columns["mean"], block.columns["cov"])):
            if self.models.stays.read(stream):
                continue
            self.stayed.append(i)
            n, v = max(block.counts[i], 0.5), block.velocities[i]
            guess = v if v is not None else self.guess(places, mean)
            e = [c + g * elapsed for c, g in zip(carried(cells, mean), guess)]
            trace = (cov[0] + cov[3]) + cov[5]
            f = min(max(math.sqrt(math.sqrt(max(trace / 3.0, 0.0)) / n / scale), 0.125), 8.0)
            unrest, total, history = 2 * block.unrests[i] + before, 0, []

            def number(kind, step):
                nonlocal total
                h = block.histories[i][len(history)]
                k = self.models.read(stream, kind, unrest + 2 * total, h, f)
                total += abs(k)
                history.append(2 * k + (h // 2 if h > 0 else -(-h // 2)))
                return float(k) * step

            q = [number("place" if v is not None else "first", steps[0] * f) for _ in range(3)]
            size, *five = [number("size", steps[1])] + [number("shape", steps[2] * f) for _ in range(5)]
            count = number("count", steps[3])
            mass = number("mass", steps[4]) if block.weighted else 0.0
            check(max(map(abs, (size, *five, count, mass))) <= 16, "a number of a change")
            if block.weighted:
                each = block.masses[i] / max(block.counts[i], 1.0)
                self.each.append((each if each > 0 else block.mass / float(block.count)) * exp(mass))
            self.weights.append(n * exp(count))
            l = Widths(cov)
            by = l(q)
            unit = exponential(five)
            cov = congruent(l, unit, exp(2.0 * size))
            check(all(map(math.isfinite, (*cov, *by))) and min(cov[0], cov[3], cov[5]) >= 0, "a Gaussian of a change")
            gain = gains[v is not None]
            self.velocities.append([g + gain * b / elapsed for g, b in zip(guess, by)])
            self.columns["mean"].append(image(cells[1], [x + b for x, b in zip(e, by)]))
            self.columns["cov"].append(cov)
            self.unrests.append(min(total, 255))
            self.histories.append(history)
            places.append(mean)
            before = min(total, 255)
        stream.finish()

    def guess(self, places, at):
        near = []
        for j in range(len(places) - 1, max(len(places) - 256, 0) - 1, -1):
            x, y, z = (a - b for a, b in zip(places[j], at))
            near.append((x * x + y * y + z * z, j))
        near = sorted(near, key=lambda n: n[0])[:4]
        total = [0.0] * 3
        for _, j in near:
            total = [t + v for t, v in zip(total, self.velocities[j])]
        return [t / max(len(near), 1) for t in total]


def congruent(l, unit, grown):
    """A lower triangle times a symmetric matrix times its transpose, times a number."""
    columns = [l([unit[a], unit[b], unit[c]]) for a, b, c in ((0, 1, 2), (1, 3, 4), (2, 4, 5))]
    rows = [l([columns[k][j] for k in range(3)]) for j in range(3)]
    return [rows[a][b] * grown for a, b in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))]


def check_sums(model, is_open):
    meta, blocks = model["meta"], [b for _, blocks in model["layers"] for b in blocks]
    particles, mass = sum(b.count for b in blocks), neumaier([b.mass for b in blocks])
    lacking = is_open and particles < meta["particles"]
    if lacking:
        meta["particles"], meta["mass"] = particles, mass
    if lacking or not all(b.whole for b in blocks):
        model["cert"] = {}
    check(particles == meta["particles"] and abs(mass - meta["mass"]) <= 1e-9 * meta["mass"], "particles or mass")
    check(all(b.shaded == (meta["law"] == 2) for b in blocks), "shaded blocks and the image law")
    for (weighted, _), (_, own) in zip(masses_of(model), model["layers"]):
        check(all(b.weighted == weighted for b in own), "weighted blocks and their layer")


def masses_of(model):
    """(has weights, mass of weight 1 or None) of each layer."""
    told, layers = model["meta"]["masses"], len(model["layers"])
    # An open file may end before its last layers.
    check(len(told) in (1, layers) or model["open"] and len(told) > layers, "masses of layers")
    return told * layers if len(told) == 1 else told[:layers]


# ---------------------------------------------------------------- 2. META

def metadata(content):
    fields, at, last = {}, 0, -1
    while at < len(content):
        check(at + 3 <= len(content), "head of a field")
        tag, length = struct.unpack_from("<BH", content, at)
        check(tag > last, "order of fields")
        fields[tag], at, last = content[at + 3 : at + 3 + length], at + 3 + length, tag
    check(at == len(content), "length of the metadata")
    for tag in fields:
        if tag > 128:
            raise Unsupported(f"field {tag}")
    real = lambda tag: one(fields, tag, "<d")
    law = fields[1][0]
    if law not in (1, 2):
        raise Unsupported(f"image law {law}")
    units = [unit(fields[tag]) if tag in fields else None for tag in (16, 17, 18)]
    masses = layer_masses(fields[128])
    kept = quantities(fields[11], units)
    check(kept[0] == ("positions", 2, 12, units[0]), "positions")
    weighted = any(weighted for weighted, _ in masses)
    if weighted:
        check(kept[1] == ("masses", 1, 4, units[1]), "masses")
    own = kept[2 if weighted else 1 :]
    traits = fields.get(32, bytes(len(own)))
    check(len(traits) == len(own) and max(traits, default=0) <= 7, "traits of fields")
    check(all(kind in (1, 3) or flags < 2 for (_, kind, _, _), flags in zip(own, traits)), "traits of a vector")
    listed = [(name, 3 if kind == 2 else 1, flag, kind == 4) for (name, kind, _, _), flag in zip(own, traits)]
    check(all(2 <= len(c) <= 16 for c in classes_of(listed)), "classes of a category")
    check(len(fields.get(12, bytes(16))) == 16, "hash of the fields' values")
    return {
        "fields": listed,
        "species": species_of(fields[33]) if 33 in fields else [],
        "law": law,
        "particles": one(fields, 2, "<Q"),
        "mass": real(3),
        "bounds": struct.unpack("<6d", fields[4]),
        "cell": cell_of(fields[5], fields.get(6, bytes(24))) if 5 in fields else None,
        "radius": real(7),
        "opacity": real(8),
        "source": fields[9].decode(),
        "hash": fields[10].hex(),
        "fields_hash": fields[12].hex() if 12 in fields else "none",
        "kept": kept,
        "units": units,
        "comoving": one(fields, 19, "<B"),
        "cosmology": cosmology(fields.get(24, b"\0")),
        "moment": (real(25), real(26), one(fields, 27, "<Q"), one(fields, 28, "<q")),
        "effort": effort(fields[40]),
        "masses": masses,
    }


def classes_of(listed):
    """The classes of each category."""
    found = {}
    for at, entry in enumerate(listed):
        if entry[3]:
            check("=" in entry[0], "name of a class")
            own = found.setdefault(entry[0].split("=")[0], [])
            check(not own or own[-1] is listed[at - 1], "classes apart from each other")
            own.append(entry)
    return list(found.values())


def species_of(content):
    """(name, particles, mass of one or None) of each."""
    found, at = [], 0
    while at < len(content):
        n = content[at]
        count, mass = struct.unpack_from("<Qd", content, at + 1 + n)
        check(count > 0 and mass >= 0 and math.isfinite(mass), "a species")
        found.append((content[at + 1 : at + 1 + n].decode(), count, mass or None))
        at += 17 + n
    check(at == len(content) and 2 <= len({name for name, *_ in found}) == len(found) <= 16, "species")
    return found


def cell_of(content, corner):
    """(periodic axes, vectors, corner)."""
    lengths = struct.unpack(f"<{(len(content) - 1) // 8}d", content[1:])
    if len(lengths) == 3:
        lengths = (lengths[0], 0.0, 0.0, 0.0, lengths[1], 0.0, 0.0, 0.0, lengths[2])
    vectors = [lengths[0:3], lengths[3:6], lengths[6:9]]
    return [bool(content[0] >> k & 1) for k in range(3)], vectors, struct.unpack("<3d", corner)


def one(fields, tag, form):
    """The one number of a field, None where it is not there."""
    return struct.unpack(form, fields[tag])[0] if tag in fields else None


def unit(content):
    """(text, factor or None, exponent of a, exponent of h)."""
    factor, a, h = struct.unpack_from("<dff", content)
    check(factor >= 0 and all(map(math.isfinite, (factor, a, h))) and (factor > 0 or a == h == 0), "a unit")
    return content[16:].decode(), factor or None, a, h


def quantities(content, units):
    """(name, kind, raw bytes a particle, unit) of all that was kept."""
    found, at = [], 0
    while at < len(content):
        n = content[at]
        name = content[at + 1 : at + 1 + n].decode()
        kind, size, which = struct.unpack_from("<BHB", content, at + 1 + n)
        at += n + 5
        check(kind in (1, 2, 3, 4) and which in (0, 1, 2, 3, 255), "a quantity")
        own = None
        if which == 255:
            length = struct.unpack_from("<H", content, at)[0]
            own, at = unit(content[at + 2 : at + 2 + length]), at + 2 + length
        elif which > 0:
            own = units[which - 1]
            check(own is not None, "the unit of a quantity")
        found.append((name, kind, size, own))
    check(at == len(content) and found, "length of what was kept")
    return found


def cosmology(content):
    """h, and the shares of matter, the cosmological constant and baryons; None where one is not stated."""
    bits = [k for k in range(8) if content[0] >> k & 1]
    check(len(content) == 1 + 8 * len(bits), "length of the cosmology")
    numbers = dict(zip(bits, struct.unpack_from(f"<{len(bits)}d", content, 1)))
    return [numbers.get(k) for k in range(4)]


def layer_masses(content):
    """(has weights, mass of weight 1 or None) of each layer, or of all as one."""
    found, at = [], 0
    while at < len(content):
        flags, at = content[at], at + 1
        if flags & 4:
            raise Unsupported("Gaussians by mass")
        check(flags < 8, "flags of a layer")
        mass = None
        if flags & 2:
            mass, at = struct.unpack_from("<d", content, at)[0], at + 8
            check(mass > 0, "mass of a particle")
        found.append((flags & 1, mass))
    return found


def effort(text):
    """The effort that a recipe tells: of Gaussians that are what a fit gave."""
    try:
        recipe = json.loads(text)
    except ValueError:
        return None
    if not isinstance(recipe, dict) or "training" in recipe or any(step != "merge" for step in recipe.get("steps", [])):
        return None
    if {"all", "effort", "training", "steps"} & set(recipe.get("differing", [])):
        return None
    return recipe.get("effort", "default")


# ---------------------------------------------------------------- 3. CERT, stat


# ---------------------------------------------------------------- 3. CERT

# Codings of the page: letters of `struct`, and for others the letter that their bytes are read by. Behind a letter may
# stand the least and the most.
REAL, SIGNED = (0, math.inf), (-math.inf, math.inf)
COUNT, SOME, MARK, RATIO, SHARE, ERROR = (0, 2**64), (1, 2**64), (0, 1), (-1, 1), (0, 1), (0, 2.01)
TINY = (5e-324, math.inf)
SCORES = ["score"] * 5
LOOK = [("B", (0, 2)), *SCORES, *SCORES]
CELLS = [("f", TINY), ("f", RATIO), ("f", ERROR), ("f", ERROR)]
POWER = [("f?", REAL), "up to"]
LAYERS = [("d", REAL), ("I", COUNT), *[("f", REAL)] * 4]
GROUPS = {
    1: [("H", SOME), ("H", SOME), ("Q", COUNT), *SCORES * 9],
    2: [("H", SOME), *CELLS[1:]],
    3: [("d", TINY), *CELLS] * 3,
    4: [("B", MARK), ("H", COUNT), ("f", REAL), *["up to"] * 4, "from"],
    6: [("Q", (1, 2**64)), *[("d", SIGNED)] * 6],
    7: [("d", REAL), ("f", SHARE)] * 2,
    8: [("I", COUNT), ("f?", REAL), ("f", REAL), ("f?", SHARE), ("f?", SHARE), ("f?", REAL), ("f", REAL)] * 3,
    9: [("f", SIGNED), ("f", REAL), ("f", SIGNED), ("d", REAL), ("d", REAL), *[("f?", SIGNED), ("f", REAL)] * 7],
    10: [("Q", (1, 2**64)), ("Q", COUNT)],
    11: [("H", SOME), ("H", SOME), *[("f", TINY), ("f", (TINY[0], 1)), ("B", MARK), *LOOK, *LOOK] * 7],
    12: [("I", COUNT)],
    13: [("B", (0, 3)), ("d", REAL), ("d", REAL), ("d", SIGNED)],
    16: CELLS[1:3] * 3,
}


def certificate(content):
    """Groups by tag: the figures of each, as lines say them."""
    found, raw, at, last = {}, {}, 0, 0
    while at < len(content):
        check(at + 3 <= len(content), "head of a group")
        tag, length = struct.unpack_from("<BH", content, at)
        check(tag > last and at + 3 + length <= len(content), "a group of the certificate")
        value, at, last = content[at + 3 : at + 3 + length], at + 3 + length, tag
        raw[tag] = value
        if tag == 5:
            found[tag] = figures(value, POWER * min(max(length // 8, 1), 9))
        elif tag == 14:
            found[tag] = figures(value, LAYERS * min(length // 28, 7))
        elif tag in GROUPS:
            found[tag] = figures(value, GROUPS[tag])
    check(1 in found and 2 in found and (16 not in found or 3 in found), "a group is missing")
    if 4 in found:
        largest = found[4][2]
        check(all(isinstance(k, str) or k <= largest for k in found[4][3:7]), "a wave number of the statistics")
        pairs = [[-1 if k == "none" else 0 if k == "never" else k for k in pair] for pair in (found[4][3:5], found[4][5:7])]
        check(all((a == -1) == (b == -1) and a <= b for a, b in pairs), "limits of the statistics")
        check(isinstance(found[4][7], str) or found[4][7] >= 20, "sizes of groups")
    if 6 in found:
        check(all(low <= high for low, high in zip(found[6][1:4], found[6][4:7])), "corners of the region")
    pictures(raw, found)
    for k in (0, 5) if 3 in found else ():
        (edge, particles), (twice, eight) = found[3][k : k + 2], found[3][k + 5 : k + 7]
        check(abs(twice / edge / 2 - 1) < 1e-5 and abs(eight / particles / 8 - 1) < 1e-5, "cells twice as long")
    for k in (0, 7, 14) if 8 in found else ():
        groups, number, scatter, completeness, _, mass, width = found[8][k : k + 7]
        check((number != "none") == (groups > 0) == (completeness != "none"), "shares of groups")
        check(scatter <= (0 if number == "none" else 3 * number), "scatter of numbers of groups")
        check((mass != "none") == (completeness not in ("none", 0)) and (mass != "none" or width == 0), "masses of groups")
    for k in range(5, 19, 2) if 9 in found else ():
        check(found[9][k] != "none" or found[9][k + 1] == 0, "a scatter of no deviation")
    return found


def pictures(raw, found):
    """What the scores of groups 1 and 11 say of each other."""
    width, height = found[1][:2]
    most = 20 * math.log10(255) + 10 * math.log10(width * height) + 0.01
    scores = list(struct.iter_unpack("<Hh", raw[1][12:]))
    for k in range(0, 45, 5):
        expected, five = k // 5 % 3 == 2, [None if s == -32768 else (p, s) for p, s in scores[k : k + 5]]
        check(all(score is None or score[0] == 65535 or score[0] / 200 <= most for score in five), "too high a score")
        check(all((score is not None) == (expected or 12 not in found) for score in five[:4]), "pictures that were drawn")
        if expected:
            check(five[1] == (65535, 32767) and (five[4] is not None) == (10 in found), "scores of `expected`")
    for k in range(7) if 11 in found else ():
        # Behind width and height: radius, opacity, mark; two looks of a byte and ten scores each.
        start = 4 + k * (9 + 2 * 41) + 9 + 41 + 1
        for five in (start, start + 20):
            check(struct.unpack_from("<Hh", raw[11], five + 4) in [(65535, 32767), (65535, -32768)], "noise-free pictures")


def figures(value, codings):
    """Numbers, or the words for what is none; a score is two."""
    out, at = [], 0

    def take(letter):
        nonlocal at
        check(at + struct.calcsize(letter) <= len(value), "length of a group")
        (number,) = struct.unpack_from("<" + letter, value, at)
        at += struct.calcsize(letter)
        return number

    for coding in codings:
        if coding == "score":
            psnr, ssim = take("H"), take("h")
            check(ssim != -32768 or psnr == 65535, "a picture that was not drawn")
            drawn = ["none" if psnr == 65535 else psnr / 200, ssim / 32767]
            out += ["none"] if ssim == -32768 else drawn
        elif coding == "up to":
            k = take("f")
            check(math.isfinite(k) and (k == -1 or k >= 0), "a wave number")
            out.append("none" if k == -1 else "never" if k == 0 else k)
        elif coding == "from":
            n = take("I")
            out.append("none" if n == 0xFFFFFFFF else "never" if n == 0 else float(n))
        else:
            letter, (least, most) = coding
            number = take(letter[0])
            if letter == "f?" and number == -2:
                out.append("none")
            else:
                check(math.isfinite(number) and least <= number <= most, "a figure of the certificate")
                out.append(number)
    check(at == len(value), "length of a group")
    return out


# ---------------------------------------------------------------- 4. BLOK

class Block:
    """A block's header and its Gaussians, as columns of floats in the order of the file."""

    def __init__(self, stages):
        self.bytes = b"".join(stages)
        check(len(stages[0]) >= 126, "header of a block")
        head = struct.unpack_from("<6dQdI5B5f2fi4h3fB", stages[0])
        self.lo, self.hi = head[0:3], head[3:6]
        self.count, self.mass, self.gaussians, flags = head[6:10]
        self.weighted, self.shaded = flags & 1, flags >> 1 & 1
        self.low_bits = dict(zip("size count mass shape".split(), head[10:14]))
        self.steps = dict(zip("position size count shape mass".split(), head[14:19]))
        self.importance, self.centre, self.constant = head[19:22]
        self.slopes, self.surplus = head[22:25], head[25]
        self.spreads = dict(zip("size count shape".split(), head[26:29]))
        number = head[29] + 1
        self.extent = tuple(h - l for l, h in zip(self.lo, self.hi))
        check(all(map(math.isfinite, (*self.lo, *self.extent, self.mass))) and min(self.extent) >= 0, "bounds or mass")
        check(1 <= self.count <= 1 << 53 and self.mass > 0 and self.gaussians and flags < 3, "header of a block")
        check(max(head[10:14]) <= 15 and all(np.float32(1e-6) <= v <= 16 for v in head[14:19]), "low bits or steps")
        check(0 <= head[19] <= 4 and abs(head[20]) <= 1e6 and all(0 <= v <= 1e6 for v in head[26:29]), "header of a block")
        ends = list(stages[0][126 : 125 + number])
        check(number <= 8 and len(ends) == number - 1 and ends == sorted(set(ends)), "last levels of stages")
        check(len(stages) <= number, "number of stages")
        self.whole = len(stages) == number
        check(not self.whole or self.gaussians <= 4 * len(self.bytes), "more Gaussians than bytes allow")
        self.columns = {k: [] for k in "mean cov C W share".split()}
        self.decode(stages, [*ends, 255])
        self.finish()
        self.fields, self.correlations = {}, {}

    def decode(self, stages, ends):
        root = Node((0, 0, 0), (0, 0, 0), self.gaussians)
        data, at, number, trunk = stages[0], 125 + len(ends), 1, 0
        if self.gaussians > 65536:
            check(len(data) >= at + 8, "lengths of streams")
            number, trunk = struct.unpack_from("<2I", data, at)
            check(1 <= number <= 2 * (self.gaussians // 65536) + 1, "number of segments")
            at += 8
        lengths = [None]
        if number * len(ends) > 1:
            check(len(data) >= at + 4 * number * len(ends), "lengths of streams")
            lengths = struct.unpack_from(f"<{number * len(ends)}I", data, at)
            at += 4 * number * len(ends)
        nodes = [[root]]
        if self.gaussians > 65536:
            check(trunk <= len(data) - at, "length of the trunk")
            nodes = self.trunk(Stream(data[at : at + trunk]), root)
            check(len(nodes) == number, "number of segments")
            at += trunk
        segments = [Segment(self, own) for own in nodes]
        for j, (data, first, last) in enumerate(zip(stages, [0, *(e + 1 for e in ends)], ends)):
            for segment, length in zip(segments, lengths[j * number :]):
                end = len(data) if length is None else at + length
                check(end <= len(data), "length of a stream")
                stream = Stream(data[at:end])
                segment.levels(stream, first, last)
                if j + 1 == len(ends):
                    segment.fine(stream)
                stream.finish()
                check(length in (None, stream.end()), "length of a stream")
                at += stream.end()
            padding = -(-self.gaussians // 4) - len(self.bytes) if j + 1 == len(ends) else -len(data)
            check(len(data) == max(at, len(data) + padding) and not any(data[at:]), "length of a stage")
            at = 0
        if not self.whole:
            for segment in segments:
                segment.part()
            check(len(self.columns["C"]) <= 4 * len(self.bytes), "more nodes than bytes allow")

    # ------------------------------------------------------------ 5. Order: cells, trunk and segments

    def trunk(self, stream, root):
        """Nodes of at most 65536 Gaussians, joined to segments."""
        models = [Adaptive([4, *[1] * 14, 4]) for _ in range(3)]
        stack, segments, held = [(root, 0)], [], 0
        while stack:
            node, share = stack.pop()
            axis = self.axis(node)
            if node.n > 65536 and axis is not None:
                lower = split(stream, models[share], node.n)
                for upper, n in ((1, node.n - lower), (0, lower)):
                    if n:
                        of = 0 if n == node.n else 1 if 2 * n < node.n else 2
                        stack.append((Node(*half(node, axis, upper), n), of))
            elif segments and held + node.n <= 65536:
                segments[-1].append(node)
                held += node.n
            else:
                segments.append([node])
                held = node.n
        stream.finish()
        return segments

    def width(self, node, k):
        return self.extent[k] * 2.0 ** -node.depth[k]

    def axis(self, node):
        """The axis that a cell is halved along, or None."""
        lengths = [self.width(node, k) if node.depth[k] < 40 else 0.0 for k in range(3)]
        return lengths.index(max(lengths)) if max(lengths) > 0 else None

    # ------------------------------------------------------------ 7. Reconstruction

    def radius_and_factor(self, t, c):
        size, b = 0.5 * self.steps["size"] * t, self.importance
        g = exp((-b if self.shaded else b) * size) * exp(b * (self.centre - 0.5 * self.steps["count"] * c))
        return exp(size), min(max(g, 0.125), 8.0)

    def coordinate(self, node, k, f):
        """Where a share f of the way through a cell is."""
        return self.lo[k] + self.extent[k] * ((node.index[k] + f) * 2.0 ** -node.depth[k])

    # ------------------------------------------------------------ 10. Counts and masses

    def finish(self):
        c = self.columns
        half, grey = 0.5 * self.steps["count"], 0.5 * self.steps["mass"]
        weights = [exp(half * v) for v in c["C"]]
        self.masses = self.opacities = self.greys = None
        if self.shaded:
            depth = [min(max(w * share, 2.0**-20), 16.0) for w, share in zip(weights, c["share"])]
            self.opacities = [1.0 - exp(-d) for d in depth]
            self.greys = [exp(grey * v) for v in c["W"]]
            weights = self.opacities
        self.counts = largest_remainder(weights, self.count)
        if self.weighted:
            self.masses = scaled([n * exp(grey * v) for n, v in zip(self.counts, c["W"])], self.mass)


def scaled(masses, mass):
    for _ in range(2):
        total = neumaier(masses)
        factor = mass / total if 0 < total < math.inf else math.inf
        masses = [m * factor if factor < math.inf else mass / len(masses) for m in masses]
    return masses


def neumaier(values):
    total, lost = 0.0, 0.0
    for v in values:
        t = total + v
        lost += (total - t) + v if abs(total) >= abs(v) else (v - t) + total
        total = t
    return total + lost


def largest_remainder(weights, number):
    total = neumaier(weights)
    shares = [w / total * float(number) for w in weights]
    counts = [math.floor(s) for s in shares]
    left = number - sum(counts)
    order = sorted(range(len(shares)), key=lambda i: (-(shares[i] - math.floor(shares[i])), i))
    while left > 0:
        for i in order[:left]:
            counts[i] += 1
        left -= min(left, len(order))
    for i in sorted(range(len(counts)), key=lambda i: (-counts[i], i)) if left < 0 else ():
        taken = min(counts[i], -left)
        counts[i] -= taken
        left += taken
    return [float(n) for n in counts]


class Node:
    """A cell and what is known of its Gaussians. `parent` is the log count k' of the node that it is a half of."""

    def __init__(self, depth, index, n):
        self.depth, self.index, self.n = depth, index, n
        self.halves, self.parts, self.size, self.by_symbol_0, self.m = [], [(0, 0)] * 3, None, 0, 0

    def level(self):
        return sum(self.depth)


def half(node, axis, upper):
    """Depth and index of a half's cell."""
    if axis is None:
        return node.depth, node.index
    return (tuple(d + (k == axis) for k, d in enumerate(node.depth)),
            tuple(2 * i + upper if k == axis else i for k, i in enumerate(node.index)))


def split(stream, model, n):
    """Gaussians of the lower half: n is above 65536, of the last class."""
    v = model.read(stream)
    first, end = -(-v * (n + 1) // 16), -(-(v + 1) * (n + 1) // 16)
    return first + long(stream, end - first)


# ---------------------------------------------------------------- 6. From coarse to fine: levels

SYMBOLS = ((18, 12, 1, 1), (18, 12, 1, 1), (20, 8, 2, 1), (20, 6, 4, 1), (17, 4, 7, 4), (12, 2, 8, 9), (7, 1, 7, 17),
           (3, 1, 5, 25), (2, 1, 2, 60))


class Segment:
    """A segment, with models and trellises of its own."""

    def __init__(self, block, roots):
        self.block, self.roots = block, roots
        low, spreads = block.low_bits, block.spreads
        self.symbol = [Adaptive(SYMBOLS[min(i // 2, 8)]) for i in range(24)]
        self.number = [Residuals(bell(64, spreads["count"]), low["count"]) for _ in range(3)]
        self.size = Residuals(bell(32, spreads["size"]), low["size"])
        self.mass = Residuals(mass_weights(32), low["mass"])
        self.shape = [[Residuals(bell(16, s), low["shape"]) for _ in range(2)] for s in SPREADS]
        self.trellis = {name: Trellis() for name in "size count mass shape place".split()}
        self.queues = [[] for _ in range(256)]
        self.most, self.held = sum(node.n for node in roots), 0
        self.of_g = {}

    def levels(self, stream, first, last):
        if first == 0:
            for root in self.roots:
                root.k = root.parent = bits(stream, 24) - (1 << 22)
                root.m = bits(stream, 24) - (1 << 22) if self.has_masses() else 0
                root.root, root.single = (root.n, root.k), root.n == 1
            self.heaviest = max(map(self.weight, self.roots))
            for root in self.roots:
                self.join(root, 0)
        for level in range(first, last + 1):
            for node in self.queues[level]:  # it grows
                (self.gaussian if node.single else self.take_apart)(stream, node, level)
        check(last < 255 or self.held == self.most, "Gaussians of a segment")

    def has_masses(self):
        return self.block.weighted or self.block.shaded

    def weight(self, node):
        return self.block.steps["count"] * node.k + 0.16 * node.level()

    def join(self, node, level):
        check(max(abs(node.k), abs(node.m)) <= 1 << 22, "a log count or mass")
        if not node.by_symbol_0:
            self.held += 1 if node.single else 2
            check(self.held <= self.most, "Gaussians of a segment")
        self.queues[max(level, min(math.floor(6.0 * (self.heaviest - self.weight(node))), 255))].append(node)

    def take_apart(self, stream, node, level):
        n, k0 = node.root
        x = min(n * exp(self.block.steps["count"] * (node.k - k0)), 65536.0)
        of_x = min(max(math.frexp(x)[1] - 1 + 3, 0), 11)
        symbol, axis = self.symbol[2 * of_x + node.by_symbol_0].read(stream), self.block.axis(node)
        if symbol == 0:
            check(axis is not None, "a cell that cannot be halved")
            node.depth, node.index = half(node, axis, bits(stream, 1))
            node.by_symbol_0 = 1
            return self.join(node, level)
        upper = bits(stream, 1) if symbol == 2 else 0
        d = self.number[symbol - 1].read(stream)
        if symbol == 2:
            d = -(d + self.block.surplus) if upper else d + self.block.surplus
        larger = node.k - self.g(abs(d))
        counts = [larger - max(-d, 0), larger - max(d, 0)]
        masses = [0, 0]
        if self.has_masses():
            e = self.mass.read(stream)
            masses = [node.m - (e >> 1) + e, node.m - (e >> 1)]
        self.held -= 2
        for side in (0, 1):
            part = Node(*half(node, axis, side), None)
            part.k, part.m, part.root, part.parent = counts[side], masses[side], node.root, node.k
            part.single = symbol == 1 or symbol == 2 and side != upper
            node.halves.append(part)
            self.join(part, level)

    def g(self, d):
        if d not in self.of_g:
            c = self.block.steps["count"]
            both = 1.0 + exp(-c * d)
            g = max(math.floor(math.log(both) / c) - 2, 0)  # at most the one that is looked for
            while exp(c * (g + 0.5)) < both:
                g += 1
            self.of_g[d] = g
        return self.of_g[d]

    def prediction(self, node, parent):
        products = sum(a * v for a, v in zip(self.block.slopes, (node.level(), node.k, parent)))
        return min(max(self.block.constant + (products + 128 >> 8), -(1 << 21)), 1 << 21)

    def gaussian(self, stream, node, level):
        """Size and part of the cell of a single node."""
        block = self.block
        node.size = self.prediction(node, node.parent) + self.size.read(stream)
        check(max(abs(node.size), abs(node.k), abs(node.m)) <= 1 << 20, "a number beyond its range")
        r, g = block.radius_and_factor(2 * node.size, 2 * node.k)
        for k in range(3):
            v = block.width(node, k) / (block.steps["position"] * g * r)
            q = min(max(math.frexp(min(v, 256.0))[1] - 2, 0), 6)
            node.parts[k] = q, bits(stream, q)

    def leaves(self):
        """Nodes that are not taken apart, in the order of the tree."""
        stack = self.roots[::-1]
        while stack:
            node = stack.pop()
            stack.extend(reversed(node.halves))
            if not node.halves:
                yield node

    def part(self):
        """The mixture of a block whose last stages are missing."""
        block, columns = self.block, self.block.columns
        for node in self.leaves():
            mean, variances, r, of = [], [], 0.0, 1.0 / 7.0
            if node.size is not None:
                r, of = exp(block.steps["size"] * (node.size + 0.25)), 1.0 / 12.0
            for k, (q, v) in enumerate(node.parts):
                width = block.width(node, k) * 2.0**-q
                mean.append(block.coordinate(node, k, (v + 0.5) * 2.0**-q))
                variances.append(of * (width * width) + r * r)
            typical = exp(block.steps["size"] * self.prediction(node, node.k))
            third = (variances[0] + variances[1] + variances[2]) / 3.0
            columns["mean"].append(mean)
            columns["cov"].append(covariance(1.0, [variances[0], 0.0, 0.0, variances[1], 0.0, variances[2]]))
            columns["C"].append(2 * node.k + 0.5)
            columns["W"].append(2 * node.m + 0.5)
            columns["share"].append(min(1.0, typical * typical / third if third > 0.0 else 1.0))

    # ------------------------------------------------------------ 7. The fine part

    def fine(self, stream):
        block, columns = self.block, self.block.columns
        for node in self.leaves():
            t, c = self.lattice("size", node.size), self.lattice("count", node.k)
            w = self.lattice("mass", node.m) if self.has_masses() else 0
            r, g = block.radius_and_factor(t, c)
            step = min(0.5 * block.steps["shape"] * g, 1.0)
            shape = [s * step for s in self.shapes(stream, g)]
            check(all(abs(s) <= 32 for s in shape), "a shape number beyond its range")
            unit = exponential(shape)
            columns["mean"].append(self.place(stream, node, block.steps["position"] * g * r, cholesky(unit)))
            columns["cov"].append(covariance(r, unit))
            columns["C"].append(c)
            columns["W"].append(w)
            columns["share"].append(1.0)

    def lattice(self, name, k):
        """Half steps h = 2 k + z of one number."""
        check(abs(k) <= 1 << 20, "a number beyond its range")
        return 2 * k + self.trellis[name].take(k)

    def shapes(self, stream, g):
        numbers, total = [], 0
        for j in range(5):
            e = (5 * (self.block.spreads["shape"] / g) + total) / (5 + j) / 2.0 ** self.block.low_bits["shape"]
            model = self.shape[sum(2.0**edge <= e * e for edge in range(-3, 8))][self.trellis["shape"].z]
            numbers.append(self.lattice("shape", model.read(stream)))
            total += abs(numbers[-1])
        return numbers

    def place(self, stream, node, u, widths):
        block, trellis, mean = self.block, self.trellis["place"], []
        for k, (q, v) in enumerate(node.parts):
            n = max(math.floor(min(block.width(node, k) / (u * widths[k]) + 0.5, 2.0**40)), 1)
            if n == 1:
                f = 0.5
                check(v == 2**q // 2, "part of a cell")
            else:
                z = trellis.z
                first, end = (min(max(-(-(4 * n * x - ((1 + 2 * z) << q)) // (4 << q)), 0), n) for x in (v, v + 1))
                check(first < end, "part of a cell")
                j = first + (long(stream, end - first) if end - first > 1 else 0)
                f = 0.25 * (4 * j + 1 + 2 * z) / n
                trellis.take(j)
            mean.append(block.coordinate(node, k, f))
        return mean


NEXT = ((0, 2), (5, 7), (1, 3), (4, 6), (2, 0), (7, 5), (3, 1), (6, 4))


class Trellis:
    state = 0

    @property
    def z(self):
        return self.state % 2

    def take(self, k):
        """The z that goes with k."""
        z = self.z
        self.state = NEXT[self.state][k % 2]
        return z


# ---------------------------------------------------------------- 8. Entropy coding

class Stream:
    """rANS with two states that take turns."""

    def __init__(self, data):
        check(len(data) >= 8, "a stream without states")
        self.a, self.b = struct.unpack_from("<2I", data)
        check(self.a >= 1 << 16 and self.b >= 1 << 16, "states of a stream")
        self.words = memoryview(data[8 : 8 + (len(data) - 8) // 2 * 2]).cast("H").tolist()
        self.at = 0

    def slot(self):
        return self.a & 0x7FFF

    def take(self, start, size):
        a = size * (self.a >> 15) + (self.a & 0x7FFF) - start
        if a < 1 << 16:
            check(self.at < len(self.words), "a missing word")
            a = a << 16 | self.words[self.at]
            self.at += 1
        self.a, self.b = self.b, a

    def finish(self):
        check(self.a == self.b == 1 << 16, "states at the end of a stream")

    def end(self):
        """Bytes used."""
        return 8 + 2 * self.at


def bits(stream, n):
    value = 0
    for group in range(0, n, 15):
        size = min(15, n - group)
        v = stream.slot() >> (15 - size)
        stream.take(v << (15 - size), 1 << (15 - size))
        value |= v << group
    return value


def uniform(stream, n):
    v = stream.slot() * n >> 15
    start = -(-v * 32768 // n)
    stream.take(start, -(-(v + 1) * 32768 // n) - start)
    return v


def long(stream, n):
    q = max(0, n.bit_length() - 10)
    upper = uniform(stream, (n - 1 >> q) + 1)
    return min(upper << q | bits(stream, q), n - 1)


class Adaptive:
    """A model of K symbols that learns."""

    def __init__(self, weights):
        self.k, self.seen = len(weights), 0
        room, total, below = (1 << 30) - self.k * 32768, sum(weights), 0
        self.f = []
        for v, w in enumerate(weights):
            self.f.append(below * room // total + v * 32768)
            below += w
        # Targets of F[i] where i > v, and where i <= v.
        self.above = [(1 << 30) - (self.k - i) * 32768 for i in range(self.k)]
        self.below = [i * 32768 for i in range(self.k)]

    def read(self, stream):
        f, slot = self.f, stream.slot()
        # The last v with F[v] >> 15 <= slot.
        v = bisect_right(f, slot << 15 | 0x7FFF) - 1
        start = f[v] >> 15
        end = f[v + 1] >> 15 if v + 1 < self.k else 32768
        stream.take(start, end - start)
        self.seen += 1
        q = 4 + sum(self.seen > n for n in (12, 40, 120, 360, 1000))
        targets = self.below[: v + 1] + self.above[v + 1 :]
        self.f = [a + (t - a >> q) for a, t in zip(f, targets)]
        self.f[0] = 0
        return v


class Residuals:
    def __init__(self, weights, low_bits):
        self.most, self.low_bits, self.model = len(weights) // 2 - 1, low_bits, Adaptive(weights)

    def read(self, stream):
        value = self.model.read(stream) - self.most
        if value == self.most + 1:
            negative = bits(stream, 1)
            n = uniform(stream, 22)
            value = (1 << n) + bits(stream, n) + self.most
            value = -value if negative else value
        return value << self.low_bits | bits(stream, self.low_bits)


SPREADS = (0.1875, 0.25, 0.375, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)


def mass_weights(k):
    steps = [65536]
    for _ in range(k // 2):
        steps.append(steps[-1] * 3 // 4)
    return around(k, steps)


def bell(k, spread):
    x = [d / max(spread, 0.25) for d in range(k // 2 + 1)]
    return around(k, [1 + math.floor(65536.0 * exp(-(v * v) / (2.0 + 0.6 * v))) for v in x])


def around(k, steps):
    most = k // 2 - 1
    return [steps[abs(v)] for v in range(-most, most + 1)] + [steps[most + 1]]


# ---------------------------------------------------------------- 9. Covariance

INVERSE_FACTORIAL = [1.0 / math.factorial(n) for n in range(17)]


def exp(x):
    x = min(max(x, -700.0), 700.0)
    k = float(round(x * 1.4426950408889634))
    y = (x - k * 0.6931471803691238) - k * 1.9082149292705877e-10
    value = INVERSE_FACTORIAL[13]
    for n in range(12, -1, -1):
        value = value * y + INVERSE_FACTORIAL[n]
    return math.ldexp(value, int(k))


def exponential(s):
    h, q = math.sqrt(0.5), math.sqrt(1.0 / 6.0)
    j, sum_of_squares = 0, (((s[0] * s[0] + s[1] * s[1]) + s[2] * s[2]) + s[3] * s[3]) + s[4] * s[4]
    while sum_of_squares > 0.25 * 4.0**j:
        j += 1
    by = 2.0 / 2.0**j
    a, b = h * s[0] * by, q * s[1] * by
    x = [b + a, h * s[2] * by, h * s[3] * by, b - a, h * s[4] * by, -2.0 * b]
    y = square(x)
    c1 = 0.5 * (y[0] + y[3] + y[5])
    c0 = determinant(x)
    p, qq, rr = INVERSE_FACTORIAL[16], 0.0, 0.0
    for k in range(15, -1, -1):
        p, qq, rr = rr * c0 + INVERSE_FACTORIAL[k], p + rr * c1, qq
    for _ in range(j):
        p, qq, rr = (p * p + 2.0 * qq * rr * c0, 2.0 * p * qq + 2.0 * qq * rr * c1 + rr * rr * c0,
                     qq * qq + 2.0 * p * rr + rr * rr * c1)
    one = (1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
    return [p * i + qq * v + rr * w for i, v, w in zip(one, x, y)]


def covariance(r, unit):
    cov = [r * r * v for v in unit]
    check(all(map(math.isfinite, cov)) and min(cov[0], cov[3], cov[5]) >= 0, "a covariance")
    return cov


def cholesky(unit):
    root = lambda v: math.sqrt(max(v, 2.0**-20))
    xx, xy, xz, yy, yz, zz = unit
    x = root(xx)
    a, b = xy / x, xz / x
    y = root(yy - a * a)
    c = (yz - b * a) / y
    return x, y, root(zz - b * b - c * c)


def square(m):
    xx, xy, xz, yy, yz, zz = m
    return [xx * xx + xy * xy + xz * xz, xx * xy + xy * yy + xz * yz, xx * xz + xy * yz + xz * zz,
            xy * xy + yy * yy + yz * yz, xy * xz + yy * yz + yz * zz, xz * xz + yz * yz + zz * zz]


def determinant(m):
    xx, xy, xz, yy, yz, zz = m
    return xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)


# ---------------------------------------------------------------- 13. VIZM

def network(content):
    check(len(content) == 4796, "length of the network")
    if struct.unpack_from("<4H", content) != (4, 64, 64, 2):
        raise Unsupported("shape of the network")
    scale, opacity, floor = struct.unpack_from("<3d", content, 8)
    at, layers = 32, []
    for n, m in ((4, 64), (64, 64), (64, 2)):
        steps = np.frombuffer(content, "<f4", 2, at)
        weights = np.frombuffer(content, "i1", n * m, at + 8)
        biases = np.frombuffer(content, "<i2", m, at + 8 + n * m)
        check((weights != -128).all() and (biases != -32768).all(), "a number of the network")
        layers.append((weights.astype("f4").reshape(m, n) * steps[0], biases.astype("f4") * steps[1]))
        at += 8 + n * m + 2 * m
    return {"ranges": (scale, opacity, floor), "layers": layers}


# ---------------------------------------------------------------- 14. fiEL

class Number:
    """A kind of numbers: its step in standard errors, and its models."""

    def __init__(self, steps):
        self.steps = steps
        self.models = [Residuals(bell(32, math.sqrt(2.0 ** (c - 4))), 0) for c in range(24)]

    def read(self, stream, guess, variance, error):
        step = self.steps * error
        square = (variance + error * error) / (step * step)
        k = self.models[sum(2.0 ** (c - 3) <= square for c in range(23))].read(stream)
        check(abs(k) <= 1 << 20, "a number of a field")
        return guess + step * float(k)


def places_of(block):
    return np.array(block.columns["mean"], "<f8").reshape(-1, 3)


def guesses(places, order, i):
    """What the nearest of the Gaussians decoded last say of Gaussian i."""
    recent = order[-1024:]
    d = places[recent] - places[i]
    squares = d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1] + d[:, 2] * d[:, 2]
    near = sorted(range(len(recent)), key=lambda j: (squares[j], -j))[:8]
    near = [(recent[j], math.sqrt(squares[j])) for j in near]

    def guess(start, errors, change, values):
        top = bottom = 0.0
        for j, distance in near:
            w = 1.0 / ((errors(j) + change * distance) + 1e-300)
            top += w * values(j)
            bottom += w
        return (top / bottom, float(len(near)) / bottom) if near else (start, 1e30)

    return guess


def read_correlation(block, content, known):
    check(len(content) >= 14, "head of a correlation")
    a, b = content[:2]
    check(a != b and max(a, b) < len(known) and known[a][1] == known[b][1] == 1 and not known[a][3] | known[b][3], "fields of a correlation")
    pair = known[a][0], known[b][0]
    there = all(name in block.fields for name in pair)
    check(not {pair, pair[::-1]} & block.correlations.keys(), "a correlation twice")
    steps, change, start = struct.unpack_from("<3f", content, 2)
    check(0 < steps < 1e30 and 0 < change < 1e30 and math.isfinite(start), "steps of a correlation")
    stream, number, places, order = Stream(content[14:]), Number(steps), places_of(block), []
    numbers = [0.0] * len(block.counts)
    for i, n in enumerate(map(float, block.counts)):
        if n < 1:
            continue
        g = guesses(places, order, i)(start, lambda j: 1.0 / float(block.counts[j]), change, lambda j: numbers[j])
        numbers[i] = min(max(number.read(stream, *g, 1.0 / math.sqrt(n)), -4.0), 4.0)
        order.append(i)
    stream.finish()
    check(stream.end() == len(content) - 14, "length of a correlation's stream")
    if there:
        block.correlations[pair] = [(t - 1.0) / (t + 1.0) for t in (exp(2.0 * z) for z in numbers)]


def read_field(block, content, known, before=None):
    check(len(content) >= 42 and content[0] < len(known), "number of a field")
    name, components, traits, shares = known[content[0]]
    by_mass, logarithmic = traits & 1, traits & 2
    start = 42 + 24 * components + (16 if logarithmic else 0)
    check(content[1] == components and name not in block.fields, "components of a field")
    floats = struct.unpack_from("<10f", content, 2)
    steps, (a, b, shape_square, slope_square) = floats[:4], floats[4:8]
    check(all(0 < v < 1e30 for v in floats[:8]) and not math.isnan(floats[8]) and math.isfinite(floats[9]), "steps of a field")
    check(len(content) >= start, "sums of a field")
    reals = struct.unpack_from(f"<{3 * components}d", content, 42)
    check(all(map(math.isfinite, reals)), "sums of a field")
    check(all(reals[k] <= reals[k + 1] for k in range(components, 3 * components, 2)), "range of a field")
    check(not shares or reals[0] >= 0 and reals[1:] == (0.0, 1.0), "range of shares")
    excess_step, excess_square, shift = struct.unpack_from("<2fd", content, start - 16) if logarithmic else (1.0, 1.0, 0.0)
    check(0 < excess_step < 1e30 and 0 < excess_square < 1e30 and abs(shift) <= 1e3, "the excess of a field")
    stream = Stream(content[start:])
    log_spread, mean, shape, slope, excess = map(Number, (steps[1], steps[0], steps[2], steps[3], excess_step))
    total = len(block.counts)
    means, slopes = [[0.0] * components for _ in range(total)], [[0.0] * (3 * components) for _ in range(total)]
    spreads = [[0.0] * (1 if components == 1 else 6) for _ in range(total)]
    places = places_of(block)
    order, logs, sizes, excesses = [], {}, {}, [0.0] * total
    check(before is None or name in before.fields, "a field of the frame before")
    width = max(high - low for low, high in zip(reals[components::2], reals[components + 1 :: 2]))
    moved = FieldMove(before, block, name, (components, shares, width), steps) if before else None
    for i, n in enumerate(map(float, block.counts)):
        if n < 1:
            continue
        if moved and moved.knows(i):
            means[i], slopes[i], spreads[i], sizes[i] = moved.read(stream, i, n)
            if logarithmic:
                excesses[i] = read_excess(excess, stream, sizes[i], n, excess_square)
            order.append(i)
            continue
        guess = guesses(places, order, i)
        if not shares:
            twice = 2.0 * components
            error = 1.0 / math.sqrt(twice * n)
            g = floats[9], 1.0
            if before is None:
                g = guess(floats[9], lambda j: 1.0 / (twice * float(block.counts[j])), b, logs.get)
            logs[i] = min(max(log_spread.read(stream, *g, error), -300.0), 300.0)
            sizes[i] = exp(logs[i])
        for k in range(components):
            first = floats[8] if math.isfinite(floats[8]) else reals[components + 2 * k + (floats[8] > 0)]
            g = guess(first, lambda j: sizes[j] * sizes[j] / float(block.counts[j]), a, lambda j: means[j][k])
            error = (share_deviation(g[0], n) if shares else sizes[i]) / math.sqrt(n)
            means[i][k] = mean.read(stream, *g, error)
        if shares:
            sizes[i] = share_deviation(means[i][0], n)
        s = sizes[i]
        error = 1.0 / math.sqrt(n)
        five = [0.0] * 5
        if components == 3:
            five = [min(max(shape.read(stream, 0.0, shape_square, error), -16.0), 16.0) for _ in range(5)]
        widths = Widths(block.columns["cov"][i])
        for k in range(components):
            g = [slope.read(stream, 0.0, slope_square, error) * s for _ in range(3)]
            slopes[i][3 * k : 3 * k + 3] = widths.slope(g)
        if logarithmic:
            excesses[i] = read_excess(excess, stream, s, n, excess_square)
        spreads[i] = [s * s] if components == 1 else [v * (s * s) for v in exponential(five)]
        order.append(i)
    stream.finish()
    check(stream.end() == len(content) - start, "length of a field's stream")
    weights = [float(w) for w in (block.masses if by_mass and block.masses else block.counts)]
    for k in range(components):
        low, high = reals[components + 2 * k : components + 2 * k + 2]
        for row in means:
            row[k] = min(max(row[k], low), high)
        if logarithmic:
            continue
        if shares:
            scale_shares(means, weights, reals[0])
            spreads = [[row[0] * (1.0 - row[0])] for row in means]
            continue
        off = (reals[k] - neumaier([w * row[k] for w, row in zip(weights, means)])) / neumaier(weights)
        for row in means:
            row[k] += off
    excesses = [[c + shift] if logarithmic else [] for c in excesses]
    rows = [*means, *slopes, *spreads, *excesses]
    check(all(math.isfinite(v) for row in rows for v in row), "numbers of a field")
    block.fields[name] = [[*m, *sl, *sp, *c] for m, sl, sp, c in zip(means, slopes, spreads, excesses)]


def read_excess(excess, stream, s, n, mean_square):
    square = s * s
    error = math.sqrt((min(square * square * square / 6.0 * exp(square / 3.0), 0.25) + 1e-6) / n)
    return min(max(excess.read(stream, 0.0, mean_square, error), -100.0), 100.0)


class Widths:
    """The lower triangle of a covariance, with its small numbers kept off 0."""

    def __init__(self, cov):
        xx, xy, xz, yy, yz, zz = cov
        root = lambda v: math.sqrt(max(v, ((xx + yy) + zz) * 2.0**-40 + 1e-300))
        self.x = root(xx)
        self.a, self.b = xy / self.x, xz / self.x
        self.y = root(yy - self.a * self.a)
        self.c = (yz - self.b * self.a) / self.y
        self.z = root((zz - self.b * self.b) - self.c * self.c)

    def __call__(self, q):
        return [self.x * q[0], self.a * q[0] + self.y * q[1], (self.b * q[0] + self.c * q[1]) + self.z * q[2]]

    def over(self, x, y, z):
        """How a field changes over the widths, of its slope."""
        return (x * self.x + y * self.a) + z * self.b, y * self.y + z * self.c, z * self.z

    def slope(self, over):
        z = over[2] / self.z
        y = (over[1] - self.c * z) / self.y
        return [((over[0] - self.a * y) - self.b * z) / self.x, y, z]


class ChangeModels:
    """Of numbers by kind and three classes, and of whether a Gaussian stays."""

    def __init__(self, kinds):
        self.stays = Adaptive([60, 1])
        self.models = {kind: [Residuals(bell(16, 0.25 * 2 ** (n % 6)), 0) for n in range(96)] for kind in kinds}

    def read(self, stream, kind, unrest, history=0, f=1.0):
        a, b, c = (sum(v >= edge for edge in edges) for v, edges in zip((unrest, abs(history), f), EDGES))
        k = self.models[kind][(4 * c + b) * 6 + a].read(stream)
        check(abs(k) <= 1 << 20, "a number of a change")
        return -k if history < 0 else k


class FieldMove:
    """A field of Gaussians that stayed, from what they had in the frame before."""

    def __init__(self, before, block, name, kind, steps):
        self.before, self.block, (self.components, self.shares, self.width), self.steps = before, block, kind, steps
        self.had = before.fields[name]
        self.models = ChangeModels(range(5))

    def spread(self, j):
        own = self.had[j][4 * self.components :][: 1 if self.components == 1 else 6]
        return own, own[0] if self.components == 1 else (own[0] + own[3]) + own[5]

    def knows(self, i):
        if i >= len(self.block.stayed):
            return False
        j, n = self.block.stayed[i], float(self.block.counts[i])
        least = max(self.width * self.width * n, 1e-200) * 2.0**-42
        return self.before.counts[j] >= 1 and (self.shares or self.spread(j)[1] >= self.components * least)

    def read(self, stream, i, n):
        c, j, total = self.components, self.block.stayed[i], 0
        means, slopes, (spread, trace) = self.had[j][:c], self.had[j][c : 4 * c], self.spread(j)
        mean_step, log_step, shape_step, slope_step = self.steps

        def number(kind, step, most=math.inf):
            nonlocal total
            k = self.models.read(stream, kind, self.block.unrests[i] + 2 * total)
            check(abs(step * float(k)) <= most, "a change of a field")
            total += abs(k)
            return step * float(k)

        error, size, s = 1.0 / math.sqrt(n), 0.0, 0.0
        if not self.shares:
            size = number(0, log_step * (1.0 / math.sqrt(2.0 * c * n)), 16.0)
            s = math.sqrt(trace / c) * exp(size)
        mean = []
        for guess in means:
            s = share_deviation(guess, n) if self.shares else s
            mean.append(guess + number(1, mean_step * (s / math.sqrt(n))))
        if c == 3:
            unit = exponential([number(2, shape_step * error, 16.0) for _ in range(5)])
            spread = congruent(Widths(spread), unit, exp(2.0 * size))
        elif self.shares:
            s = share_deviation(mean[0], n)
            spread = [s * s]
        else:
            spread = [spread[0] * exp(2.0 * size)]
        widths, slope = Widths(self.block.columns["cov"][i]), []
        for k in range(c):
            over = widths.over(*slopes[3 * k : 3 * k + 3])
            slope += widths.slope([(v / s + number(3, slope_step * error)) * s for v in over])
        return mean, slope, spread, s


def share_deviation(share, n):
    v = min(max(share, 0.0), 1.0)
    return math.sqrt(max(v * (1.0 - v), 1.0 / n))


def scale_shares(means, weights, wanted):
    for _ in range(64):
        total = neumaier([w * row[0] for w, row in zip(weights, means)])
        if total == wanted:
            break
        for row in means:
            row[0] = min(row[0] * (wanted / total), 1.0) if total > 0 else wanted / neumaier(weights)


def last_class(block, names):
    """The shares of the last class, which follow from the others'."""
    *others, last = names
    there = [block.fields[name] for name in others if name in block.fields]
    check(last not in block.fields, "shares of a category")
    if len(there) < len(others):
        for name in others:
            block.fields.pop(name, None)
    elif there:
        rows = block.fields[last] = []
        for i, n in enumerate(block.counts):
            share = max(1.0 - sum((rows[i][0] for rows in there), 0.0), 0.0) if n >= 1 else 0.0
            slope = [0.0 - sum((rows[i][k] for rows in there), 0.0) for k in (1, 2, 3)]
            rows.append([share, *slope, share * (1.0 - share)])


# ---------------------------------------------------------------- 15. Species that share Gaussians

def separate(model, species, names):
    layers, masses = [], []
    for (name, blocks), mass in zip(model["layers"], model["masses"]):
        if species and name == "+".join(s[0] for s in species):
            parts = [[Part(block, *part) for part in parts_of(block, species, names)] for block in blocks]
            for k, (own, _, each) in enumerate(species):
                there = [block[k] for block in parts if block[k].count > 0]
                if there:
                    layers.append((own, there))
                    masses.append((0, each))
        else:
            layers.append((name, blocks))
            masses.append(mass)
    model["layers"], model["masses"] = layers, masses


class Part:
    """A species of a block."""

    def __init__(self, block, count, counts, means, covariances, fields):
        self.lo, self.hi, self.count, self.mass, self.counts, self.fields = block.lo, block.hi, count, float(count), counts, fields
        self.columns = {"mean": means, "cov": covariances}
        self.masses = self.opacities = self.greys = None


def parts_of(block, species, names):
    left, total = block.count, neumaier([float(count) for _, count, _ in species])
    for k, ((_, count, _), name) in enumerate(zip(species, names)):
        rows = block.fields.get(name)
        weights = [float(n) * (rows[i][0] if rows else float(count) / total) for i, n in enumerate(block.counts)]
        # Rounded to the nearest, halves away from 0.
        own = left if k + 1 == len(species) else min(math.floor(neumaier(weights) + 0.5), left)
        left -= own
        if neumaier(weights) <= 0:
            weights = [1.0] * len(weights)
        counts, means, covariances = largest_remainder(weights, own), [], []
        fields = {other: [] for other in block.fields if other not in names}
        there = [i for i, n in enumerate(counts) if n > 0]
        for i in there:
            d = moved(rows[i][0], rows[i][1:4], block.columns["cov"][i]) if rows else [0.0] * 3
            means.append([m + v for m, v in zip(block.columns["mean"][i], d)])
            pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
            covariances.append([c + d[a] * d[b] * -1.0 for c, (a, b) in zip(block.columns["cov"][i], pairs)])
            for other, values in fields.items():
                old = block.fields[other][i]
                n = 3 if len(old) == 18 else 1
                slopes = [old[n + 3 * j : n + 3 * j + 3] for j in range(n)]
                values.append([old[j] + sum((s * v for s, v in zip(slopes[j], d)), 0.0) for j in range(n)] + old[n:])
        yield own, [counts[i] for i in there], means, covariances, fields


def moved(share, g, cov):
    xx, xy, xz, yy, yz, zz = cov
    square = xx * g[0] * g[0] + yy * g[1] * g[1] + zz * g[2] * g[2]
    square += 2.0 * (xy * g[0] * g[1] + xz * g[0] * g[2] + yz * g[1] * g[2])
    root = math.sqrt(max(square, 0.0))
    if root == 0 or share == 0:
        return [0.0] * 3
    far = root / share
    factor = 0.9 / far if far > 0.9 else 1.0
    along = [row[0] * g[0] + row[1] * g[1] + row[2] * g[2] for row in ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))]
    return [v / share * factor for v in along]


# ---------------------------------------------------------------- what was read, to compare

def hexadecimal(values):
    return " ".join(f"{v:016x}" for v in np.asarray(values, "<f8").view("<u8").tolist())


def dump(model, out):
    """The lines that `cargo run -p particlegs-compress --example decoded_bits` prints."""
    meta = model["meta"]
    hashes = ("hash", meta["hash"], "fields", meta["fields_hash"])
    print("law", meta["law"], "particles", meta["particles"], *hashes, file=out)
    print("reals", hexadecimal([meta["mass"], *meta["bounds"], meta["radius"], meta["opacity"]]), file=out)
    print("source", meta["source"], file=out)
    words = lambda numbers: " ".join("none" if v is None else hexadecimal([v]) for v in numbers)
    for name, own in zip(("length", "mass", "time"), meta["units"]):
        print("unit of", name, "none" if own is None else f"{own[0]} {words(own[1:])}", file=out)
    print("comoving", meta["comoving"], "frame", *meta["moment"][2:], file=out)
    print("moment", words(meta["moment"][:2]), "cosmology", words(meta["cosmology"]), file=out)
    for name, kind, size, own in meta["kept"]:
        print("kept", name, kind, size, "none" if own is None else own[0], file=out)
    for weighted, mass in model["masses"]:
        print("layer's mass", weighted, words([mass]), file=out)
    print("effort", meta["effort"] or "none", file=out)
    for tag, numbers in model["cert"].items():
        words = (hexadecimal([v]) if isinstance(v, float) else str(v) for v in numbers)
        print("group", tag, *words, file=out)
    if model["vizm"]:
        parameters = np.concatenate([np.concatenate([w.ravel(), b]) for w, b in model["vizm"]["layers"]])
        print("ranges", hexadecimal(model["vizm"]["ranges"]), file=out)
        print("network", parameters.astype("<f4").tobytes().hex(), file=out)
    for name, blocks in model["layers"]:
        print("layer", name, len(blocks), file=out)
        for block in blocks:
            print("block", block.count, hexadecimal([block.mass, *block.lo, *block.hi]), len(block.counts), file=out)
            extra = [c for c in (block.masses, block.opacities, block.greys) if c is not None]
            for i in range(len(block.counts)):
                row = [*block.columns["mean"][i], *block.columns["cov"][i], block.counts[i], *[c[i] for c in extra]]
                print(hexadecimal(row), file=out)
            for name, rows in block.fields.items():
                print("field", name, file=out)
                for row in rows:
                    print(hexadecimal(row), file=out)
            for first in block.fields:
                for (name, other), column in block.correlations.items():
                    if name == first:
                        print("correlation", name, other, file=out)
                        print(hexadecimal(column), file=out)


def cut(data, prefix):
    """Open files, one that ends within each section behind the first block."""
    found, _ = sections(data)
    head = data[:12] + bytes(8)
    head += struct.pack("<I", zlib.crc32(head))
    first = [tag for tag, _, _ in found].index(b"BLOK") + 1
    for n, (_, content, place) in enumerate(found[first:]):
        with open(f"{prefix}-{n}.pgs", "wb") as out:
            out.write(head + data[24 : place + 15 + len(content)])


if __name__ == "__main__":
    *arguments, model = sys.argv[1:]
    with open(model, "rb") as f:
        if arguments:
            cut(f.read(), arguments[1])
        else:
            data = f.read()
            dump(read_series(data) if data[10:11] == b"\2" else read(data), sys.stdout)
