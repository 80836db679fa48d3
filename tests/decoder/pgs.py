"""A reader of model files (.pgs) written from the words of docs/format.md alone, to hold that page and the
program's own reader to each other. Sections (1, 2, ...) are the page's.

    python3 pgs.py MODEL.pgs      every decoded number, as hexadecimal bits, one line a Gaussian
"""
import json
import math
import struct
import sys
import zlib
from bisect import bisect_right

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

def sections(data):
    """(tag, content) of every section, and the minor version."""
    check(data[:8] == MAGIC, "magic")
    check(len(data) >= 24, "shorter than a head")
    check(zlib.crc32(data[:20]) == struct.unpack_from("<I", data, 20)[0], "checksum of the head")
    major, minor, reserved, length = struct.unpack_from("<BBHQ", data, 8)
    if major != 1:
        raise Unsupported(f"major version {major}")
    check(reserved == 0 or minor > 3, "reserved field")
    check(length == len(data), "length of the file")
    found, at = [], 24
    while at < len(data):
        check(at + 16 <= len(data), "head of a section")
        tag, size, crc = data[at : at + 4], *struct.unpack_from("<QI", data, at + 4)
        check(size <= len(data) - at - 16, "length of a section")
        content = data[at + 16 : at + 16 + size]
        check(zlib.crc32(content, zlib.crc32(data[at : at + 12])) == crc, f"checksum of {tag}")
        found.append((tag, content))
        at += 16 + size
    return found, minor


def read(data):
    """A whole file: metadata, certificate, network, and layers as (name, blocks)."""
    found, minor = sections(data)
    model = {"minor": minor, "layers": [], "cert": {}, "vizm": None}
    before, left = b"", 0
    for tag, content in found:
        if tag == b"META":
            check(before == b"", "order")
            model["meta"] = metadata(content)
        elif tag == b"CERT":
            check(before == b"META", "order")
            model["cert"] = certificate(content)
        elif tag == b"VIZM" and minor >= 3:
            check(before in (b"META", b"CERT") and model["meta"]["law"] == 2, "order")
            model["vizm"] = network(content)
        elif tag == b"LAYR":
            check(before != b"" and left == 0, "order")
            n = content[0]
            check(len(content) == 1 + n + 4, "length of a layer's head")
            name, left = content[1 : 1 + n], struct.unpack_from("<I", content, 1 + n)[0]
            check(not model["layers"] or model["layers"][-1][0] < name, "order of layers")
            model["layers"].append((name, []))
        elif tag == b"BLOK":
            check(left > 0, "a block without a layer")
            model["layers"][-1][1].append(Block(content))
            left -= 1
        elif tag[:1].islower():
            continue
        else:
            raise Unsupported(f"section {tag}")
        before = tag
    check(left == 0 and model["layers"], "blocks are missing")
    check_sums(model)
    return model


def check_sums(model):
    meta, blocks = model["meta"], [b for _, blocks in model["layers"] for b in blocks]
    check(sum(b.count for b in blocks) == meta["particles"], "particles")
    mass = neumaier([b.mass for b in blocks])
    check(abs(mass - meta["mass"]) <= 1e-9 * meta["mass"], "mass")
    check(all(b.shaded == (meta["law"] == 2) for b in blocks), "shaded blocks and the image law")
    for (weighted, _), (_, own) in zip(masses_of(model), model["layers"]):
        check(all(b.weighted == weighted for b in own), "weighted blocks and their layer")


