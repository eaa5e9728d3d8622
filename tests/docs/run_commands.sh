#!/usr/bin/env bash
# Runs the shell blocks of a page as they stand: run_commands.sh PAGE BUILD_FOLDER
#
# Blocks tagged ```sh are run, in order, from a scratch copy of the repository's root, with the
# programs of BUILD_FOLDER both as build/apps/... and on the path; a line that ends otherwise than
# with 0 fails, unless a comment "# exit N" closes it. A block without a tag fails: it could hide a
# command. Not run, because they build the project or install packages: the lines in is_excluded.
set -euo pipefail
page=$(realpath "$1")
programs=$(realpath "$2")/apps
root=$(realpath "$(dirname "$0")/../..")

is_excluded() {
  [[ $1 =~ ^(sudo\ )?(scripts/(demo|test|build|docs|evaluation|install-dependencies|update-references)|models/generate\.sh|apt-get|git\ clone|cmake|cpack)(\ |$) ]]
}

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cp -r "$root/models" "$root/docs" "$scratch"
mkdir -p "$scratch/build" "$scratch/out"
ln -s "$programs" "$scratch/build/apps"
export PATH="$programs:$PATH"
cd "$scratch"

run_block() {
  local line='' expected code
  while IFS= read -r part; do
    line+=$part
    if [[ $line == *\\ ]]; then line=${line%\\}; continue; fi
    if [[ -n $line && $line != \#* ]] && ! is_excluded "$line"; then
      expected=0
      if [[ $line =~ \#\ exit\ ([0-9]+)$ ]]; then expected=${BASH_REMATCH[1]}; fi
      echo "$ $line"
      code=0
      bash -c "$line" || code=$?
      if [[ $code != "$expected" ]]; then
        echo "$page: exit code $code, not $expected: $line" >&2
        exit 1
      fi
    fi
    line=''
  done
}

blocks=$(awk '/^```/ { if (inside) { inside = 0; if (tag == "sh") print ""; next }
                       inside = 1; tag = substr($0, 4); if (tag == "") tag = "none"
                       if (tag == "none") { print "UNTAGGED " NR; } next }
              inside && tag == "sh" { print }' "$page")
if grep -q '^UNTAGGED' <<<"$blocks"; then
  echo "$page: a block without a tag: $(grep '^UNTAGGED' <<<"$blocks" | head -1)" >&2
  exit 1
fi
run_block <<<"$blocks"
