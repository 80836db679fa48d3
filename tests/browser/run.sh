#!/usr/bin/env bash
# Tests the page in headless Chromium, with a GPU emulated in software, and Firefox.
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

web/build.sh --check
# shellcheck source=tests/common.sh
. tests/common.sh
node --test --test-concurrency=1 tests/browser/*.test.mjs
