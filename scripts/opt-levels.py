#!/usr/bin/env python3
"""Compares the optimisation levels of Cargo.toml with what the command is built of (standard library only).

A dependency without a level of its own is compiled at the profile's own, the lowest that optimises: right for what parses
a command line, ten times too slow for what works on particles, pixels or bytes of files. Every dependency of the command
therefore stands either in [profile.release.package] or in COLD below. Ends with 1 where one stands in neither, or where a
name in the lists is no dependency.
"""
import json
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
# Command line, structure of files, text, and what other crates are made of: their time does not show.
COLD = set(
    """
    ab_glyph adler2 allocator-api2 anstyle arraydeque arrayvec ash atomic-waker better_io bit-set bit-vec
    bitflags bytes bzip2 cfg-if clap clap_lex codespan-reporting constant_time_eq core_maths cpufeatures
    crossbeam-utils dtype_dispatch equivalent errno fastrand foldhash futures-core getrandom glob gpu-allocator
    half hashbrown http-body http-body-util httparse httpdate indexmap libc libloading linux-raw-sys lock_api
    log lru memmap2 mio naga naga-types num-complex num-integer num-traits once_cell ordered-float
    owned_ttf_parser parking_lot parking_lot_core particlegs-files particlegs-server particlegs-view
    pin-project-lite pollster portable-atomic presser primal-check profiling rand_core rand_xoshiro
    raw-window-handle rawpointer renderdoc-sys roff rustc-hash saphyr-parser scopeguard serde serde_core
    serde_json serde_spanned signal-hook signal-hook-registry smallvec socket2 spirv static_assertions
    strength_reduce strsim terminal_size thiserror toml_datetime transpose unicode-ident unicode-width
    unit-prefix wgpu wgpu-core wgpu-core-deps-windows-linux-android wgpu-hal wgpu-naga-bridge wgpu-types winnow
    zerocopy
    """.split()
)


def dependencies():
    """Names of all packages that the command is built of on Linux, without build scripts and macros."""
    command = ["cargo", "metadata", "--locked", "--format-version", "1", "--all-features"]
    command += ["--filter-platform", "x86_64-unknown-linux-gnu"]
    metadata = json.loads(subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout)
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    macros = {i for i, p in packages.items() if any("proc-macro" in t["kind"] for t in p["targets"])}
    waiting = [i for i, p in packages.items() if p["name"] == "particlegs-cli"]
    reached = set(waiting)
    while waiting:
        for dependency in nodes[waiting.pop()]["deps"]:
            normal = any(kind["kind"] is None for kind in dependency["dep_kinds"])
            if normal and dependency["pkg"] not in reached | macros:
                reached.add(dependency["pkg"])
                waiting.append(dependency["pkg"])
    return {packages[i]["name"] for i in reached}


def levels():
    """Names in [profile.release.package]."""
    text = (ROOT / "Cargo.toml").read_text()
    section = text.split("[profile.release.package]\n")[1].split("\n\n")[0]
    return set(re.findall(r"^([\w-]+)\.opt-level", section, re.M))


def main():
    built, listed = dependencies(), levels()
    wrong = False
    for title, names in (
        ("have no optimisation level: give them one in [profile.release.package], or add them to COLD", built - listed - COLD),
        ("have a level and are no dependency", listed - built),
        ("stand in COLD and are no dependency", COLD - built),
        ("stand in both lists", COLD & listed),
    ):
        if names:
            print(f"error: {', '.join(sorted(names))} {title}", file=sys.stderr)
            wrong = True
    return int(wrong)


if __name__ == "__main__":
    sys.exit(main())
