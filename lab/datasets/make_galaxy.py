"""A disc galaxy with bulge, halo, satellites and streams, drawn from analytic profiles in numpy.

One HDF5 file of Gadget's layout: PartType1 halo, PartType2 disc, PartType3 bulge, PartType4 satellites and
streams, one mass each. Lengths in kpc, masses in 1e10 Msun, velocities in km/s.
"""

import h5py
import numpy as np

from common import Whole, arguments, command, packages

SEED = 4711
G = 43007.1  # kpc (km/s)^2 / 1e10 Msun
DISC = {"mass": 4.5, "scale": 2.8, "height": 0.30, "edge": 25.0, "arms": 0.35, "pitch": 15.0}
BULGE = {"mass": 1.0, "scale": 0.55, "edge": 12.0}
HALO = {"mass": 100.0, "scale": 18.0, "edge": 205.0}
# Plummer satellites: distance from the centre (kpc), mass (1e10 Msun), scale (kpc).
SATELLITES = [(38, 0.10, 0.7), (52, 0.30, 1.2), (70, 0.05, 0.5), (88, 0.15, 0.9),
              (105, 0.02, 0.35), (130, 0.08, 0.6), (150, 0.03, 0.4), (175, 0.20, 1.0)]
# Streams: a progenitor's first distance, its mass, scale and share of the circular speed there.
STREAMS = [(28, 0.10, 0.4, 0.75), (45, 0.20, 0.6, 0.60)]
COUNTS = {"halo": 600_000, "disc": 600_000, "bulge": 150_000, "satellites": 120_000}  # streams: by their mass
QUICK = 100  # a quick galaxy has this many times fewer particles
GIGAYEARS, STEPS = 3.0, 1500  # of the streams


def directions(count, rng):
    """Unit vectors (count, 3), uniform on the sphere."""
    z = rng.uniform(-1, 1, count)
    angle = rng.uniform(0, 2 * np.pi, count)
    flat = np.sqrt(1 - z * z)
    return np.column_stack([flat * np.cos(angle), flat * np.sin(angle), z])


def inverse(mass, edge, count, rng, low=1e-4):
    """Radii drawn from a cumulative mass profile, by a table from `low` to `edge`, finer inside."""
    radii = np.concatenate([[0.0], np.geomspace(low, edge, 4096)])
    return np.interp(rng.uniform(0, mass(edge), count), mass(radii), radii)


def hernquist(r, mass, scale):
    """Mass within r (Hernquist 1990)."""
    return mass * r**2 / (r + scale) ** 2


def nfw(r):
    """Mass of the halo within r (Navarro, Frenk, White 1997), HALO's mass at its edge."""
    shape = lambda x: np.log1p(x) - x / (1 + x)
    return HALO["mass"] * shape(np.minimum(r, HALO["edge"]) / HALO["scale"]) / shape(HALO["edge"] / HALO["scale"])


def exponential(r):
    """Mass of the exponential disc within a cylinder of radius r."""
    x = r / DISC["scale"]
    return DISC["mass"] * (1 - (1 + x) * np.exp(-x))


def enclosed(r):
    """Mass that pulls at r, the disc taken as if it were round: for circular speeds and the streams."""
    return nfw(r) + exponential(r) + hernquist(r, BULGE["mass"], BULGE["scale"])


def circular(r):
    """Circular speed at r in km/s."""
    return np.sqrt(G * enclosed(r) / r)


def disc(count, rng):
    """Exponential in radius, sech^2 in height, two logarithmic arms; positions and velocities of rotation."""
    r = inverse(exponential, DISC["edge"], count, rng)
    z = DISC["height"] * np.arctanh(rng.uniform(-1, 1, count))
    ridge = np.log(np.maximum(r, 0.1) / DISC["scale"]) / np.tan(np.radians(DISC["pitch"]))
    strength = DISC["arms"] * np.clip(r / DISC["scale"] - 0.5, 0, 1)
    angle = start = rng.uniform(0, 2 * np.pi, count)
    for _ in range(20):  # solves angle + s/2 sin(2 (angle - ridge)) = start, which has the density 1 + s cos
        angle = start - 0.5 * strength * np.sin(2 * (angle - ridge))
    positions = np.column_stack([r * np.cos(angle), r * np.sin(angle), z])
    speed = circular(np.maximum(r, 1e-3))
    turning = np.column_stack([-np.sin(angle), np.cos(angle), np.zeros(count)]) * speed[:, None]
    return positions, turning + rng.normal(0, 20, (count, 3))


def rounded(mass, edge, count, rng):
    """A sphere of a cumulative mass profile; velocities isotropic, of dispersion v_c / sqrt(2) (an estimate)."""
    r = inverse(mass, edge, count, rng)
    spread = circular(np.maximum(r, 1e-2)) / np.sqrt(2)
    return directions(count, rng) * r[:, None], rng.normal(size=(count, 3)) * spread[:, None]


def plummer(count, scale, rng):
    """Positions of a Plummer (1911) sphere, cut at ten scales."""
    share = rng.uniform(0, (100 / 101) ** 1.5, count)
    r = scale / np.sqrt(share ** (-2 / 3) - 1)
    return directions(count, rng) * r[:, None]


def satellites(count, rng):
    """Plummer spheres on circular speeds about the galaxy, particles shared by mass."""
    masses = np.array([mass for _, mass, _ in SATELLITES])
    shares = np.floor(count * masses / masses.sum()).astype(int)
    shares[-1] += count - shares.sum()
    places, speeds = [], []
    for (distance, mass, scale), share in zip(SATELLITES, shares):
        at = directions(1, rng)[0]
        across = np.cross(at, directions(1, rng)[0])
        across *= circular(distance) / np.linalg.norm(across)
        inner = np.sqrt(G * mass / scale / 6)
        places.append(at * distance + plummer(share, scale, rng))
        speeds.append(across + rng.normal(0, inner, (share, 3)))
    return np.concatenate(places), np.concatenate(speeds)


