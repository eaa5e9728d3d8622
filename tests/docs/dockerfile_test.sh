#!/usr/bin/env bash
# The container is built by the README's two commands: dockerfile_test.sh REPOSITORY
set -euo pipefail
cd "$1"

shown=$(awk '/^<!-- run by .ci\/run -->$/ { getline; inside = 1; next } /^```$/ { if (inside) exit } inside' \
  README.md | sed 's/ *#.*//')
run=$(sed -n 's/^RUN //p' Dockerfile)
if [[ $(wc -l <<<"$shown") != 2 || $shown != "$run" ]]; then
  printf 'README.md shows\n%s\nDockerfile runs\n%s\n' "$shown" "$run" >&2
  exit 1
fi
while read -r command; do [[ -x $command ]]; done <<<"$run"
