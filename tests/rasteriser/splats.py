"""A rasteriser of alpha-blend models in numpy, from the published equations: Kerbl et al. 2023 (3D Gaussian
Splatting: projection, sorting, blending and its cut-offs), Zwicker et al. 2001 (EWA splatting), Yu et al. 2024
(opacity compensated for the low-pass), and docs/format.md, section 13 (frame, network, low-pass of one pixel).

    python3 splats.py views MODEL.pgs VIEWS.json         cameras around a model, at several radii and opacities
    python3 splats.py compare MODEL.pgs VIEWS.json DIR   our pictures against DIR/*.png: PSNR of each, at least 60 dB
"""
import json
import math
import os
import struct
import sys
import zlib

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../decoder"))
import pgs  # noqa: E402

LEAST_ALPHA, MOST_ALPHA, LEAST_TRANSMITTANCE = 1 / 255, 0.99, 1e-4
LOW_PASS, LEAST_RATIO = 1.0, 2.5e-5
NEAR, GUARD = 0.2, 1.3
FLOOR_DB = 60.0


# ---------------------------------------------------------------- the model in the training frame

class Scene:
    def __init__(self, model):
        meta = model["meta"]
        assert meta["law"] == 2, "not an alpha-blend model"
        lo, hi = np.array(meta["bounds"][:3]), np.array(meta["bounds"][3:])
        self.center = 0.5 * (lo + hi)
        self.scale = 4 / (0.65 * 0.5 * np.linalg.norm(hi - lo) / math.sin(math.radians(15)))
        self.radius, self.opacity, self.network = meta["radius"], meta["opacity"], model["vizm"]
        blocks = [b for _, blocks in model["layers"] for b in blocks]
        column = lambda of: np.concatenate([np.array(of(b)) for b in blocks])
        xx, xy, xz, yy, yz, zz = column(lambda b: b.columns["cov"]).T * self.scale**2
        self.cov = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1).reshape(-1, 3, 3)
        self.mean = (column(lambda b: b.columns["mean"]) - self.center) * self.scale
        self.alpha, self.grey = column(lambda b: b.opacities), column(lambda b: b.greys)

    def adapted(self, view):
        """Covariances and opacities for a view's radius and opacity (section 13)."""
        if self.network is None:
            return self.cov, self.alpha
        f_r, f_a = view["radius"] / self.radius, view["opacity"] / self.opacity
        logit = np.log(self.alpha / (1 - self.alpha))
        log_scale = np.log(np.linalg.det(self.cov).clip(1e-72)) / 6
        x = np.stack([np.full_like(logit, f_r - 1), np.full_like(logit, f_a - 1), (log_scale + 8) / 2, (logit + 3) / 4])
        (w0, b0), (w1, b1), (w2, b2) = self.network["layers"]
        silu = lambda v: v / (1 + np.exp(-v))
        d_s, d_o = np.tanh(w2 @ silu(w1 @ silu(w0 @ x + b0[:, None]) + b1[:, None]) + b2[:, None])
        of_scale, of_opacity, floor = self.network["ranges"]
        odds = np.maximum(f_a * (1 + of_opacity * d_o), floor)
        factor = f_r * (1 + of_scale * d_s)
        return self.cov * (factor**2)[:, None, None], 1 / (1 + np.exp(-logit) / odds)


# ---------------------------------------------------------------- the picture

def draw(scene, view, width, height, fov):
    """Brightness in [0, 1], rows from the top."""
    position = (np.array(view["position"]) - scene.center) * scene.scale
    back = np.array(view["position"]) - np.array(view["focal_point"])
    back /= np.linalg.norm(back)
    right = np.cross(view["view_up"], back)
    right /= np.linalg.norm(right)
    world_to_eye = np.stack([right, -np.cross(back, right), -back])
    focal = 0.5 * height / math.tan(math.radians(fov) / 2)

    x, y, depth = world_to_eye @ (scene.mean - position).T
    cov, opacity = scene.adapted(view)
    seen = depth > NEAR
    # The Jacobian of the projection, its slopes cut off beyond the picture.
    limit = [GUARD * 0.5 * size / focal for size in (width, height)]
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = np.clip(x / depth, -limit[0], limit[0]), np.clip(y / depth, -limit[1], limit[1])
        zero, one = np.zeros_like(u), np.ones_like(u)
        jacobian = (focal / depth) * np.array([[one, zero, -u], [zero, one, -v]])
    jacobian = np.moveaxis(jacobian, 2, 0) @ world_to_eye
    sharp = jacobian @ cov @ np.swapaxes(jacobian, 1, 2)
    wide = sharp + LOW_PASS * np.eye(2)
    ratio = np.linalg.det(sharp).clip(0) / np.linalg.det(wide)
    peak = opacity * np.sqrt(np.maximum(ratio, LEAST_RATIO))
    at = np.stack([focal * x / depth + 0.5 * width - 0.5, focal * y / depth + 0.5 * height - 0.5], axis=1)

    brightness, transmittance = np.zeros((height, width)), np.ones((height, width))
    done = np.zeros((height, width), bool)
    for i in np.argsort(depth, kind="stable"):
        if seen[i] and peak[i] >= LEAST_ALPHA:
            blend(at[i], np.linalg.inv(wide[i]), wide[i], peak[i], scene.grey[i], brightness, transmittance, done)
    return brightness.clip(0, 1)


