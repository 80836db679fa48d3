"""Five disjoint regions of one new cosmological box by JaxPM, without periodicity, as five data sets.

OUT is the beginning of five names: OUT-1 ... OUT-5.
"""

from itertools import product

from common import Whole, arguments, command, packages, write_columns
from make_box import CODE, IS_NOT, LICENCE, SPACING, meta

# Five of the eight octants (x, y, z halves), in this order.
OCTANTS = list(product((0, 1), repeat=3))[:5]


def write_region(out, positions, octant, about, run):
    """Write the particles of one octant, in the box's coordinates and order, as a data set of its own."""
    half = about["box"] / 2
    low = [half * side for side in octant]
    inside = ((positions >= low) & (positions < [a + half for a in low])).all(axis=1)
    own = {key: value for key, value in about.items() if key not in ("box", "periodic", "order", "n_per_dim")}
    own |= {"whole_box": about["box"], "whole_n_per_dim": about["n_per_dim"]}
    own |= {"region": [low, [a + half for a in low]], "order": "Lagrangian, those outside left out"}
    with Whole(out) as data:
        write_columns(data.part, positions[inside], {"name": out.name, **own})
        data.describe(
            description=f"dark matter, an octant (edge {half:g} Mpc/h) of a box of {about['n_per_dim']}^3 particles, "
            "z = 0, by particle-mesh; no periodic box",
            particles=int(inside.sum()), box=None, periodic=False, unit="Mpc/h, comoving",
            parameters={key: own[key] for key in ("region", "redshift", "whole_box", "mesh", "steps", "step_rule")},
            is_not=IS_NOT.format(cell=about["mesh_cell"]) + "; its neighbours touch it, so large scales are shared",
            **run,
        )


def main():
    args = arguments(__doc__, [("--seed", {"type": int, "default": 2001})])
    n = 32 if args.quick else 160
    box = n * SPACING
    places = [args.out.with_name(f"{args.out.name}-{number}") for number in range(1, 6)]
    from gravity import simulate

    positions, _, steps = simulate(n, box, args.seed, 0.0)
    run = {
        "command": command(args.seed, quick=args.quick), "seed": args.seed,
        "code": {**packages(*CODE), "licence": LICENCE},
    }
    for place, octant in zip(places, OCTANTS):
        if not place.exists():
            write_region(place, positions, octant, meta(n, box, 0.0, args.seed, steps), run)


if __name__ == "__main__":
    main()
