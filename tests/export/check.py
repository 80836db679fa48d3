#!/usr/bin/env python3
"""Holds what others' readers make of an exported model to the model (tests/export/run.sh):

    check.py PREFIX

PREFIX.info is what `particlegs info --json` says; PREFIX.npz, .csv, .npy with .json, .vti, .fits, .dx, .mrc, .ply.csv (the
PLY by splat-transform) and .glb.three, .gltf.three (glTF by three.js) what is looked at. Formulas are those of
docs/guide/export.md, by SciPy's functions.
"""
import csv
import json
import os
import sys

import numpy as np
from scipy.special import elliprf, expi

PREFIX = sys.argv[1]
INFO = json.load(open(PREFIX + ".info"))["metadata"]
ALPHA = INFO["law"] == "alpha-blend"


def close(what, got, want, tolerance):
    """The largest difference over the largest number is small."""
    got, want = np.asarray(got, float), np.asarray(want, float)
    assert got.shape == want.shape, f"{what}: {got.shape} is not {want.shape}"
    error = np.abs(got - want).max() / max(np.abs(want).max(), 1e-300)
    assert error <= tolerance, f"{what}: off by {error}"


def gaussians():
    """The archive, which holds everything, against what the program says of the model."""
    z = np.load(PREFIX + ".npz")
    n = len(z["count"])
    assert z["mean"].shape == (n, 3) and z["covariance"].shape == (n, 3, 3) and z["layer"].shape == (n,)
    assert (z["covariance"] == z["covariance"].transpose(0, 2, 1)).all()
    assert np.linalg.eigvalsh(z["covariance"]).min() >= -1e-9 * z["covariance"].max()
    assert z["count"].sum() == INFO["particles"], (z["count"].sum(), INFO["particles"])
    bounds = INFO["bounds"]
    spread = 0.05 * (np.array(bounds["max"]) - bounds["min"])
    assert (z["mean"] > bounds["min"] - spread).all() and (z["mean"] < bounds["max"] + spread).all()
    facts = json.loads(str(z["metadata"]))
    assert facts["gaussians"] == n and facts["particles"] == INFO["particles"] and facts["lost"], facts
    assert [layer["name"] for layer in facts["layers"]] == z["layer_names"].tolist()
    return z, facts


def table(z):
    """The table of text has the same numbers, every digit."""
    lines = [line for line in open(PREFIX + ".csv") if not line.startswith("#")]
    rows = list(csv.reader(lines))
    columns = dict(zip(rows[0], zip(*rows[1:])))
    own = {name.split(" [")[0]: column for name, column in columns.items()}
    mean = np.array([own[k] for k in "xyz"], float).T
    assert (mean == z["mean"]).all() and (np.array(own["count"], float) == z["count"]).all()
    for i, a in enumerate("xyz"):
        for j, b in list(enumerate("xyz"))[i:]:
            assert (np.array(own[f"covariance_{a}{b}"], float) == z["covariance"][:, i, j]).all()
    for name in ("mass", "opacity", "grey"):
        assert (name in own) == (name in z.files), name
        assert name not in own or (np.array(own[name], float) == z[name]).all(), name
    assert list(own["layer"]) == [z["layer_names"][i] for i in z["layer"]]
    if INFO["length_unit"]:
        assert f"x [{INFO['length_unit']}]" in columns, list(columns)


def splats(z):
    """Covariances and opacities of splats: those of the model, or the stated approximation."""
    if ALPHA:
        return z["covariance"], z["opacity"]
    r, a = INFO["default_radius"], INFO["default_opacity"]
    wide = z["covariance"] + r * r * np.eye(3)
    variances = np.linalg.eigvalsh(wide)
    share = 0.9973002039367398**2
    tau = z["count"] * share * a * r * r * elliprf(*(1 / variances.T)) / np.sqrt(variances.prod(axis=1))
    # Ein(x) = E1(x) + ln x + gamma, and E1(x) = -Ei(-x); over 1 - exp(-x) it is 1 for what is faint.
    large = np.maximum(tau, 1e-6)
    flatter = np.where(tau > 1e-6, (-expi(-large) + np.log(large) + np.euler_gamma) / -np.expm1(-large), 1)
    return wide * flatter[:, None, None], -np.expm1(-tau)


