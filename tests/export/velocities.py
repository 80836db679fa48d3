"""One truth in peculiar km/s under the headers that codes write, through particlegs and back by h5py, pynbody and yt.

    velocities.py PARTICLEGS [FOLDER]

Needs h5py, asdf, pynbody and yt. Prints a table of relative errors; exits with 1 where one is
above 1e-5, or above 0.05 for the spread of particles drawn from a model (`compress`)."""

import json
import struct
import subprocess
import sys
import warnings
from pathlib import Path

import h5py
import numpy as np

N, BOX, H, MPC = 400, 20.0, 0.7, 3.085678e24
TOLERANCE = 1e-5
# The spread of particles that are drawn from a model: they show a wrong unit, and no more.
DRAWN = 0.05
SWIFT_CGS = "Conversion factor to CGS (not including cosmological corrections)"
random = np.random.default_rng(7)
HALO = 300
# A halo, and particles far from it.
PLACES = 10.0 + 0.02 * random.normal(size=(N, 3))
PLACES[HALO:] = 0.1 + 6.0 * random.random((N - HALO, 3))
TRUTH = np.array([200.0, -90.0, 40.0]) + 150.0 * random.normal(size=(N, 3))
COSMOLOGY = {"Omega0": 0.3, "OmegaLambda": 0.7, "HubbleParam": H}
UNITS = {"UnitLength_in_cm": MPC, "UnitMass_in_g": 1.98841e43, "UnitVelocity_in_cm_per_s": 1e5}


def gadget(path, velocities, header, parameters=None, attributes=None, name="Velocities", groups=None, places=PLACES):
    with h5py.File(path, "w") as f:
        h, count = f.create_group("Header").attrs, [0, N, 0, 0, 0, 0]
        default = dict(BoxSize=BOX, MassTable=[0, 20.0, 0, 0, 0, 0], NumFilesPerSnapshot=1, NumPart_ThisFile=count,
                       NumPart_Total=count, NumPart_Total_HighWord=[0] * 6)
        for key, value in {**default, **header}.items():
            h[key] = value
        for group, values in {"Parameters": parameters, **(groups or {})}.items():
            for key, value in (values or {}).items():
                f.require_group(group).attrs[key] = value
        g = f.create_group("PartType1")
        g["Coordinates"], g["ParticleIDs"] = places.astype("f4"), np.arange(N, dtype="u4")
        g[name] = velocities.astype("f4")
        for data, values in (attributes or {}).items():
            for key, value in values.items():
                g[data].attrs[key] = value


def binary(path, velocities, time, redshift, cosmology, named):
    header = struct.pack("<6I6d2d2i6I2i4d", 0, N, 0, 0, 0, 0, *[0, 20.0, 0, 0, 0, 0], time, redshift, 0, 0, 0, N, 0, 0,
                         0, 0, 0, 1, BOX, *cosmology).ljust(256, b"\0")
    blocks = {b"HEAD": header, b"POS ": PLACES.astype("<f4").tobytes(), b"VEL ": velocities.astype("<f4").tobytes(),
              b"ID  ": np.arange(N, dtype="<u4").tobytes()}
    record = lambda data: struct.pack("<I", len(data)) + data + struct.pack("<I", len(data))
    label = lambda name, data: record(name + struct.pack("<I", len(data) + 8)) if named else b""
    path.write_bytes(b"".join(label(name, data) + record(data) for name, data in blocks.items()))


def open_cosmo(path, velocities, a, convention, factor):
    with h5py.File(path, "w") as f:
        for k, axis in enumerate("xyz"):
            for name, values, unit in [(axis, PLACES * factor, "comoving Mpc/h"), ("v" + axis, velocities, "comoving km/s")]:
                d = f.create_dataset(f"data/{name}", data=values[:, k].astype("f4"))
                d.attrs["unit"] = unit if convention == "scalefree" else unit.replace("comoving ", "").replace("/h", "")
        f["data/mass"] = np.full(N, 1e11, "f4")
        f["data/mass"].attrs["unit"] = "Msun/h" if convention == "scalefree" else "Msun"
        of = lambda group, **values: [f.require_group(group).attrs.__setitem__(*item) for item in values.items()]
        of("header/file", data_type="gravity_particles", is_lightcone=False, origin="HACC", redshift=1 / a - 1,
           unit_convention=convention)
        of("header/simulation/parameters", box_size=BOX)
        of("header/simulation/cosmology", h=H, omega_m=0.3, omega_l=0.7, omega_b=0.05)


