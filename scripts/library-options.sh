#!/usr/bin/env bash
# Fails where a library names an option of the command line in its text: an error holds a Hint instead, which the command
# and Python spell in their own ways. Exceptions:
#   model/recipe.rs, model/target.rs   a recipe is shown as the command line that makes the model
#   particlegs-lab                     calls the command and other programs, and quotes its pages
#   law_tests.rs, tests                read the documents, and what is above
#   vulkaninfo --summary               another program
cd "$(dirname "$0")/.." || exit 1
named=$(grep -rnE '"[^"]*--[a-z]' crates/*/src --include='*.rs' | grep -vE \
    -e '^crates/particlegs-(cli|lab)/' \
    -e '^crates/particlegs-core/src/(model/(recipe|target)|codec/merge)\.rs' \
    -e '^[^:]*tests\.rs:' \
    -e 'vulkaninfo --summary')
[ -z "$named" ] || { echo "$named"; echo "a library names an option of the command line"; exit 1; }