def masses_of(model):
    """(has weights, mass of weight 1 or None) of each layer."""
    told, layers = model["meta"]["masses"], len(model["layers"])
    check(len(told) in (1, layers), "masses of layers")
    return told * layers if len(told) == 1 else told


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
    if any(weighted for weighted, _ in masses):
        check(kept[1] == ("masses", 1, 4, units[1]), "masses")
    return {
        "law": law,
        "particles": one(fields, 2, "<Q"),
        "mass": real(3),
        "bounds": struct.unpack("<6d", fields[4]),
        "radius": real(7),
        "opacity": real(8),
        "source": fields[9].decode(),
        "hash": fields[10].hex(),
        "kept": kept,
        "units": units,
        "comoving": one(fields, 19, "<B"),
        "cosmology": cosmology(fields.get(24, b"\0")),
        "moment": (real(25), real(26), one(fields, 27, "<Q"), one(fields, 28, "<q")),
        "effort": effort(fields[40]),
        "masses": masses,
    }


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
COUNT, MARK, RATIO = (0, 2**64), (0, 1), (-1, 1)
TINY = (5e-324, math.inf)
SCORES = ["score"] * 5
LOOK = [("B", (0, 2)), *SCORES, *SCORES]
CELLS = [("f", REAL), ("f", RATIO), ("f", REAL), ("f", REAL)]
POWER = [("f?", REAL), "up to"]
GROUPS = {
    1: [("H", COUNT), ("H", COUNT), ("Q", COUNT), *SCORES * 9],
    2: [("H", COUNT), *CELLS[1:]],
    3: [("d", TINY), *CELLS] * 3,
    4: [("B", MARK), ("H", COUNT), ("f", REAL), *["up to"] * 4, "from"],
    6: [("Q", (1, 2**64)), *[("d", SIGNED)] * 6],
    7: [("d", REAL), ("f", REAL)] * 2,
    8: [("I", COUNT), ("f?", REAL), ("f", REAL), ("f?", REAL), ("f?", REAL), ("f?", REAL), ("f", REAL)] * 3,
    9: [("f", SIGNED), ("f", REAL), ("f", SIGNED), ("d", REAL), ("d", REAL), *[("f?", SIGNED), ("f", REAL)] * 7],
    10: [("Q", (1, 2**64)), ("Q", COUNT)],
    11: [("H", COUNT), ("H", COUNT), *[("f", TINY), ("f", (TINY[0], 1)), ("B", MARK), *LOOK, *LOOK] * 7],
    12: [("I", COUNT)],
    13: [("B", (0, 3)), ("d", REAL), ("d", REAL), ("d", SIGNED)],
}