def pull(x):
    """Acceleration at positions (N, 3), (km/s)^2 / kpc."""
    r = np.sqrt((x * x).sum(axis=1) + 0.01)
    return -(G * enclosed(r) / r**3)[:, None] * x


def stream(count, first, rng):
    """Test particles let go at the tidal radius of a progenitor along its orbit, followed to the end.

    Leapfrog in the galaxy's round potential; the progenitor's own gravity is left out.
    """
    distance, mass, scale, share = first
    dt = GIGAYEARS / 0.9778 / STEPS  # kpc / (km/s)
    at = directions(1, rng)[0]
    across = np.cross(at, directions(1, rng)[0])
    x = np.concatenate([at[None] * distance, np.zeros((count, 3))])
    v = np.concatenate([across[None] / np.linalg.norm(across) * share * circular(distance), np.zeros((count, 3))])
    leaves = np.sort(rng.integers(0, STEPS, count))
    kicks, sides = rng.normal(0, 0.25, (count, 3)), np.where(rng.uniform(size=count) < 0.5, -1, 1)
    out = 1  # the progenitor and those that have left
    for step in range(STEPS):
        until = 1 + np.searchsorted(leaves, step, side="right")
        r = np.linalg.norm(x[0])
        tidal = r * (mass / 3 / enclosed(r)) ** (1 / 3)
        new = slice(out, until)
        x[new] = x[0] * (1 + sides[out - 1:until - 1, None] * tidal / r) + kicks[out - 1:until - 1] * tidal
        v[new] = v[0] + kicks[::-1][out - 1:until - 1] * np.sqrt(G * mass / scale) * 0.5
        out = until
        moving = slice(0, out)
        v[moving] += 0.5 * dt * pull(x[moving])
        x[moving] += dt * v[moving]
        v[moving] += 0.5 * dt * pull(x[moving])
    return x[1:], v[1:]


def draw(counts, seed):
    """Species by name: Gadget's type, positions, velocities, mass a particle."""
    rng = lambda part: np.random.default_rng([seed, part])
    bulge = lambda r: hernquist(r, BULGE["mass"], BULGE["scale"])
    grain = sum(mass for _, mass, _ in SATELLITES) / counts["satellites"]
    small = [satellites(counts["satellites"], rng(4))]
    small += [stream(round(first[1] / grain), first, rng(5 + i)) for i, first in enumerate(STREAMS)]
    return {
        "halo": (1, *rounded(nfw, HALO["edge"], counts["halo"], rng(1)), HALO["mass"] / counts["halo"]),
        "disc": (2, *disc(counts["disc"], rng(2)), DISC["mass"] / counts["disc"]),
        "bulge": (3, *rounded(bulge, BULGE["edge"], counts["bulge"], rng(3)), BULGE["mass"] / counts["bulge"]),
        "satellites": (4, *(np.concatenate(part) for part in zip(*small)), grain),
    }


def write(path, species):
    """Write Gadget-style HDF5 without a periodic box; attributes give units; no time stamps."""
    numbers, masses = np.zeros(6, np.uint32), np.zeros(6)
    with h5py.File(path, "w", libver="earliest", track_order=False) as file:
        first = 1
        for kind, positions, velocities, mass in species.values():
            numbers[kind], masses[kind] = len(positions), mass
            group = file.create_group(f"PartType{kind}")
            group.create_dataset("Coordinates", data=positions.astype("<f4"), track_times=False)
            group.create_dataset("Velocities", data=velocities.astype("<f4"), track_times=False)
            ids = np.arange(first, first + len(positions), dtype="<u4")
            group.create_dataset("ParticleIDs", data=ids, track_times=False)
            first += len(positions)
        file.create_group("Header").attrs.update({
            "NumPart_ThisFile": numbers, "NumPart_Total": numbers, "NumPart_Total_HighWord": np.zeros(6, np.uint32),
            "MassTable": masses, "Time": 0.0, "Redshift": 0.0, "BoxSize": 0.0, "NumFilesPerSnapshot": 1,
        })
        file.create_group("Parameters").attrs.update({
            "UnitLength_in_cm": 3.085678e21, "UnitMass_in_g": 1.989e43, "UnitVelocity_in_cm_per_s": 1e5,
            "HubbleParam": 1.0, "ComovingIntegrationOn": 0, "BoxSize": 0.0,
        })


def main():
    args = arguments(__doc__, [("--seed", {"type": int, "default": SEED})])
    counts = {name: count // (QUICK if args.quick else 1) for name, count in COUNTS.items()}
    with Whole(args.out) as data:
        species = draw(counts, args.seed)
        write(data.part / "galaxy.hdf5", species)
        data.describe(
            description="a disc galaxy with spiral arms, Hernquist bulge, NFW halo, eight satellites and two streams; "
            "four species with one mass each",
            command=command(args.seed, quick=args.quick),
            code={"make_galaxy.py": "this project", **packages("numpy", "h5py"),
                  "licence": "this project's; BSD-3-Clause (numpy, h5py)"},
            seed=args.seed, particles=sum(len(kind[1]) for kind in species.values()), box=None, periodic=False, unit="kpc",
            parameters={"counts": counts, "disc": DISC, "bulge": BULGE, "halo": HALO},
            is_not="no simulation: drawn from profiles, not in equilibrium; no gas, no gravity between particles, "
            "no hydrodynamics; arms are a pattern laid on the disc; streams are test particles in a round potential",
        )


if __name__ == "__main__":
    main()
