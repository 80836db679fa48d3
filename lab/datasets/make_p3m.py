"""A run of 16 snapshots with short-range forces, by JaxPM's 2LPT and a particle-particle particle-mesh code of ours.

Goes on where it was cut off: OUT.state keeps the snapshots that are done, and the particles every fifth step.
"""

import shutil

import h5py
import numpy as np
from common import Whole, arguments, command, packages

SPACING = 100.0 / 128  # Mpc/h
SNAPSHOTS = 16
FIRST = 0.2  # scale factor of the first snapshot
CODE = ("jaxpm", "jax", "jaxlib", "jax-cosmo", "jaxdecomp", "numba", "llvmlite", "scipy", "numpy", "h5py")
LICENCE = "this project's; MIT (JaxPM, jax-cosmo, jaxDecomp), Apache-2.0 (JAX), BSD (numba, llvmlite, scipy, numpy, h5py)"
IS_NOT = (
    "no tree: one step for all particles, {steps} of them, so that halo centres are limited by steps as well as by the "
    "softening of {softening:.4f} Mpc/h; one realisation of a small box; no hydrodynamics"
)


def times(start, coarse):
    """Scale factors of all steps, and numbers of the steps at whose ends snapshots are written."""
    early = int(np.ceil(np.log(FIRST / start) / (0.06 * coarse)))
    between = int(np.ceil(9 / coarse))
    late = np.linspace(FIRST, 1.0, (SNAPSHOTS - 1) * between + 1)
    a = np.concatenate([np.geomspace(start, FIRST, early + 1)[:-1], late])
    return a, [early + between * i for i in range(SNAPSHOTS)]


def write_snapshot(path, place, momentum, a, box):
    """A snapshot as Gadget writes HDF5: lengths in Mpc/h, velocities over the root of a, in the lattice's order."""
    from gravity import COSMOLOGY, within

    count, n = len(place), round(len(place) ** (1 / 3))
    numbers = np.array([0, count, 0, 0, 0, 0], "u4")
    mass = 27.7536627 * COSMOLOGY["Omega_m"] * (box / n) ** 3
    header = {
        "NumPart_ThisFile": numbers, "NumPart_Total": numbers, "NumPart_Total_HighWord": np.zeros(6, "u4"),
        "MassTable": np.array([0, mass, 0, 0, 0, 0]), "Time": a, "Redshift": 1 / a - 1, "BoxSize": box,
        "NumFilesPerSnapshot": 1, "Omega0": COSMOLOGY["Omega_m"], "OmegaLambda": COSMOLOGY["Omega_L"],
        "HubbleParam": COSMOLOGY["h"],
    }
    units = {"UnitLength_in_cm": 3.085678e24, "UnitMass_in_g": 1.989e43, "UnitVelocity_in_cm_per_s": 1e5}
    part = path.with_suffix(".part")
    with h5py.File(part, "w", libver="earliest", track_order=False) as file:
        file.create_group("Header").attrs.update(header)
        file.create_group("Units").attrs.update(units)
        group = file.create_group("PartType1")
        group["Coordinates"] = within(place.astype(np.float64) * (box / n), box).astype("f4")
        # a dx/dt in km/s is the momentum times 100 box / (n a).
        group["Velocities"] = (momentum * (100 * box / n / a**1.5)).astype("f4")
        group["ParticleIDs"] = np.arange(1, count + 1, dtype="u4")
    part.rename(path)


def run(state, n, box, seed, coarse, threads):
    """Write the snapshots into the folder `state`; the number of steps."""
    import numba
    from gravity import START, initial
    from p3m import advance, forces, places

    numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))
    a, outputs = times(START, coarse)
    lattice = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), -1).reshape(-1, 3)
    checkpoint = state / "state.npz"
    if checkpoint.exists():
        with np.load(checkpoint) as saved:
            first, moved, momentum, force = (saved[key] for key in ("step", "moved", "momentum", "force"))
    else:
        first = 0
        moved, momentum = (np.asarray(part, np.float32).reshape(-1, 3) for part in initial(n, box, seed))
        force = forces(places(lattice, moved, n), n, threads)
    particles = moved, momentum, force
    for step in range(int(first), len(a) - 1):
        particles = advance(particles, lattice, n, a[step], a[step + 1], threads)
        if step + 1 in outputs:
            path = state / f"p3m_{outputs.index(step + 1):03d}.hdf5"
            write_snapshot(path, places(lattice, particles[0], n), particles[1], a[step + 1], box)
        if (step + 1) % 5 == 0:
            part = state / "part.npz"
            np.savez(part, step=step + 1, **dict(zip(("moved", "momentum", "force"), particles)))
            part.rename(checkpoint)
            print(f"step {step + 1} of {len(a) - 1}, a = {a[step + 1]:.4f}", flush=True)
    return len(a) - 1


def main():
    args = arguments(__doc__, [
        ("--seed", {"type": int, "default": 3001}),
        ("--threads", {"type": int, "default": 2, "help": "threads; the bytes are the same for any number"}),
    ])
    n, coarse = (32, 4) if args.quick else (128, 1)
    box = n * SPACING
    state = args.out.with_name(args.out.name + ".state")
    with Whole(args.out) as data:
        state.mkdir(exist_ok=True)
        steps = run(state, n, box, args.seed, coarse, args.threads)
        for path in sorted(state.glob("p3m_*.hdf5")):
            shutil.copy(path, data.part)
        from p3m import FINER, REACH, SOFTENING, SPLIT

        last = f"p3m_{SNAPSHOTS - 1:03d}.hdf5"
        data.describe(
            description=f"dark matter, {n}^3 particles, periodic box of {box:g} Mpc/h, {SNAPSHOTS} snapshots from "
            f"a = {FIRST:g} to 1, with short-range forces, velocities and IDs",
            command=command(args.seed, quick=args.quick),
            code={**packages(*CODE), "licence": LICENCE},
            seed=args.seed, particles=n**3, box=[box] * 3, periodic=True, unit="Mpc/h, comoving", open=[last],
            parameters={
                "z_start": 1 / 0.03 - 1, "ic": "2LPT, Eisenstein-Hu no-wiggle", "force": "P3M", "mesh": n * FINER,
                "split_mesh_cells": SPLIT, "pairs_reach_splits": REACH, "softening_plummer": SOFTENING * SPACING,
                "steps": steps, "scale_factors": [round(FIRST + (1 - FIRST) * i / (SNAPSHOTS - 1), 6) for i in range(SNAPSHOTS)],
            },
            is_not=IS_NOT.format(steps=steps, softening=SOFTENING * SPACING),
        )
    shutil.rmtree(state)


if __name__ == "__main__":
    main()
