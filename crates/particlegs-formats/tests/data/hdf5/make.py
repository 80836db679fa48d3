#!/usr/bin/env python3
"""Writes the small HDF5 snapshots beside it, with h5py and hdf5plugin: every layout, filter and index of chunks that
the reader meets. Positions are x = i/8, y = i/4 + 1, z = i/2 + 2 for particle i of 100, box 64."""
import os
import h5py
import hdf5plugin
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
N = 100
I = np.arange(N)
POS = np.stack([I / 8, I / 4 + 1, I / 2 + 2], 1)


def header(f, n=(0, N, 0, 0, 0, 0), **more):
    h = f.create_group("Header")
    h.attrs["NumPart_ThisFile"] = np.array(n, np.uint64)
    h.attrs["NumPart_Total"] = np.array(more.pop("total", n), np.uint64)
    h.attrs["NumFilesPerSnapshot"] = more.pop("files", 1)
    h.attrs["BoxSize"] = 64.0
    h.attrs["Time"] = 0.5
    h.attrs["Redshift"] = 1.0
    h.attrs["MassTable"] = np.array([0, 2.5, 0, 0, 0, 0])
    for k, v in more.items():
        h.attrs[k] = v


def write(name, libver="earliest", pos=POS.astype("<f4"), head={}, before=None, open_with={}, **options):
    with h5py.File(os.path.join(HERE, name + ".hdf5"), "w", libver=libver, track_order=False, **open_with) as f:
        header(f, **head)
        if before:
            before(f)
        f.create_group("PartType1").create_dataset("Coordinates", data=pos, **options)


write("contiguous_be_f8", pos=POS.astype(">f8"))
write("gzip_shuffle_fletcher", chunks=(33, 3), compression="gzip", shuffle=True, fletcher32=True)
write("chunks_split_columns", chunks=(30, 2), compression="gzip")
write("lzf", chunks=(40, 3), compression="lzf", shuffle=True)
# Several blocks a chunk, the last one short.
write("lz4", chunks=(40, 3), **hdf5plugin.LZ4(nbytes=128))
write("plain_chunks", chunks=(7, 1))
write("latest_fixed_array", "latest", chunks=(33, 3), compression="gzip")
write("latest_extensible_array", "latest", chunks=(9, 3), maxshape=(None, 3), compression="gzip")
write("latest_btree2", "latest", chunks=(9, 2), maxshape=(None, None), compression="gzip")
write("latest_single_chunk", "latest", chunks=(N, 3), compression="gzip", shuffle=True)
write("scale_offset", pos=(POS * 8).astype("<i4"), chunks=(33, 3), scaleoffset=0)
write("user_block", open_with={"userblock_size": 512})
write("latest_dense", "latest", before=lambda f: [f["Header"].attrs.__setitem__(f"a{i}", i) for i in range(40)]
      + [f.create_group(f"g{i}") for i in range(40)])
write("high_word", head={"NumPart_Total_HighWord": np.zeros(6, np.uint32), "UnitLength_in_cm": 1.495978707e13})


def low(name, make):
    """Layouts that need h5py's low-level calls."""
    with h5py.File(os.path.join(HERE, name + ".hdf5"), "w", libver="latest") as f:
        header(f)
        plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        make(plist)
        space = h5py.h5s.create_simple((N, 3))
        group = f.create_group("PartType1")
        data = h5py.h5d.create(group.id, b"Coordinates", h5py.h5t.IEEE_F32LE, space, plist)
        data.write(h5py.h5s.ALL, h5py.h5s.ALL, POS.astype("<f4"))


def implicit(p):
    p.set_chunk((30, 3))
    p.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)


low("latest_implicit", implicit)
low("compact", lambda p: p.set_layout(h5py.h5d.COMPACT))

