"""A periodic cosmological box by an independent particle-mesh code, JaxPM."""

from common import Whole, arguments, command, packages, write_columns

SPACING = 50.0 / 128  # Mpc/h, that of nbody128: the same mass a particle
CODE = ("jaxpm", "jax", "jaxlib", "jax-cosmo", "jaxdecomp", "numpy")
LICENCE = "MIT (JaxPM, jax-cosmo, jaxDecomp), Apache-2.0 (JAX)"
IS_NOT = (
    "no short-range forces: the mesh (cell {cell:.3f} Mpc/h) softens gravity below some two cells, so that haloes "
    "are too diffuse and small ones are missing; about 60 time steps; no hydrodynamics; not the reference code's "
    "numbers, though its cosmology and mass resolution"
)


def meta(n, box, redshift, seed, steps):
    """meta.json of a whole box, by the names that nbody128 has."""
    from gravity import COSMOLOGY, FINER, START

    return {
        "n_per_dim": n, "redshift": redshift, "z_start": 1 / START - 1, "ic": "2LPT, Eisenstein-Hu no-wiggle",
        "seed": seed, **COSMOLOGY, "mesh": n * FINER, "mesh_cell": box / n / FINER, "force": "PM",
        "steps": steps, "step_rule": "da=min(0.12*a,0.018)", "order": "Lagrangian lattice, index=(i*n+j)*n+k",
        "particle_mass_Msun_h": 2.77536627e11 * COSMOLOGY["Omega_m"] * (box / n) ** 3,
        "box": box, "periodic": True, "length_unit": "Mpc/h", "comoving": True,
    }


def main():
    args = arguments(__doc__, [
        ("--seed", {"type": int, "default": 1001}),
        ("--redshift", {"type": float, "default": 0.0}),
        ("--velocities", {"action": "store_true", "help": "write peculiar velocities in km/s, too"}),
    ])
    n = 32 if args.quick else 128
    box = n * SPACING
    with Whole(args.out) as data:
        from gravity import simulate

        positions, velocities, steps = simulate(n, box, args.seed, args.redshift)
        about = meta(n, box, args.redshift, args.seed, steps)
        write_columns(data.part, positions, {"name": args.out.name, **about}, velocities if args.velocities else None)
        data.describe(
            description=f"dark matter, {n}^3 particles, periodic box of {box:g} Mpc/h, z = {args.redshift:g}, "
            "by particle-mesh",
            command=command(args.seed, redshift=args.redshift, velocities=args.velocities, quick=args.quick),
            code={**packages(*CODE), "licence": LICENCE},
            seed=args.seed, particles=n**3, box=[box] * 3, periodic=True, unit="Mpc/h, comoving",
            parameters={key: about[key] for key in ("redshift", "z_start", "ic", "mesh", "steps", "step_rule")},
            is_not=IS_NOT.format(cell=about["mesh_cell"]),
        )


if __name__ == "__main__":
    main()