def ply(z, frame):
    """3-D Gaussian splatting's own numbers, as splat-transform reads them; y is down in the file."""
    rows = np.genfromtxt(PREFIX + ".ply.csv", delimiter=",", names=True)
    covariance, opacity = splats(z)
    place = np.stack([rows[k] for k in "xyz"], axis=1)
    down = np.array([-1, -1, 1])
    close("PLY places", down * place / frame["scale"] + frame["center"], z["mean"], 1e-6)
    close("PLY opacities", 1 / (1 + np.exp(-rows["opacity"])), opacity, 1e-6)
    w, x, y, q = (rows[f"rot_{k}"] for k in range(4))
    close("PLY turns", w * w + x * x + y * y + q * q, np.ones(len(rows)), 1e-6)
    turn = np.array([
        [1 - 2 * (y * y + q * q), 2 * (x * y - w * q), 2 * (x * q + w * y)],
        [2 * (x * y + w * q), 1 - 2 * (x * x + q * q), 2 * (y * q - w * x)],
        [2 * (x * q - w * y), 2 * (y * q + w * x), 1 - 2 * (x * x + y * y)],
    ]).transpose(2, 0, 1)
    scale = np.exp(np.stack([rows[f"scale_{k}"] for k in range(3)], axis=1)) / frame["scale"]
    turn = down[:, None] * turn
    close("PLY covariances", (turn * scale[:, None, :] ** 2) @ turn.transpose(0, 2, 1), covariance, 1e-5)
    return np.stack([0.5 + 0.28209479177387814 * rows[f"f_dc_{k}"] for k in range(3)], axis=1)


def gltf(z, name, colors):
    """What three.js makes of the extension's attributes."""
    read = json.load(open(f"{PREFIX}.{name}.three"))
    extras = read["asset"]["extras"]
    assert extras["lost"] and extras["particles"] == INFO["particles"]
    column = lambda key, width: np.concatenate([np.reshape(l[key], (-1, width)) for l in read["layers"]])
    covariance, opacity = splats(z)
    close(f"{name} places", column("position", 3) / extras["scale"] + extras["center"], z["mean"], 1e-6)
    rows = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
    want = np.stack([covariance[:, i, j] for i, j in rows], axis=1) * extras["scale"] ** 2
    close(f"{name} covariances", column("covariance", 6), want, 1e-5)
    # In bytes.
    got, want = column("color", 4), np.column_stack([colors, opacity]).clip(0, 1) * 255
    assert np.abs(got - want).max() < 0.51, f"{name} colours: off by {np.abs(got - want).max()}"
    assert [l["name"] for l in read["layers"]] == z["layer_names"].tolist()
    assert read["vertices"] == len(z["count"])


