#!/usr/bin/env bash
# Makes what a version hands out, tries each where nothing else is (not the other machine's wheel, nor the recipes), and
# tags the commit once all of it passed. Publishes nothing: docs/guide/install.md says how. Licences and known defects of
# dependencies are looked at first.
# Usage: scripts/release.sh [FOLDER]
#   FOLDER  a new one (default: dist/VERSION): crates, source archive, static binaries, wheels, Python's source
#           distribution, container, recipes for conda-forge and Spack, and SHA256SUMS of all of them
# Takes a clean work tree, whose version CHANGELOG.md names with its day; rustup's targets for musl and for the other
# machine, cargo-zigbuild, its qemu, and apptainer.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=scripts/handed-out.sh
. scripts/handed-out.sh
failed() {
    echo "$*" >&2
    exit 1
}

version=$(cargo pkgid --locked --package particlegs-cli)
version=${version##*[#@]}
tag=v$version
folder=${1:-dist/$version}
other=aarch64
if [ "$machine" = aarch64 ]; then other=x86_64; fi

# All that could stop it later.
[ -z "$(git status --porcelain)" ] || failed 'the work tree has changes'
[ ! -e "$folder" ] || failed "$folder is there already"
grep -qx "version = \"$version\"" python/Cargo.toml || failed "python/Cargo.toml has another version than $version"
grep -qx "version: $version" CITATION.cff || failed "CITATION.cff has another version than $version"
grep -qE "^## $version \([0-9-]{10}\)$" CHANGELOG.md || failed "CHANGELOG.md has no \`## $version (YEAR-MONTH-DAY)\`"
if git rev-parse --quiet --verify "refs/tags/$tag" >/dev/null && [ "$(git rev-parse "$tag^{commit}")" != "$(git rev-parse HEAD)" ]; then
    failed "$tag is another commit"
fi
for program in apptainer cargo-zigbuild "qemu-$other-static"; do
    command -v "$program" >/dev/null || failed "$program is not installed"
done
for target in "$machine-unknown-linux-musl" "$other-unknown-linux-musl" "$other-unknown-linux-gnu"; do
    rustup target list --installed | grep -qx "$target" || failed "rustup target add $target"
done
scripts/licences.sh

mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Cargo tries them: each is built from its package and those of the crates it stands on.
cargo package --workspace --locked
cp "$built"/package/particlegs*-"$version".crate "$folder"
# The page's engine is no crate of others.
rm "$folder/particlegs-web-$version.crate"

scripts/source-archive.sh "$folder"
scripts/static-binary.sh "$folder"
scripts/static-binary.sh "$folder" "$other-unknown-linux-musl"
scripts/apptainer.sh "$folder"
scripts/wheel.sh "$folder"
scripts/wheel.sh "$folder" "$other-unknown-linux-gnu"

# Python's source distribution, by an environment that has only what pip gives it, away from the tree.
(cd python && "$built/wheel-tools/bin/maturin" sdist --out "$folder")
python3 -m venv "$work/env"
"$work/env/bin/python" -m pip install --quiet --disable-pip-version-check "$folder/particlegs-$version.tar.gz"
cp -r samples/nbody64 "$work/"
(cd "$work" && env/bin/python -c 'import particlegs as pg; pg.compress(pg.open("nbody64"), effort="fast").save("sdist.pgs")')
"$folder/particlegs-$version-$machine-linux" compress samples/nbody64 -o "$work/binary.pgs" --effort fast --quiet >/dev/null
cmp "$work/sdist.pgs" "$work/binary.pgs"

hash=$(sha256sum <"$folder/particlegs-$version-source.tar.xz" | cut -d ' ' -f 1)
for recipe in conda/recipe.yaml spack/package.py; do
    sed -e "s/@VERSION@/$version/" -e "s/@SHA256@/$hash/" "packaging/$recipe" >"$folder/${recipe//\//-}"
done
(cd "$folder" && sha256sum -- * >"$work/sums")
mv "$work/sums" "$folder/SHA256SUMS"
cat "$folder/SHA256SUMS"
if ! git rev-parse --quiet --verify "refs/tags/$tag" >/dev/null; then git tag --annotate "$tag" --message "particlegs $version"; fi
echo "$folder, and $tag at $(git rev-parse --short HEAD): not published"