def abacus(path, a):
    """Velocities of 12 bits: the truth is what they stand for."""
    import asdf

    steps = np.rint(TRUTH / (6000 / 2048)).astype("i4") + 2048
    cells = np.rint((PLACES / BOX - 0.5) * 1e6).astype("i4")
    header = dict(BoxSize=BOX, BoxSizeHMpc=BOX, BoxSizeMpc=BOX / H, H0=100 * H, Omega_M=0.3, Omega_DE=0.7, ScaleFactor=a,
                  Redshift=1 / a - 1, VelZSpace_to_kms=1000.0, ParticleMassHMsun=1e11, NP=N, SimName="made")
    asdf.AsdfFile({"header": header, "data": {"rvint": (cells << 12) | steps}}).write_to(path)
    return (steps - 2048) * (6000 / 2048)


def kinds(folder, a):
    """Name, file, truth."""
    root, z = a**0.5, 1 / a - 1
    moment, run = {"Time": a, "Redshift": z}, {**COSMOLOGY, "ComovingIntegrationOn": 1}
    scaled = lambda name, values: {name: values}

    def one(title, velocities, header, **more):
        path = folder / f"{title}_{a}.hdf5"
        gadget(path, velocities, header, **more)
        return title, path, TRUTH

    swift = {"Header": {"Scale-factor": [a], "Dimension": [3], "Code": b"SWIFT"},
             "Cosmology": {"Cosmological run": [1], "Scale-factor": [a], "Redshift": [z], "h": [H], "Omega_m": [0.3],
                           "Omega_lambda": [0.7]},
             "Units": {"Unit length in cgs (U_L)": [MPC], "Unit mass in cgs (U_M)": [1.98841e43],
                       "Unit time in cgs (U_t)": [MPC / 1e5]}}
    powers = lambda power, cgs: {"a-scale exponent": [power], "h-scale exponent": [0.0], SWIFT_CGS: [cgs]}
    of_swift = dict(Coordinates=powers(1.0, MPC), Velocities=powers(0.0, 1e5))
    yield one("swift", TRUTH, {"Time": 0.002, "Redshift": z}, groups=swift, attributes=of_swift, places=PLACES / H)
    yield one("swift-bare", TRUTH, {"Time": 0.002, "Redshift": z}, groups=swift, places=PLACES / H)
    still = {**swift, "Cosmology": {"Cosmological run": [0]}, "Header": {"Dimension": [3], "Code": b"SWIFT"}}
    yield one("swift-still", TRUTH, {"Time": a, "Redshift": 0.0}, groups=still, attributes=of_swift)
    eagle = {"aexp-scale-exponent": 0.5, "h-scale-exponent": 0.0, "CGSConversionFactor": 1e5}
    yield one("eagle", TRUTH / root, {**moment, **COSMOLOGY, "ExpansionFactor": a}, name="Velocity",
              attributes=scaled("Velocity", eagle), groups={"Units": UNITS})
    arepo = {"a_scaling": 0.5, "h_scaling": 0.0, "to_cgs": 1e5, "velocity_scaling": 1.0}
    yield one("arepo", TRUTH / root, {**moment, **COSMOLOGY, **UNITS}, parameters={**run, **UNITS},
              attributes=scaled("Velocities", arepo))
    yield one("arepo-bare", TRUTH / root, {**moment, **COSMOLOGY, **UNITS}, groups={"Config": {"VORONOI": b""}})
    yield one("arepo-still", TRUTH, {"Time": a, "Redshift": 0.0, **UNITS},
              parameters={"ComovingIntegrationOn": 0, **COSMOLOGY, **UNITS}, attributes=scaled("Velocities", arepo))
    yield one("gadget2", TRUTH / root, {**moment, **COSMOLOGY})
    yield one("gadget2-de-sitter", TRUTH / root, {**moment, **COSMOLOGY, "Omega0": 1.0, "OmegaLambda": 0.0})
    yield one("gadget4", TRUTH / root, moment, parameters={**run, **UNITS})
    fast = {**UNITS, "UnitVelocity_in_cm_per_s": 1e7}
    yield one("gadget4-100km", TRUTH / root / 100, moment, parameters={**run, **fast})
    capitals = {"UnitLength_In_CGS": MPC / H, "UnitMass_In_CGS": 1.98841e43 / H, "UnitVelocity_In_CGS": 1e5}
    yield one("gizmo", TRUTH / root, {**moment, **COSMOLOGY, **capitals, "ComovingIntegrationOn": 1})
    yield one("gizmo-cgs", TRUTH / root * 1e5,
              {**moment, **COSMOLOGY, **capitals, "UnitVelocity_In_CGS": 1.0, "ComovingIntegrationOn": 1})
    yield one("gizmo-still", TRUTH, {**moment, **COSMOLOGY, "ComovingIntegrationOn": 0})
    yield one("config-still", TRUTH, {**moment, **COSMOLOGY}, groups={"Config": {"ComovingIntegrationOn": 0}})
    yield one("time-still", TRUTH, {"Time": 2.3, "Redshift": 0.0, **COSMOLOGY})
    yield one("matter-still", TRUTH, {"Time": a, "Redshift": 0.0, "Omega0": 0.0, "OmegaLambda": 0.0, "HubbleParam": 1.0})
    yield one("box-still", TRUTH, {"Time": a, "BoxSize": 0.0})
    yield one("stated-m-s", TRUTH * 1e3, {**moment, **COSMOLOGY}, attributes=scaled("Velocities", {"units": "m/s"}))
    for number, named in [(1, False), (2, True)]:
        for name, values, time, shift in [("", TRUTH / root, a, z), ("-still", TRUTH, 2.3, 0.0)]:
            path = folder / f"binary{number}{name}_{a}"
            binary(path, values, time, shift, (0.3, 0.7, H), named)
            yield path.name.rsplit("_")[0], path, TRUTH
    for convention, power, length in [("scalefree", 1, 1.0), ("comoving", 1, 1 / H), ("physical", 0, a / H)]:
        path = folder / f"opencosmo-{convention}_{a}.hdf5"
        open_cosmo(path, TRUTH / a**power, a, convention, length)
        yield f"opencosmo-{convention}", path, TRUTH
    path = folder / f"abacus_{a}.asdf"
    yield "abacus", path, abacus(path, a)


