"""A box that Abacus simulated, as columns, and the centres of its CompaSO haloes of 300 particles and more.

FOLDER has ASDF files of one redshift at any depth: particles (pack9, or the subsamples rv) and halo_info, read by
abacusutils; or columns xx.f32 ... vz.f32 with meta.json and haloes.csv (x, y, z, particles).
"""

import json
from pathlib import Path

import numpy as np
from common import Whole, arguments, command, fail, write_columns

LEAST = 300


def of_columns(folder):
    """Positions, velocities, meta.json, centres and numbers of particles of haloes."""
    columns = [np.fromfile(folder / f"{name}.f32", "<f4") for name in ("xx", "yy", "zz", "vx", "vy", "vz")]
    haloes = np.genfromtxt(folder / "haloes.csv", delimiter=",", names=True)
    meta = json.loads((folder / "meta.json").read_text())
    centres = np.stack([haloes[axis] for axis in "xyz"], 1)
    return np.stack(columns[:3], 1), np.stack(columns[3:], 1), meta, centres, haloes["particles"]


def of_asdf(folder):
    """The same of Abacus's own files, in which 0 is the box's middle."""
    import asdf
    from abacusnbody.data.read_abacus import read_asdf

    files, haloes = sorted(folder.rglob("*.pack9.asdf")), sorted(folder.rglob("halo_info_*.asdf"))
    files = files or sorted(folder.rglob("*_rv_[AB]_*.asdf"))
    if not (files and haloes):
        fail(f"{folder} has no {'halo_info' if files else 'pack9 or rv'} files: name the folder above both")
    tables = [read_asdf(str(path), load=["pos", "vel"], verbose=False) for path in files]
    header, centres, numbers = tables[0].meta, [], []
    for path in haloes:
        with asdf.open(path) as file:
            centres.append(np.array(file["data"]["x_com"], np.float64) * header["BoxSize"])
            numbers.append(np.array(file["data"]["N"]))
    meta = {
        "box": header["BoxSize"], "periodic": True, "length_unit": "Mpc/h", "comoving": True,
        "a": 1 / (1 + header["Redshift"]), "h": header["H0"] / 100, "omega_matter": header["Omega_M"],
        "omega_lambda": header["Omega_DE"], "particle_mass_Msun_h": header["ParticleMassHMsun"],
    }
    joined = [np.concatenate([table[name] for table in tables]) for name in ("pos", "vel")]
    return *joined, meta, np.concatenate(centres), np.concatenate(numbers)


def main():
    args = arguments(__doc__, [("--from", {"dest": "folder", "metavar": "FOLDER", "type": Path, "required": True})])
    is_columns = (args.folder / "haloes.csv").exists()
    with Whole(args.out) as data:
        positions, velocities, meta, centres, numbers = (of_columns if is_columns else of_asdf)(args.folder)
        box = meta["box"]
        positions, centres = np.mod(positions, box), np.mod(centres, box)[numbers >= LEAST]
        positions[positions >= box] = 0  # what rounds to the box
        write_columns(data.part, positions, {**meta, "name": args.out.name}, velocities)
        np.savetxt(data.part / "centres.csv", centres, "%.6f", ",", header="x,y,z", comments="")
        data.describe(
            description=f"dark matter of Abacus, {len(positions)} particles, periodic box of {box:g} Mpc/h, "
            f"z = {1 / meta['a'] - 1:.3g}; {len(centres)} centres of CompaSO haloes of {LEAST} particles and more",
            command=command(**{"from": "FOLDER"}),
            code={"abacus": "of others", "licence": "test data of abacusutils: GPL-3 (not bundled)"},
            particles=len(positions), box=[box] * 3, periodic=True, unit="Mpc/h, comoving", parameters=meta,
            is_not="not ours; the test box of abacusutils is small, of 64^3 particles, and no science run",
        )


if __name__ == "__main__":
    main()
