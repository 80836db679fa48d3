#!/usr/bin/env bash
# Tests the page in headless Chromium, with a GPU emulated in software, and Firefox.
set -euo pipefail
cd "$(dirname "$0")/../.."

tests/browser/install.sh
web/build.sh --check
# shellcheck source=tests/common.sh
. tests/common.sh
node --test --test-concurrency=1 tests/browser/*.test.mjs
