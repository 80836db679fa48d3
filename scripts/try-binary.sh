#!/usr/bin/env bash
# Tries a static binary where there is nothing else: an empty folder as root directory, without libraries, /dev, /proc or
# a network's files, with the bundled sample beside it. Prints what the model's bytes hash to: every build makes the same.
# Usage: scripts/try-binary.sh BINARY [EMULATOR]
#   EMULATOR  a static one, where the binary is another machine's, such as qemu-aarch64-static
# Enters the folder by `chroot` as root, as a user by `unshare`.
set -euo pipefail
binary=$(realpath "${1:?usage: scripts/try-binary.sh BINARY [EMULATOR]}")
emulator=${2:-}
cd "$(dirname "${BASH_SOURCE[0]}")/.."

root=$(mktemp -d)
server=''
finish() {
    if [ -n "$server" ]; then kill "$server" 2>/dev/null || true; fi
    rm -rf "$root"
}
trap finish EXIT

mkdir "$root/sample" "$root/out"
cp "$binary" "$root/particlegs"
cp samples/nbody64/* "$root/sample/"
way=(unshare --map-root-user --root)
if [ "$(id -u)" = 0 ]; then way=(chroot); fi
way=(env -i PATH="$PATH" "${way[@]}" "$root")
if [ -n "$emulator" ]; then
    cp "$emulator" "$root/emulator"
    way+=(/emulator)
fi
way+=(/particlegs)
inside() { timeout 120 "${way[@]}" "$@"; }
failed() {
    echo "$*" >&2
    exit 1
}

version=$(inside --version)
said=$(inside info /sample)
[[ $said == *262144* ]] || failed "\`info\` does not say how many particles there are: $said"
inside compress /sample -o /out/sample.pgs --effort fast --quiet >/dev/null
inside verify /out/sample.pgs /sample --quiet >/dev/null
inside render /out/sample.pgs --azimuth 30 --elevation 20 --size 640x360 -o /out/sample.png --quiet >/dev/null
[ "$(head -c 4 "$root/out/sample.png" | tail -c 3)" = PNG ] || failed "\`render\` wrote no PNG"

# The page, asked for from outside; its address stands on the first line that has one.
"${way[@]}" view /out/sample.pgs --no-open --port 0 >"$root/out/said" 2>&1 &
server=$!
address=''
for _ in $(seq 100); do
    address=$(grep -o -m 1 'http://[^ ]*' "$root/out/said" || true)
    if [ -n "$address" ] || ! kill -0 "$server" 2>/dev/null; then break; fi
    sleep 0.1
done
[ -n "$address" ] || failed "\`view\` says no address: $(cat "$root/out/said")"
curl --fail --silent --show-error --noproxy '*' --max-time 20 "$address" -o "$root/out/page.html"
grep -qi '<canvas\|<script' "$root/out/page.html" || failed "\`view\` answered with no page"
kill "$server"
wait "$server" || failed "\`view\` ended with an error: $(cat "$root/out/said")"
server=''

echo "$version in an empty root directory: info, compress, verify, render, view"
echo "the sample at --effort fast: $(sha256sum <"$root/out/sample.pgs" | cut -d ' ' -f 1)"
