"""A wheel packed again by Zopfli, which any pip reads and which is a twentieth smaller; says what it weighs.

Usage: python scripts/pack-wheel.py WHEEL FOLDER
Ends with an error where the command is not in it or may not be run, and where the wheel weighs more than 25 MB, or more
than 5 MB without the command.
"""

import sys
import zipfile
from pathlib import Path

import zopfli

MB = 1_000_000


def pack(made: Path, packed: Path) -> None:
    """The same members in the same order, with their modes and dates."""
    packed.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(made) as members, zopfli.ZipFile(packed, "w", iterations=15, block_splitting_max=0) as out:
        for member in members.infolist():
            data = members.read(member)
            # What says where in the first file it lies stays behind.
            kept = zipfile.ZipInfo(member.filename, member.date_time)
            kept.compress_type, kept.external_attr = zipfile.ZIP_DEFLATED, member.external_attr
            kept.create_system = member.create_system
            out.writestr(kept, data)


def weigh(packed: Path) -> None:
    """Bytes as they are downloaded, with and without the command."""
    with zipfile.ZipFile(packed) as wheel:
        if wheel.testzip() is not None:
            sys.exit("the wheel was not packed soundly")
        members = wheel.infolist()
    command = [m for m in members if m.filename.endswith(".data/scripts/particlegs")]
    if len(command) != 1 or not command[0].external_attr >> 16 & 0o111:
        sys.exit("the wheel has no command, or it may not be run")
    for member in sorted(members, key=lambda m: -m.compress_size)[:5]:
        print(f"{member.compress_size:9d} of {member.file_size:9d}  {member.filename}")
    whole = packed.stat().st_size
    package = whole - command[0].compress_size
    print(f"the wheel: {whole / MB:.2f} MB, without the command {package / MB:.2f} MB")
    if whole > 25 * MB or package > 5 * MB:
        sys.exit("that is more than 25 MB, or 5 MB without the command")


def main() -> None:
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    made, folder = Path(sys.argv[1]), Path(sys.argv[2])
    packed = folder / made.name
    pack(made, packed)
    weigh(packed)


if __name__ == "__main__":
    main()
