#!/bin/sh
# Make all reporting data sets that are missing in DIR:  make.sh DIR [--quick]
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

# make NAME GENERATOR [OPTIONS...]: one data set, unless it is there (the regions are looked for by their last).
make() {
  name=$1 generator=$2
  shift 2
  if [ -e "$dir/$name/dataset.json" ] || [ -e "$dir/$name-5/dataset.json" ]; then
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
