"""numpy's and scipy's statistics of 600 points in a periodic slab: the fixture of src/stats/tests.rs.

python3 scripts/stats_scipy.py > crates/particlegs-measure/tests/fixtures/stats_scipy.json
"""

import json
import sys

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

r = np.random.default_rng(7)
L = np.array([2.0, 5.0, 3.0])
centers = r.random((30, 3)) * L
x = np.concatenate([centers[r.integers(30, size=400)] + 0.05 * r.standard_normal((400, 3)), r.random((200, 3)) * L])
x = np.mod(x, L).astype("<f4")
x = np.minimum(x, np.nextafter(L.astype("f4"), np.float32(0)))
X, N, V = x.astype(float), len(x), L.prod()
out = {"length": L.tolist(), "positions": [float(np.format_float_positional(v, unique=True)) for v in x.ravel()]}

# Neighbours: pairs by separation (ordered), nearest distances, groups.
tree = cKDTree(X, boxsize=L)
edges = [0.02, 0.05, 0.1, 0.2, 0.4, 0.8]
within = [tree.count_neighbors(tree, e) for e in edges]
out["pair_edges"] = edges
out["pairs"] = [int(b - a) for a, b in zip(within, within[1:])]
nearest = tree.query(X, k=2)[0][:, 1]
out["nearest_mean"], out["nearest_median"] = nearest.mean(), float(np.median(nearest))
out["linking"] = 0.4
links = tree.query_pairs(0.4 * (V / N) ** (1 / 3), output_type="ndarray")
_, label = connected_components(coo_matrix((np.ones(len(links)), links.T), shape=(N, N)), directed=False)
out["groups"] = sorted([int(v) for v in np.bincount(label) if v >= 3], reverse=True)

# Densities on cells of 1/4: CIC by hand, NGP by histogramdd.
n = np.array([8, 20, 12])
u = X / (L / n) - 0.5
i = np.floor(u).astype(int)
f = u - i
cic = np.zeros(n)
for a in range(8):
    o = np.array([a >> 2 & 1, a >> 1 & 1, a & 1])
    np.add.at(cic, tuple(((i + o) % n).T), np.where(o, f, 1 - f).prod(1))
ngp, _ = np.histogramdd(X, bins=n, range=[(0, l) for l in L])
a, b = cic / cic.mean() - 1, ngp / ngp.mean() - 1
out["cic_variance"], out["ngp_variance"] = float(a.var()), float(b.var())
out["cic_ngp_correlation"] = float(np.corrcoef(a.ravel(), b.ravel())[0, 1])

# P(k) of the CIC density, its window divided out, in shells of 2 pi / longest edge.
m = np.stack(np.meshgrid(*[np.fft.fftfreq(c, 1 / c) for c in n], indexing="ij"), -1)
power = np.abs(np.fft.fftn(a) / a.size / np.prod(np.sinc(m / n), -1) ** 2) ** 2 * V
k = np.sqrt(((2 * np.pi * m / L) ** 2).sum(-1))
width, k_max = 2 * np.pi / L.max(), 10.0
kept = (np.abs(m) < n / 2).all(-1) & (k > 0) & (k <= k_max)
shell = np.maximum(np.floor(k / width - 0.5), 0).astype(int)
out["k_max"], out["power"] = k_max, []
for s in range(int(k_max / width + 0.5)):
    inside = kept & (shell == s)
    if inside.any():
        out["power"].append([float(k[inside].mean()), int(inside.sum()), float(power[inside].mean())])

out["moments"] = []
for axis in range(3):
    z = (X[:, axis] - X[:, axis].mean()) / X[:, axis].std()
    out["moments"].append([X[:, axis].mean(), X[:, axis].std(), float((z**3).mean()), float((z**4).mean())])
json.dump(out, sys.stdout)