def error(found, truth):
    found = np.asarray(found, dtype=float)
    return float(np.abs(found - truth).max() / np.abs(truth).max()) if found.shape == truth.shape else np.inf


def dataset(path):
    """What the file itself says, by Gadget-4's attributes."""
    with h5py.File(path) as f:
        header, v = f["Header"].attrs, f["PartType1/Velocities"]
        a = 1 / (1 + header["Redshift"]) if v.attrs["a_scaling"] else 1.0
        return v[:] * a ** v.attrs["a_scaling"] * v.attrs["to_cgs"] / 1e5


def by_pynbody(path):
    import pynbody

    return pynbody.load(str(path)).dm["vel"].in_units("km s**-1")


def by_yt(path):
    import yt

    yt.set_log_level(50)
    with h5py.File(path) as f:
        low, high = f["PartType1/Coordinates"][:].min(), f["PartType1/Coordinates"][:].max()
        box = None if np.all(f["Header"].attrs["BoxSize"]) else [[low - 1, high + 1]] * 3
    data = yt.load(str(path), **({"bounding_box": box} if box else {})).all_data()
    order = np.argsort(np.asarray(data["PartType1", "Coordinates"].to("code_length"))[:, 0], kind="stable")
    with h5py.File(path) as f:
        wanted = np.argsort(f["PartType1/Coordinates"][:, 0], kind="stable")
    found = np.empty((N, 3))
    found[wanted] = np.asarray(data["PartType1", "Velocities"].to("km/s"))[order]
    return found


