"""Adenylate kinase in water, 10 frames by GROMACS: adk_oplsaa.gro and .xtc of MDAnalysisTests, copied from FOLDER."""

import shutil
import struct
from pathlib import Path

from common import Whole, arguments, command

FILES = "adk_oplsaa.gro", "adk_oplsaa.xtc"
XTC = 1995  # what each frame begins with, before the number of atoms


def main():
    args = arguments(__doc__, [("--from", {"dest": "folder", "metavar": "FOLDER", "type": Path, "required": True})])
    with Whole(args.out) as data:
        for name in FILES:
            shutil.copyfile(args.folder / name, data.part / name)
        count = int((data.part / FILES[0]).read_text().splitlines()[1])
        frames, begins = (data.part / FILES[1]).read_bytes(), struct.pack(">2i", XTC, count)
        cell = struct.unpack(">9f", frames[frames.rindex(begins) + 16 :][:36])
        data.describe(
            description=f"adenylate kinase in water, {count} atoms, {frames.count(begins)} frames",
            command=command(**{"from": "FOLDER"}),
            code={"gromacs": "of others", "licence": "MDAnalysisTests 2.11.0: LGPL-2.1 or later (not bundled)"},
            particles=count, box=list(cell[::4]), periodic=True, unit="nm", open=[FILES[1]],
            parameters={"cell": cell},
            is_not="not ours; one protein, mostly water; positions rounded to 0.001 nm; no velocities",
        )


if __name__ == "__main__":
    main()
