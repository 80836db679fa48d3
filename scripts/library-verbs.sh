#!/usr/bin/env bash
# The command and Python parse, call a verb of the library and print its record: neither decodes models, loops over
# frames nor plans work itself. What the list names may stand in these files alone, and a name that left them goes.
set -euo pipefail
cd "$(dirname "$0")/.."
words='codec::decode|SeriesDecoder|Compression::plan|SelectedParticles|\.read_fields\(|Density::new|Merge::|as_splats'
allowed='crates/particlegs-cli/src/page_models.rs
python/src/density.rs
python/src/snapshot.rs'
used=$(grep -rlE "$words" crates/particlegs-cli/src python/src --include=*.rs | LC_ALL=C sort)
difference=$(diff <(echo "$allowed" | LC_ALL=C sort) <(echo "$used")) && exit 0
echo "$difference"
echo "the command and Python call verbs of particlegs: move this work there (>), or strike the file from the list (<)"
exit 1
