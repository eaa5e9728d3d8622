#!/usr/bin/env bash
# Runs the command lines of a page as they stand: run_commands.sh PAGE BUILD_FOLDER
#
# From a scratch copy of the repository's root, in order, with the programs of BUILD_FOLDER both as
# build/apps/... and on the path, and the Python module; a line that ends otherwise than with 0 fails, unless a comment
# "# exit N" closes it. Lines that others run (see page_commands.py) are left out.
set -euo pipefail
page=$(realpath "$1")
programs=$(realpath "$2")/apps
root=$(realpath "$(dirname "$0")/../..")

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cp -r "$root/models" "$root/docs" "$scratch"
mkdir -p "$scratch/build" "$scratch/out"
ln -s "$programs" "$scratch/build/apps"
# Debian's Python has what the module needs.
mkdir "$scratch/bin"
if [[ -x /usr/bin/python3 ]]; then ln -s /usr/bin/python3 "$scratch/bin"; fi
export PATH="$programs:$scratch/bin:$PATH" PYTHONPATH=$programs/python PYTHONDONTWRITEBYTECODE=1
cd "$scratch"

lines=$("$root/tests/docs/page_commands.py" list ctest "$page")
while IFS= read -r line; do
  expected=0
  if [[ $line =~ \#\ exit\ ([0-9]+)$ ]]; then expected=${BASH_REMATCH[1]}; fi
  echo "$ $line"
  code=0
  bash -o pipefail -c "$line" </dev/null || code=$?
  if [[ $code != "$expected" ]]; then
    echo "$page: exit code $code, not $expected: $line" >&2
    exit 1
  fi
done <<<"$lines"