def certificate(content):
    """Groups by tag: the figures of each, as lines say them."""
    found, at, last = {}, 0, 0
    while at < len(content):
        check(at + 3 <= len(content), "head of a group")
        tag, length = struct.unpack_from("<BH", content, at)
        check(tag > last and at + 3 + length <= len(content), "a group of the certificate")
        value, at, last = content[at + 3 : at + 3 + length], at + 3 + length, tag
        if tag == 5:
            found[tag] = figures(value, POWER * min(max(length // 8, 1), 9))
        elif tag in GROUPS:
            found[tag] = figures(value, GROUPS[tag])
    check(1 in found and 2 in found, "a group is missing")
    if 4 in found:
        largest = found[4][2]
        check(all(isinstance(k, str) or k <= largest for k in found[4][3:7]), "a wave number of the statistics")
    if 6 in found:
        check(all(low <= high for low, high in zip(found[6][1:4], found[6][4:7])), "corners of the region")
    return found


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

    def __init__(self, content):
        head = struct.unpack_from("<6dQdI5B5f2fi4hi6h", content)
        self.lo, self.hi = head[0:3], head[3:6]
        self.count, self.mass, self.gaussians, flags = head[6:10]
        self.weighted, self.shaded = flags & 1, flags >> 1 & 1
        self.low_bits = dict(zip("size count mass shape".split(), head[10:14]))
        self.steps = dict(zip("position size count shape mass".split(), head[14:19]))
        self.importance, self.centre = head[19:21]
        self.size_constant, self.size_slopes = head[21], head[22:26]
        self.count_constant, self.count_slopes = head[26], head[27:33]
        self.extent = tuple(h - l for l, h in zip(self.lo, self.hi))
        check(1 <= self.gaussians <= 4 * len(content) and flags < 8 and flags & 3 < 3, "header of a block")
        self.spreads = struct.unpack_from("<3f", content, 129) if flags & 4 else None
        start = 141 if flags & 4 else 129
        check(all(e >= 0 and math.isfinite(e) for e in self.extent), "bounds of a block")
        self.columns = {k: [] for k in "mean cov C W radius".split()}
        self.decode(content[start:], -(-self.gaussians // 4) - start)
        self.finish()

    # ------------------------------------------------------------ 4. streams, 5. segments

    def decode(self, data, least):
        root = ((0, 0, 0), (0, 0, 0), self.gaussians, 0)
        if self.gaussians <= 65536:
            segments, at = [[root]], 0
            lengths = [None]
        else:
            (number,) = struct.unpack_from("<I", data)
            check(1 <= number <= 2 * (self.gaussians // 65536) + 1, "number of segments")
            trunk, *lengths = struct.unpack_from(f"<{1 + number}I", data, 4)
            at = 8 + 4 * number
            check(trunk + sum(lengths) <= len(data) - at, "lengths of streams")
            segments = self.trunk(Stream(data[at : at + trunk]), root)
            check(len(segments) == number, "number of segments")
            at += trunk
        for nodes, length in zip(segments, lengths):
            stream = Stream(data[at:] if length is None else data[at : at + length])
            Segment(self, stream).walk(nodes)
            at += stream.end()
            if length is not None:
                check(stream.end() == length, "length of a stream")
        check(len(data) == max(at, least) and not any(data[at:]), "padding")

    def trunk(self, stream, root):
        """Nodes of at most 65536 Gaussians, joined to segments."""
        splits, stack, segments, held = Splits(stream, self.slowest()), [root], [], 0
        while stack:
            node = stack.pop()
            axis = self.axis(node)
            if node[2] > 65536 and axis is not None:
                stack.extend(reversed(self.halves(node, axis, splits)))
            elif segments and held + node[2] <= 65536:
                segments[-1].append(node)
                held += node[2]
            else:
                segments.append([node])
                held = node[2]
        stream.finish()
        return segments

    def slowest(self):
        return 9 if self.spreads else 7

    def axis(self, node):
        """The axis that a cell is halved along, or None."""
        depth = node[0]
        best, longest = None, 0.0
        for k in range(3):
            length = self.extent[k] * 2.0 ** -depth[k]
            if length > longest and depth[k] < 40:
                best, longest = k, length
        return best

    def halves(self, node, axis, splits):
        depth, index, n, share = node
        l = splits.read(n, share)
        depth = tuple(d + (k == axis) for k, d in enumerate(depth))
        result = []
        for upper, part in ((0, l), (1, n - l)):
            place = tuple(2 * i + upper if k == axis else i for k, i in enumerate(index))
            of = 0 if part == n else 1 if 2 * part < n else 2
            if part:
                result.append((depth, place, part, of))
        return result

    # ------------------------------------------------------------ 10. Counts and masses

    def finish(self):
        c = self.columns
        half = 0.5 * self.steps["count"]
        weights = [exp(half * v) for v in c["C"]]
        grey = 0.5 * self.steps["mass"]
        self.counts = [0.0] * len(weights)
        self.masses = self.opacities = self.greys = None
        if self.shaded:
            depth = [min(max(w, 2.0**-20), 16.0) for w in weights]
            self.opacities = [1.0 - exp(-d) for d in depth]
            self.greys = [exp(grey * v) for v in c["W"]]
            weights = self.opacities
        self.counts = largest_remainder(weights, self.count)
        if self.weighted:
            masses = [n * exp(grey * v) for n, v in zip(self.counts, c["W"])]
            if neumaier(masses) == 0:
                masses = [self.mass / len(masses)] * len(masses)
            else:
                for _ in range(2):
                    factor = self.mass / neumaier(masses)
                    masses = [m * factor for m in masses]
            self.masses = masses


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
    check(left == 0, "more counts than particles")
    return [float(n) for n in counts]


# ---------------------------------------------------------------- 5. to 8. A segment

NEXT = ((0, 2), (5, 7), (1, 3), (4, 6), (2, 0), (7, 5), (3, 1), (6, 4))


class Trellis:
    state = 0

    @property
    def z(self):
        return self.state % 2

    def take(self, k):
        self.state = NEXT[self.state][k % 2]


class Segment:
    """The walk over a segment's nodes, with models and trellises of its own."""

    def __init__(self, block, stream):
        self.block, self.stream, self.splits = block, stream, Splits(stream, block.slowest())
        self.trellis = {name: Trellis() for name in "size count mass shape place".split()}
        low = block.low_bits
        slowest = block.slowest()
        first = [first_weights(32)] * 3
        size, number = ([bell(32, s)] for s in block.spreads[:2]) if block.spreads else (first, first)
        self.size = [Residuals(stream, w, low["size"], slowest) for w in size]
        self.number = [Residuals(stream, w, low["count"], slowest) for w in number]
        self.mass = Residuals(stream, first[0], low["mass"], slowest)
        self.shape = {}
        self.level = [0, 0]
        self.t, self.c, self.w = [0, 0], [0, 0], 0

    def walk(self, nodes):
        stack = list(reversed(nodes))
        while stack:
            node = stack.pop()
            axis = self.block.axis(node)
            if node[2] > 1 and axis is not None:
                stack.extend(reversed(self.block.halves(node, axis, self.splits)))
            else:
                for _ in range(node[2]):
                    self.gaussian(node)
        self.stream.finish()

    def lattice(self, name, predicted, model):
        """Half steps h = 2 k + z of one number."""
        trellis = self.trellis[name]
        z = trellis.z
        k = model.read() + ((predicted - z + 1) >> 1)
        check(abs(k) <= 1 << 20, "a number beyond its range")
        trellis.take(k)
        return 2 * k + z

    def gaussian(self, node):
        block = self.block
        level = sum(node[0])
        near = abs(level - self.level[0])
        near = 0 if near <= 1 or block.spreads else 1 if near <= 4 else 2
        t = self.lattice("size", predict(block.size_constant, block.size_slopes, (level, self.level[0], *self.t)),
                         self.size[near])
        features = (level, self.level[0], t, self.t[0], *self.c)
        c = self.lattice("count", predict(block.count_constant, block.count_slopes, features), self.number[near])
        w = 0
        if block.weighted or block.shaded:
            w = self.lattice("mass", self.w, self.mass)
            self.w = w
        self.level[0], self.t, self.c = level, [t, self.t[0]], [c, self.c[0]]

        steps, b = block.steps, block.importance
        size = 0.5 * steps["size"] * t
        r = exp(size)
        g = exp((-b if block.shaded else b) * size) * exp(b * (block.centre - 0.5 * steps["count"] * c))
        g = min(max(g, 0.125), 8.0)
        numbers = self.shapes(g)
        step = 0.5 * steps["shape"] * g
        step = min(step, 1.0) if block.spreads else step
        shape = [s * step for s in numbers]
        check(all(abs(s) <= 32 for s in shape), "a shape number beyond its range")
        columns = block.columns
        unit = exponential(shape)
        widths = cholesky(unit) if block.spreads else (1.0, 1.0, 1.0)
        columns["mean"].append(self.place(node, steps["position"] * g * r, widths))
        columns["cov"].append(covariance(r, unit))
        columns["C"].append(c)
        columns["W"].append(w)

    def shapes(self, g):
        square = g * g
        of_g = sum(2.0**e <= square for e in range(-5, 6))
        numbers, total = [], 0
        for j in range(5):
            mean = total // j if j else 0
            key = (j < 2, of_g, 0 if mean < 2 else 1 if mean <= 4 else 2)
            weights, low = first_weights(16), self.block.low_bits["shape"]
            if self.block.spreads:
                e = (5 * (self.block.spreads[2] / g) + total) / (5 + j) / 2.0**low
                of_e = sum(2.0**edge <= e * e for edge in range(-3, 8))
                key, weights = (of_e, self.trellis["shape"].z), bell(16, SPREADS[of_e])
            if key not in self.shape:
                self.shape[key] = Residuals(self.stream, weights, low, self.block.slowest())
            numbers.append(self.lattice("shape", 0, self.shape[key]))
            total += abs(numbers[-1])
        return numbers

    def place(self, node, u, widths):
        block, trellis, mean = self.block, self.trellis["place"], []
        depth, index = node[0], node[1]
        for k in range(3):
            levels = block.extent[k] * 2.0 ** -depth[k] / (u * widths[k]) + 0.5
            n = min(max(math.floor(levels), 1), 1 << 40) if levels < 2.0**41 else 1 << 40
            f = 0.5
            if n > 1:
                j = long(self.stream, n)
                f = 0.25 * (4 * j + 1 + 2 * trellis.z) / n
                trellis.take(j)
            mean.append(block.lo[k] + block.extent[k] * ((index[k] + f) * 2.0 ** -depth[k]))
        return mean


def predict(constant, slopes, features):
    p = constant + (sum(s * f for s, f in zip(slopes, features)) + 128 >> 8)
    return min(max(p, -(1 << 21)), 1 << 21)


# ---------------------------------------------------------------- 7. Entropy coding

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

    def __init__(self, stream, weights, slowest):
        self.stream, self.k, self.seen, self.slowest = stream, len(weights), 0, slowest
        room, total, below = (1 << 30) - self.k * 32768, sum(weights), 0
        self.f = []
        for v, w in enumerate(weights):
            self.f.append(below * room // total + v * 32768)
            below += w
        # Targets of F[i] where i > v, and where i <= v.
        self.above = [(1 << 30) - (self.k - i) * 32768 for i in range(self.k)]
        self.below = [i * 32768 for i in range(self.k)]

    def read(self):
        f, slot = self.f, self.stream.slot()
        # The last v with F[v] >> 15 <= slot.
        v = bisect_right(f, slot << 15 | 0x7FFF) - 1
        start = f[v] >> 15
        end = f[v + 1] >> 15 if v + 1 < self.k else 32768
        self.stream.take(start, end - start)
        self.seen += 1
        q = min(4 + sum(self.seen > n for n in (12, 40, 120, 360, 1000)), self.slowest)
        targets = self.below[: v + 1] + self.above[v + 1 :]
        self.f = [a + (t - a >> q) for a, t in zip(f, targets)]
        self.f[0] = 0
        return v


# ---------------------------------------------------------------- 8. What is coded with which model

class Splits:
    def __init__(self, stream, slowest):
        self.stream, self.models, self.slowest = stream, {}, slowest

    def read(self, n, share):
        of_n = n if n < 16 else min(n.bit_length() - 5, 4) + 16
        model = self.models.get((share, of_n))
        if model is None:
            top = min(n, 15)
            weights = [4 if v in (0, top) else 1 if v < top else 0 for v in range(16)]
            model = self.models[share, of_n] = Adaptive(self.stream, weights, self.slowest)
        v = model.read()
        if n < 16:
            check(v <= n, "a half with more than the whole")
            return v
        first, end = -(-v * (n + 1) // 16), -(-(v + 1) * (n + 1) // 16)
        return first + long(self.stream, end - first)


SPREADS = (0.1875, 0.25, 0.375, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)


def first_weights(k):
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


class Residuals:
    def __init__(self, stream, weights, low_bits, slowest):
        self.stream, self.most, self.low_bits = stream, len(weights) // 2 - 1, low_bits
        self.model = Adaptive(stream, weights, slowest)

    def read(self):
        v = self.model.read()
        if v == self.model.k - 1:
            negative = bits(self.stream, 1)
            n = uniform(self.stream, 22)
            magnitude = (1 << n) + bits(self.stream, n) + self.most
            value = -magnitude if negative else magnitude
        else:
            value = v - self.most
        return value << self.low_bits | bits(self.stream, self.low_bits)


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
    check(all(math.isfinite(v) for v in cov), "a covariance that is not finite")
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


# ---------------------------------------------------------------- what was read, to compare

def hexadecimal(values):
    return " ".join(f"{v:016x}" for v in np.asarray(values, "<f8").view("<u8").tolist())


def dump(model, out):
    """The lines that `cargo run -p particlegs --example decoded_bits` prints."""
    meta = model["meta"]
    print("law", meta["law"], "particles", meta["particles"], "hash", meta["hash"], file=out)
    print("reals", hexadecimal([meta["mass"], *meta["bounds"], meta["radius"], meta["opacity"]]), file=out)
    print("source", meta["source"], file=out)
    words = lambda numbers: " ".join("none" if v is None else hexadecimal([v]) for v in numbers)
    for name, own in zip(("length", "mass", "time"), meta["units"]):
        print("unit of", name, "none" if own is None else f"{own[0]} {words(own[1:])}", file=out)
    print("comoving", meta["comoving"], "frame", *meta["moment"][2:], file=out)
    print("moment", words(meta["moment"][:2]), "cosmology", words(meta["cosmology"]), file=out)
    for name, kind, size, own in meta["kept"]:
        print("kept", name, kind, size, "none" if own is None else own[0], file=out)
    for weighted, mass in masses_of(model):
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
        print("layer", name.decode(), len(blocks), file=out)
        for block in blocks:
            print("block", block.count, hexadecimal([block.mass, *block.lo, *block.hi]), block.gaussians, file=out)
            extra = [c for c in (block.masses, block.opacities, block.greys) if c is not None]
            for i in range(block.gaussians):
                row = [*block.columns["mean"][i], *block.columns["cov"][i], block.counts[i], *[c[i] for c in extra]]
                print(hexadecimal(row), file=out)


if __name__ == "__main__":
    with open(sys.argv[1], "rb") as f:
        dump(read(f.read()), sys.stdout)
