#!/usr/bin/env bash
# What the completion offers: completion_test.sh PROGRAM_FOLDER COMPLETION
set -euo pipefail
PATH="$(realpath "$1"):$PATH"
export PATH
source "$2"

# offers WORDS... : completes the last word; prints what is offered, a line each.
offers() {
  COMP_WORDS=(cadmorph "$@")
  COMP_CWORD=$#
  COMPREPLY=()
  _cadmorph
  printf '%s\n' "${COMPREPLY[@]}"
}

expect() {
  local wanted=$1
  shift
  if ! offers "$@" | grep -qx -- "$wanted"; then
    echo "completing '$*' does not offer '$wanted' but: $(offers "$@" | tr '\n' ' ')" >&2
    exit 1
  fi
}

expect quality qu
expect --untangle --unt
expect never --untangle n
expect --min-scaled-jacobian quality --min
if offers quality --unt | grep -q untangle; then
  echo "'quality' is offered an option of the main command" >&2
  exit 1
fi
cd "$(dirname "$0")"
expect completion_test.sh quality completion_t
