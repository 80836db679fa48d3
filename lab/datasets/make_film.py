"""A crystal film that melts from its two surfaces, by LAMMPS: 100 frames of an XTC trajectory."""

from common import Whole, arguments, command, packages
from engine import flush, start, thermo

SEED = 52361
FRAMES, EVERY = 100, 50


def run(engine, folder, cells, settle, seed):
    """A film of `cells` face-centred cells with as much again of vacuum above it and below; heated from T* = 0.45 to 0.8."""
    x, y, z = cells
    engine.commands_string(f"""
        units lj
        atom_style atomic
        lattice fcc 0.95
        region box block 0 {x} 0 {y} {-z} {2 * z}
        create_box 1 box
        region film block 0 {x} 0 {y} 0 {z}
        create_atoms 1 region film
        mass 1 1.0
        velocity all create 0.9 {seed} loop geom
        pair_style lj/cut 2.5
        pair_coeff 1 1 1.0 1.0 2.5
        neighbor 0.3 bin
        neigh_modify every 10 delay 0 check yes
        fix motion all nvt temp 0.45 0.45 0.5
        timestep 0.005
        thermo 500
        run {settle}
        unfix motion
        fix motion all nvt temp 0.45 0.8 0.5
        dump frames all xtc {EVERY} {folder / "film.xtc"}
        dump_modify frames sort id
        run {(FRAMES - 1) * EVERY}
    """)


def main():
    args = arguments(__doc__, [("--seed", {"type": int, "default": SEED})])
    cells, settle = ((6, 6, 4), 100) if args.quick else ((32, 32, 14), 1000)
    with Whole(args.out) as data:
        engine = start()
        run(engine, data.part, cells, settle, args.seed)
        low, high = engine.extract_box()[:2]
        temperature = thermo(engine, "temp")
        flush()
        data.describe(
            description=f"Lennard-Jones film that melts from its surfaces, {FRAMES} frames",
            command=command(args.seed, quick=args.quick),
            code={**packages("lammps"), "licence": "GPL-2.0 (run, not bundled)"},
            seed=args.seed,
            particles=engine.get_natoms(),
            box=[b - a for a, b in zip(low, high)],
            periodic=True,
            unit="sigma",
            open=["film.xtc"],
            parameters={
                "frames": FRAMES, "steps_between": EVERY, "steps_before": settle, "timestep": 0.005, "cutoff": 2.5,
                "temperature": [0.45, temperature],
            },
            is_not="no equilibrium study: heated within 25 units of time; one element; cut at 2.5 sigma "
            "without tail corrections; positions rounded to 0.001 sigma; no velocities",
        )


if __name__ == "__main__":
    main()
