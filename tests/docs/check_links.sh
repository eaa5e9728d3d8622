#!/usr/bin/env bash
# Checks that each relative link of the Markdown pages leads to a file: check_links.sh ROOT
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
exit $broken
