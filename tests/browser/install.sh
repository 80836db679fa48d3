#!/usr/bin/env bash
# Installs the browsers, Node and what the page is built and tested with.
set -euo pipefail
cd "$(dirname "$0")/../.."

# shellcheck source=tests/packages.sh
. tests/packages.sh
missing=()
command -v chromium >/dev/null || missing+=(chromium)
command -v firefox-esr >/dev/null || missing+=(firefox-esr)
command -v node >/dev/null || missing+=(nodejs)
command -v npm >/dev/null || missing+=(npm)
packages "${missing[@]}"
[ web/node_modules/.package-lock.json -nt web/package-lock.json ] || npm ci --prefix web --silent --no-audit --no-fund
