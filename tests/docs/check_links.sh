#!/usr/bin/env bash
# Checks that each relative link of the Markdown pages leads to a file, and that the sources that the
# page on the architecture names are there: check_links.sh ROOT
set -euo pipefail
cd "$1"
broken=0
while IFS=: read -r page link; do
  target=${link#](}
  target=${target%%[#)]*}
  if [[ -z $target || $target == http*://* || $target == mailto:* ]]; then continue; fi
  if [[ ! -e $(dirname "$page")/$target ]]; then
    echo "$page: no such file: $target" >&2
    broken=1
  fi
done < <(grep -o '\]([^)]*)' --with-filename ./*.md docs/*.md models/*.md models/*/README.md)
while read -r source; do
  if [[ ! -e $source ]]; then
    echo "docs/architecture.md: no such file: $source" >&2
    broken=1
  fi
done < <(grep -oE '`[a-z_0-9]+/[A-Za-z_0-9/]+(\.(h|cpp|inc))?`' docs/architecture.md | tr -d '`')
exit $broken
