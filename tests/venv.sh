# Sourced: $python, an interpreter with numpy, in target/venv.
target=$(cargo metadata --format-version 1 --no-deps --locked | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')
python=$target/venv/bin/python
if ! "$python" -c 'import numpy' 2>/dev/null; then
    rm -rf "$target/venv"
    python3 -m venv "$target/venv"
    "$python" -m pip install --quiet --disable-pip-version-check numpy
fi
