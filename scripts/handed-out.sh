# shellcheck shell=bash disable=SC2034
# Sourced by what makes files that are handed out, after a `cd` to the root: $built, where cargo puts what it builds;
# $machine; and `compile_with FLAG...`, which gives rustc those flags and the ones that every such file has.
machine=$(uname -m)
built=$(cargo metadata --format-version 1 --no-deps --locked | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')
export CARGO_INCREMENTAL=0

compile_with() {
    # Where sources lie is no part of what they make. Stripped here, as Cargo forgets it of packages with settings of
    # their own.
    local flags encoded
    flags=("$@" -C strip=symbols "--remap-path-prefix=$PWD=." "--remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=cargo"
        "--remap-path-prefix=$(rustc --print sysroot)=rust")
    # Between flags: a byte that none has.
    encoded=$(printf '%s\x1f' "${flags[@]}")
    export CARGO_ENCODED_RUSTFLAGS=${encoded%$'\x1f'}
}
