# shellcheck shell=bash disable=SC2034
# Sourced by what holds the program to an independent one: $particlegs and $decoded_bits, built as `cargo test`
# builds them; $python, with numpy, in the target folder.
target=$(cargo metadata --format-version 1 --no-deps --locked | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')
cargo test --quiet --workspace --locked --all-features --no-run
particlegs=$target/debug/particlegs
decoded_bits=$target/debug/examples/decoded_bits
python=$target/venv/bin/python
if ! "$python" -c 'import numpy' 2>/dev/null; then
    rm -rf "$target/venv"
    python3 -m venv "$target/venv"
    "$python" -m pip install --quiet --disable-pip-version-check numpy
fi
