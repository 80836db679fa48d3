#!/usr/bin/env bash
# Tests the page in headless Chromium, with a GPU emulated in software, and Firefox.
set -euo pipefail
cd "$(dirname "$0")/../.."

as_root=''
if [ "$(id -u)" != 0 ]; then as_root=sudo; fi
missing=()
command -v chromium >/dev/null || missing+=(chromium)
command -v firefox-esr >/dev/null || missing+=(firefox-esr)
command -v node >/dev/null || missing+=(nodejs)
command -v npm >/dev/null || missing+=(npm)
if [ ${#missing[@]} != 0 ]; then
    $as_root apt-get update -qq
    $as_root apt-get install -y -qq --no-install-recommends "${missing[@]}"
fi

web/build.sh --check
# shellcheck source=tests/common.sh
. tests/common.sh
node --test --test-concurrency=1 tests/browser/*.test.mjs
