#!/bin/sh
# Make all reporting data sets that are missing in DIR:  make.sh DIR [--quick]
# ABACUS and ADK name folders with files of others (README.md); without them, their data sets are not made.
# PYTHON names the interpreter of the environment of requirements.txt (default: python3).
set -eu
case "${1:-}" in
  '' | -*) echo "usage: make.sh DIR [--quick]" >&2; exit 2 ;;
esac
case "${2:-}" in
  '' | --quick) ;;
  *) echo "error: unknown option $2" >&2; exit 2 ;;
esac
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$1"
dir=$(cd "$1" && pwd)
quick=${2:-}
python=${PYTHON:-python3}

# there NAME...: whether all these data sets are complete.
there() {
  for each; do
    [ -e "$dir/$each/dataset.json" ] || return 1
  done
}

# make NAME GENERATOR [OPTIONS...]: one data set, or the five regions, unless it is there.
make() {
  name=$1 generator=$2
  shift 2
  if there "$name" || there "$name-1" "$name-2" "$name-3" "$name-4" "$name-5"; then
    echo "$name: there"
    return
  fi
  start=$(date +%s)
  "$python" -W ignore "$here/$generator" "$dir/$name" $quick "$@"
  echo "$name: made in $(($(date +%s) - start)) s"
}

make galaxy make_galaxy.py
make melt make_melt.py
make crystal make_crystal.py
make box-a make_box.py --seed 1001
make box-b make_box.py --seed 1002
make box-c-z1 make_box.py --seed 1003 --redshift 1
make region make_regions.py
make p3m make_p3m.py
make water make_water.py
make film make_film.py
[ -z "${ABACUS:-}" ] || make abacus-mini make_abacus.py --from "$ABACUS"
[ -z "${ADK:-}" ] || make adk make_adk.py --from "$ADK"