def grids(z):
    """One density in three formats, and what it sums to."""
    import vtk
    from astropy import units
    from astropy.io import fits
    from astropy.wcs import WCS
    from vtk.util.numpy_support import vtk_to_numpy

    values = np.load(PREFIX + ".npy")
    facts = json.load(open(PREFIX + ".json"))
    grid = facts["density"]
    assert list(values.shape) == grid["cells"] and values.dtype == np.float32
    side, origin = np.array(grid["cell"]), np.array(grid["origin"])
    mass = z["mass"] if "mass" in z.files else z["count"]
    total = values.sum(dtype=float) * side.prod()
    close("total of the grid and beyond", total + grid["outside"], mass.sum(), 2e-6)
    assert grid["outside"] == 0 or not all(grid["periodic"])
    # Middle of the mass, of the cells and of the Gaussians; around a periodic box by phases.
    for k in range(3):
        line = values.sum(axis=tuple(a for a in range(3) if a != k), dtype=float)
        phase = 2j * np.pi / (side[k] * values.shape[k])
        cells = (line * np.exp(phase * (origin[k] + side[k] * (0.5 + np.arange(len(line)))))).sum() / line.sum()
        damped = np.exp(-0.5 * np.abs(phase) ** 2 * z["covariance"][:, k, k])
        own = (mass * damped * np.exp(phase * z["mean"][:, k])).sum() / mass.sum()
        if all(grid["periodic"]):
            assert abs(cells - own) < 0.5 * side[k] * abs(phase), f"middle along {k}: {cells}, {own}"

    maps(values, origin, side)
    reader = vtk.vtkXMLImageDataReader()
    reader.SetFileName(PREFIX + ".vti")
    reader.Update()
    image = reader.GetOutput()
    assert image.GetDimensions() == tuple(n + 1 for n in values.shape)
    close("VTI bounds", np.reshape(image.GetBounds(), (3, 2)).T, [origin, origin + side * values.shape], 1e-12)
    cells = vtk_to_numpy(image.GetCellData().GetArray("density")).reshape(values.shape[::-1])
    assert (cells.T == values).all()
    field = image.GetFieldData()
    assert field.GetAbstractArray("unit").GetValue(0) == grid["unit"]
    assert "lost: " in field.GetAbstractArray("notes").GetValue(0)
    close("VTI total", field.GetArray("total").GetValue(0), grid["total"], 1e-12)

    with fits.open(PREFIX + ".fits") as hdus:
        hdus.verify("exception")
        head, data = hdus[0].header, hdus[0].data
        assert "lost: " in str(head["COMMENT"])
        # Units are the standard's where h and the unit of mass are known, and none where they are not.
        length, h = INFO["length_unit"] or "", INFO["hubble"]
        known = length and (h is not None or "/h" not in length) and not grid["unit"].startswith("mass /")
        assert ("BUNIT" in head) == ("CUNIT1" in head) == bool(known), length
        if known:
            units.Unit(head["BUNIT"], format="fits")
        by_h = 1.0 / h if known and "/h" in length else 1.0
        mass = head["TOTAL"] / grid["total"]
        first = WCS(head).all_pix2world([[0, 0, 0]], 0)[0]
        # astropy turns what it knows into metres.
        factor = WCS(head).wcs.cunit[0].to(length.removesuffix("/h")) if known else 1.0
        close("FITS first cell", first * factor, (origin + side / 2) * by_h, 1e-9)
        close("FITS values", data.T * by_h**3 / mass, values, 1e-6)
        # Fields: the same in both, with sums of the Gaussians' own where no Gaussian lies beyond the grid.
        for field in [f["name"] for f in INFO["kept"] if f["name"] not in ("positions", "masses")]:
            for kind in (field, f"dispersion_{field}"):
                array = vtk_to_numpy(image.GetCellData().GetArray(kind))
                components = array.reshape(len(array), -1).T
                names = [kind] if len(components) == 1 else [f"{kind}_{axis}" for axis in "xyz"]
                for name, own in zip(names, components):
                    np.testing.assert_array_equal(hdus[name].data.ravel(), own)
                    assert WCS(hdus[name].header).wcs.crval[0] == WCS(head).wcs.crval[0]


def maps(values, origin, side):
    """Points at the middles of cells, in Angstrom where lengths are in nm."""
    import mrcfile
    from gridData import Grid

    scale = 10.0 if INFO["length_unit"] == "nm" else 1.0
    first, side = scale * (origin + side / 2), scale * side
    for name in ("dx", "mrc"):
        grid = Grid(f"{PREFIX}.{name}")
        close(f"{name} values", grid.grid, values / scale**3, 1e-6)
        close(f"{name} origin", grid.origin, first, 1e-6)
        close(f"{name} cells", np.diag(grid.delta) if grid.delta.ndim > 1 else grid.delta, side, 1e-6)
    assert mrcfile.validate(PREFIX + ".mrc")
    with mrcfile.open(PREFIX + ".mrc") as mrc:
        assert (mrc.data.T == grid.grid).all() and "lost: " in "".join(label.decode() for label in mrc.header.label)
        close("MRC mean", [mrc.header.dmean, mrc.header.rms], [mrc.data.mean(dtype=float), mrc.data.std(dtype=float)], 1e-5)


def main():
    z, facts = gaussians()
    table(z)
    frame = json.load(open(PREFIX + ".glb.three"))["asset"]["extras"]
    colors = ply(z, {"scale": frame["scale"], "center": np.array(frame["center"])})
    for name in ("glb", "gltf"):
        gltf(z, name, colors)
    if not ALPHA:
        assert facts["layers"][1:] or (colors == 1).all() or np.abs(colors - 1).max() < 1e-6
        grids(z)
    print(f"{os.path.basename(PREFIX)}: {len(z['count'])} Gaussians in every format, as the model has them")


main()