# SWIFT: aliases as soft links, units with powers of a, masses.
with h5py.File(os.path.join(HERE, "swift.hdf5"), "w") as f:
    header(f, n=(0, N, 0, 0, 0, 0, 0))
    f["Header"].attrs["Code"] = np.bytes_("SWIFT")
    f["Header"].attrs["BoxSize"] = [64.0, 64.0, 32.0]
    f.create_group("Cosmology").attrs["Cosmological run"] = [1]
    f["Cosmology"].attrs["h"] = [0.7]
    f.create_group("Units").attrs["Unit length in cgs (U_L)"] = [3.08567758e24]
    f["Units"].attrs["Unit mass in cgs (U_M)"] = [1.98841e43]
    g = f.create_group("PartType1")
    c = g.create_dataset("Coordinates", data=POS, chunks=(60, 3), compression="gzip", shuffle=True, fletcher32=True)
    c.attrs["a-scale exponent"] = [1.0]
    c.attrs["h-scale exponent"] = [0.0]
    g.create_dataset("Masses", data=np.full(N, 0.25, "<f4"), chunks=(70,), compression="gzip")
    f["DMParticles"] = h5py.SoftLink("/PartType1")

# Two files; gas only in the second.
for i, n in enumerate([(0, 60, 0, 0, 0, 0), (5, 40, 0, 0, 0, 0)]):
    with h5py.File(os.path.join(HERE, f"multi.{i}.hdf5"), "w") as f:
        header(f, n=n, total=(5, 100, 0, 0, 0, 0), files=2)
        f.create_group("PartType1").create_dataset("Coordinates", data=POS.astype("<f4")[[0, 60][i]:[60, 100][i]])
        if i:
            f.create_group("PartType0").create_dataset("Coordinates", data=POS[:5], dtype="<f8")

# Refused: a link to another file, an unwritten chunk, data elsewhere.
with h5py.File(os.path.join(HERE, "bad_external.hdf5"), "w") as f:
    header(f)
    f["PartType1"] = h5py.ExternalLink("elsewhere.hdf5", "/PartType1")
with h5py.File(os.path.join(HERE, "bad_hole.hdf5"), "w") as f:
    header(f)
    d = f.create_group("PartType1").create_dataset("Coordinates", (N, 3), "<f4", chunks=(10, 3), compression="gzip")
    d[:50] = POS[:50]
with h5py.File(os.path.join(HERE, "bad_virtual.hdf5"), "w", libver="latest") as f:
    header(f)
    layout = h5py.VirtualLayout((N, 3), "<f4")
    layout[:] = h5py.VirtualSource("elsewhere.hdf5", "x", (N, 3))
    f.create_group("PartType1").create_virtual_dataset("Coordinates", layout)

# Numbers of fewer bits than their bytes have: floats as SWIFT's lossy ones, integers, half floats.
def bits(name, kind, scale=1):
    with h5py.File(os.path.join(HERE, name + ".hdf5"), "w") as f:
        header(f)
        p = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        p.set_chunk((33, 3))
        p.set_filter(5, 0, ())  # N-bit
        group = f.create_group("PartType1")
        data = h5py.h5d.create(group.id, b"Coordinates", kind, h5py.h5s.create_simple((N, 3)), p)
        data.write(h5py.h5s.ALL, h5py.h5s.ALL, (POS * scale - (scale - 1)).astype("<i4" if scale > 1 else "<f4"))


t = h5py.h5t.IEEE_F32LE.copy()
t.set_fields(21, 13, 8, 0, 13)
t.set_offset(0)
t.set_precision(22)
bits("nbit_float", t)
t = h5py.h5t.STD_I32BE.copy()
t.set_precision(20)
t.set_offset(5)
bits("nbit_integer", t, 200)
write("half_float", pos=POS.astype("<f2"), chunks=(50, 3), compression="gzip", shuffle=True)

# Chunks of more rows than are read at once: values repeat, so that the file stays small.
M = 300_000
J = np.arange(M)
with h5py.File(os.path.join(HERE, "large", "wide_chunks.hdf5"), "w") as f:
    header(f, n=(0, M, 0, 0, 0, 0))
    data = np.stack([J % 8, J % 16, J // 65536], 1).astype("<f4")
    group = f.create_group("PartType1")
    group.create_dataset("Coordinates", data=data, chunks=(170_000, 3), compression="gzip", shuffle=True)
    group.create_dataset("Masses", data=(J % 4 + 1).astype("<f8"), chunks=(140_000,), compression="gzip")