def blend(at, conic, wide, peak, grey, brightness, transmittance, done):
    """One splat over what lies before it."""
    reach = np.sqrt(np.diag(wide) * 2 * math.log(peak / LEAST_ALPHA)) + 1
    height, width = brightness.shape
    x0, x1 = max(0, math.floor(at[0] - reach[0])), min(width, math.ceil(at[0] + reach[0]) + 1)
    y0, y1 = max(0, math.floor(at[1] - reach[1])), min(height, math.ceil(at[1] + reach[1]) + 1)
    if x0 >= x1 or y0 >= y1:
        return
    part = np.s_[y0:y1, x0:x1]
    dx, dy = np.arange(x0, x1) - at[0], (np.arange(y0, y1) - at[1])[:, None]
    power = -0.5 * (conic[0, 0] * dx * dx + conic[1, 1] * dy * dy) - conic[0, 1] * dx * dy
    alpha = np.minimum(MOST_ALPHA, peak * np.exp(power))
    drawn = (alpha >= LEAST_ALPHA) & ~done[part]
    left = transmittance[part] * (1 - alpha)
    done[part] |= drawn & (left < LEAST_TRANSMITTANCE)
    drawn &= ~done[part]
    brightness[part] += np.where(drawn, grey * alpha * transmittance[part], 0)
    transmittance[part] = np.where(drawn, left, transmittance[part])


# ---------------------------------------------------------------- views, pictures, scores

def views(scene):
    """Far, near and inside; radius and opacity at their defaults, below and above."""
    made = []
    for name, distance, azimuth, elevation, f_r, f_a in [
        ("far", 4.6, 30, 20, 1, 1), ("near", 2.2, 200, -35, 1, 1), ("inside", 0.5, 75, 10, 1, 1),
        ("large", 4.6, 120, 5, 2.5, 1), ("small", 3.5, 300, 50, 0.4, 1), ("faint", 4.0, 10, 0, 1, 0.3),
        ("dark", 4.0, 10, 0, 1, 3),
    ]:
        a, e = math.radians(azimuth), math.radians(elevation)
        direction = np.array([math.cos(e) * math.sin(a), math.sin(e), math.cos(e) * math.cos(a)])
        position = scene.center + distance / scene.scale * direction
        made.append({"name": name, "position": list(position), "focal_point": list(scene.center), "view_up": [0, 1, 0],
                     "radius": f_r * scene.radius, "opacity": min(f_a * scene.opacity, 1.0)})
    return {"width": 320, "height": 180, "fov_deg": 30.0, "views": made}


def read_png(path):
    """An 8-bit picture; grey, or the first of its channels."""
    with open(path, "rb") as f:
        data = f.read()
    at, packed = 8, b""
    while at < len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        content = data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack_from(">IIBB", content)
            assert depth == 8
            channels = {0: 1, 2: 3, 4: 2, 6: 4}[colour]
        packed += content if kind == b"IDAT" else b""
        at += 12 + length
    raw, stride = zlib.decompress(packed), width * channels
    above, rows = [0] * stride, []
    for y in range(height):
        kind, line = raw[y * (stride + 1)], list(raw[y * (stride + 1) + 1 : (y + 1) * (stride + 1)])
        for x in range(stride):
            left, corner = (line[x - channels], above[x - channels]) if x >= channels else (0, 0)
            line[x] = line[x] + predictor(kind, left, above[x], corner) & 255
        rows.append(line)
        above = line
    return np.array(rows).reshape(height, width, channels)[:, :, 0]


def predictor(kind, left, up, corner):
    if kind == 4:
        p = left + up - corner
        return min((left, up, corner), key=lambda v: abs(p - v))
    return (0, left, up, (left + up) // 2)[kind]


def compare(scene, path, folder):
    with open(path) as f:
        views_file = json.load(f)
    worst = math.inf
    for view in views_file["views"]:
        ours = 255 * draw(scene, view, views_file["width"], views_file["height"], views_file["fov_deg"])
        theirs = read_png(os.path.join(folder, view["name"] + ".png"))
        ours = np.floor(ours + 0.5)
        error = np.mean((ours - theirs) ** 2)
        decibels = 10 * math.log10(255**2 / error) if error else math.inf
        assert theirs.any(), f"{view['name']}: nothing is drawn"
        worst = min(worst, decibels)
        print(f"{view['name']:8} {decibels:6.2f} dB, largest difference {np.abs(ours - theirs).max():.0f} of 255,",
              f"mean grey {theirs.mean():.2f}")
    return worst


def main():
    command, model, path, *folder = sys.argv[1:]
    with open(model, "rb") as f:
        scene = Scene(pgs.read(f.read()))
    if command == "views":
        with open(path, "w") as f:
            json.dump(views(scene), f)
        return 0
    worst = compare(scene, path, folder[0])
    if worst < FLOOR_DB:
        print(f"error: {worst:.2f} dB is below {FLOOR_DB} dB")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