def main(program, folder):
    warnings.simplefilter("ignore")
    folder.mkdir(parents=True, exist_ok=True)

    def run(*arguments):
        done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(done.stderr.strip().splitlines()[-1])
        return done.stdout + done.stderr

    columns = ["compress", "recover to HDF5", "haloes", "convert", "stats", "again", "pynbody", "yt"]
    worst, rows, faults = 0.0, 0, []
    print(f"{'':22}" + "".join(f"{c:>16}" for c in columns))
    for a in (0.25, 0.5):
        for name, path, truth in kinds(folder, a):
            at, out, again = folder / "m.pgs", folder / "out.hdf5", folder / "again.hdf5"

            # yt takes a run without a cosmological constant for an isolated one.
            readers = [dataset, by_pynbody, by_yt][: 2 if name == "gadget2-de-sitter" else 3]

            def compress():
                run("compress", path, "-o", at, "--fields", "velocity", "--gaussians", 1, "--certificate", "none", "--force")
                return compare_means(at, truth)

            def compare_means(model, truth):
                run("recover", model, "-o", folder / "drawn", "--force")
                units = json.loads((folder / "drawn/meta.json").read_text())["field_units"]
                assert set(units.values()) == {"km/s"}, units
                drawn = np.stack([np.fromfile(folder / f"drawn/velocity_{k}.f32", "f4") for k in "xyz"], axis=1)
                spread = lambda v: float(np.sqrt(v.var(axis=0).sum()))
                return abs(spread(drawn) / spread(truth) - 1)

            def recover_file():
                run("recover", at, "-o", out, "--force")
                drawn = np.stack([np.fromfile(folder / f"drawn/velocity_{k}.f32", "f4") for k in "xyz"], axis=1)
                return max(error(read(out), drawn) for read in readers)

            def haloes():
                # Files without a unit, and isolated ones.
                units = ["--length-unit", "Mpc/h", "--mass-unit", "1e10 Msun/h"]
                moment = ["--cosmology", "h=0.7,Om=0.3,OL=0.7", "--redshift", 0]
                stated = [] if name.startswith(("opencosmo", "abacus")) else units + moment
                run("haloes", path, "-o", folder / "h.csv", "--force", *stated)
                lines = (folder / "h.csv").read_text().splitlines()
                table = [line.split(",") for line in lines if not line.startswith("#")]
                found = dict(zip(*table[:2]))
                assert any("km/s" in line and "vx" in line for line in lines if line.startswith("#")), "no unit of vx"
                mean = truth[:HALO].mean(axis=0)
                spread = np.sqrt(((truth[:HALO] - mean) ** 2).sum(axis=1).mean())
                return error([float(found[k]) for k in ("vx", "vy", "vz", "vrms")], np.append(mean, spread))

            def stats():
                run("stats", out, path, "-o", folder / "s", "--only", "dispersion")
                told = json.loads((folder / "s/stats.json").read_text())
                assert told["velocity_unit"] == "km/s", told["velocity_unit"]
                return abs(told["dispersion"]["median"] - 1.0)

            def convert():
                run("convert", path, "-o", out, "--force")
                return error(dataset(out), truth)

            def convert_again():
                run("convert", out, "-o", again, "--force")
                return error(dataset(again), truth)

            steps = [compress, recover_file, haloes, convert, stats, convert_again,
                     lambda: error(by_pynbody(out), truth)]
            if by_yt in readers:
                steps.append(lambda: error(by_yt(out), truth))
            row = ""
            for step in steps:
                try:
                    value = step()
                    within = value <= (DRAWN if step is compress else TOLERANCE)
                    worst = max(worst, value if within and step is not compress else 0.0 if within else 1.0)
                    row += f"{value:16.1e}"
                except Exception as fault:
                    worst = 1.0
                    row += f"{'fault':>16}"
                    faults.append(f"{path.name}: {type(fault).__name__}: {str(fault)[:300]}")
            rows += 1
            print(f"{name + ' a=' + str(a):22}{row}", flush=True)
    print(*faults, sep="\n")
    print(f"{rows} files, largest relative error {worst:.1e}")
    return worst > TOLERANCE


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], Path(sys.argv[2] if len(sys.argv) > 2 else "velocities")))
