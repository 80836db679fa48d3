"""A Lennard-Jones melt by LAMMPS: the classic benchmark (rho* = 0.8442), from a lattice to a liquid."""

from common import Whole, arguments, command, packages
from engine import start, thermo, write_dump

SEED = 87287


def run(engine, cells, steps, seed):
    """Melt a cube of `cells`^3 face-centred cells at T* = 3 initially, then hold it at T* = 1.5."""
    engine.commands_string(f"""
        units lj
        atom_style atomic
        lattice fcc 0.8442
        region box block 0 {cells} 0 {cells} 0 {cells}
        create_box 1 box
        create_atoms 1 box
        mass 1 1.0
        velocity all create 3.0 {seed} loop geom
        pair_style lj/cut 2.5
        pair_coeff 1 1 1.0 1.0 2.5
        neighbor 0.3 bin
        neigh_modify every 10 delay 0 check yes
        fix motion all nvt temp 1.5 1.5 0.5
        timestep 0.005
        thermo 100
        run {steps}
    """)


def main():
    args = arguments(__doc__, [("--seed", {"type": int, "default": SEED})])
    cells, steps = (10, 300) if args.quick else (50, 1200)
    with Whole(args.out) as data:
        engine = start()
        run(engine, cells, steps, args.seed)
        write_dump(engine, data.part / "melt.dump.gz", "id type x y z")
        low, high = engine.extract_box()[:2]
        data.describe(
            description="Lennard-Jones liquid at density 0.8442 and temperature 1.5 (reduced units), one frame",
            command=command(args.seed, quick=args.quick),
            code={**packages("lammps"), "licence": "GPL-2.0 (run, not bundled)"},
            seed=args.seed,
            particles=4 * cells**3,
            box=[b - a for a, b in zip(low, high)],
            periodic=True,
            unit="sigma",
            parameters={"steps": steps, "timestep": 0.005, "cutoff": 2.5, "temperature": thermo(engine, "temp")},
            is_not=f"no equilibrium study: {steps} steps from the lattice; one species; cut at 2.5 sigma without "
            "tail corrections; homogeneous, so that there is no structure above a few spacings",
        )


if __name__ == "__main__":
    main()
