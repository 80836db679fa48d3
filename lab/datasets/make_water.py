"""Water (SPC/E) at constant pressure by LAMMPS: 100 frames of an XTC trajectory, and the topology as a data file."""

import numpy as np
from common import Whole, arguments, command, packages
from engine import flush, start, thermo

SEED = 40417
APART = 3.1  # Angstrom between the lattice's molecules: 1 g/cm3
FRAMES, EVERY = 100, 50
BOND, ANGLE = 1.0, 109.47


def lattice(side, seed):
    """Positions (N, 3, 3) of O, H, H: molecules of a cubic lattice, each turned at random."""
    random = np.random.default_rng(seed)
    half = np.radians(ANGLE / 2)
    shape = np.array([[0, 0, 0], [np.sin(half), np.cos(half), 0], [-np.sin(half), np.cos(half), 0]]) * BOND
    turns = np.linalg.qr(random.normal(size=(side**3, 3, 3)))[0]
    places = np.stack(np.meshgrid(*[(np.arange(side) + 0.5) * APART] * 3, indexing="ij"), -1).reshape(-1, 1, 3)
    return places + shape @ turns


def write_topology(path, molecules, edge):
    """The start as a data file of LAMMPS, atom style full."""
    count = len(molecules)
    lines = [
        "water\n", f"{3 * count} atoms", f"{2 * count} bonds", f"{count} angles", "2 atom types", "1 bond types",
        "1 angle types\n", *(f"0 {edge} {axis}lo {axis}hi" for axis in "xyz"), "\nMasses\n", "1 15.9994 # O",
        "2 1.008 # H", "\nAtoms # full\n",
    ]
    for i, molecule in enumerate(molecules):
        for j, (x, y, z) in enumerate(molecule):
            charge, kind = (0.4238, 2) if j else (-0.8476, 1)
            lines.append(f"{3 * i + j + 1} {i + 1} {kind} {charge} {x:.6f} {y:.6f} {z:.6f}")
    lines.append("\nBonds\n")
    lines += [f"{2 * i + j} 1 {3 * i + 1} {3 * i + 1 + j}" for i in range(count) for j in (1, 2)]
    lines.append("\nAngles\n")
    lines += [f"{i + 1} 1 {3 * i + 2} {3 * i + 1} {3 * i + 3}" for i in range(count)]
    path.write_text("\n".join(lines) + "\n")


def run(engine, folder, side, settle, seed):
    """Settle the lattice at 300 K and 1 bar, then write the frames."""
    write_topology(folder / "water.data", lattice(side, seed), side * APART)
    engine.commands_string(f"""
        units real
        atom_style full
        pair_style lj/cut/coul/long 9.0
        bond_style harmonic
        angle_style harmonic
        kspace_style pppm 1e-4
        read_data {folder / "water.data"}
        pair_coeff 1 1 0.1553 3.166
        pair_coeff * 2 0.0 0.0
        bond_coeff 1 0.0 {BOND}
        angle_coeff 1 0.0 {ANGLE}
        neigh_modify every 1 delay 4 check yes
        velocity all create 300.0 {seed} dist gaussian loop geom
        fix rigid all shake 1e-4 100 0 b 1 a 1
        fix motion all npt temp 300.0 300.0 100.0 iso 1.0 1.0 1000.0
        timestep 2.0
        thermo 500
        run {settle}
        dump frames all xtc {EVERY} {folder / "water.xtc"}
        dump_modify frames sort id
        run {(FRAMES - 1) * EVERY}
    """)


def main():
    args = arguments(__doc__, [("--seed", {"type": int, "default": SEED})])
    side, settle = (6, 100) if args.quick else (16, 2000)
    with Whole(args.out) as data:
        engine = start()
        run(engine, data.part, side, settle, args.seed)
        low, high = engine.extract_box()[:2]
        temperature, density = thermo(engine, "temp"), thermo(engine, "density")
        flush()
        data.describe(
            description=f"water (SPC/E), {side**3} molecules at 300 K and 1 bar, {FRAMES} frames",
            command=command(args.seed, quick=args.quick),
            code={**packages("lammps"), "licence": "GPL-2.0 (run, not bundled)"},
            seed=args.seed,
            particles=3 * side**3,
            box=[round((b - a) / 10, 4) for a, b in zip(low, high)],
            periodic=True,
            unit="nm",
            open=["water.xtc"],
            parameters={
                "frames": FRAMES, "steps_between": EVERY, "steps_before": settle, "timestep_fs": 2.0, "cutoff_A": 9.0,
                "long_range": "PPPM", "temperature": temperature, "density_g_cm3": density,
            },
            is_not=f"no equilibrium study: {settle} steps from a lattice, {(FRAMES - 1) * EVERY * 2 / 1000:g} ps of frames; "
            "positions rounded to 0.001 nm; no velocities",
        )


if __name__ == "__main__":
    main()
