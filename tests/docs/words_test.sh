#!/usr/bin/env bash
# Sentences that readers stumbled over don't come back, and the pages for users begin with what they
# are for: words_test.sh REPOSITORY
set -euo pipefail
cd "$1"

pages=$(cat README.md docs/*.md | tr -s ' \n' ' ')
for words in 'need nothing done before them' 'More than a list of files is told by a table' \
  "a point belongs to its position can't say" 'is another topology without saying so' \
  'A turn or a small change?'; do
  if [[ $pages == *"$words"* ]]; then
    echo "a page still says: $words" >&2
    exit 1
  fi
done

# in_order FILE HEADING...: the headings stand in the file in this order.
in_order() {
  local file=$1 last=0 line
  shift
  for heading in "$@"; do
    line=$(grep -nx -m 1 -- "$heading" "$file" | cut -d : -f 1) || line=0
    if ((line <= last)); then
      echo "$file: '$heading' is missing, or not after what comes before it" >&2
      exit 1
    fi
    last=$line
  done
}

in_order README.md '## What it is for' '## Your own part' '## What it does' '## As a library'
in_order docs/guide.md '## What it is for' '## Install' '## Your own part' '## The first morph'
in_order docs/batch.md '## The results' '## On many machines' '## In detail'
in_order docs/choosing.md '## `--improve`' '## `--steps`' '## `--kernel`' '## `--method`'
if (($(awk '/^## In detail/ { exit } { n += NF } END { print n }' docs/batch.md) > 1100)); then
  echo "docs/batch.md: too long before its details" >&2
  exit 1
fi
if (($(awk '/^## From equation to function/ { exit } { n += NF } END { print n }' docs/fast-solver.md) > 600)); then
  echo "docs/fast-solver.md: too long before its details" >&2
  exit 1
fi
