#!/usr/bin/env bash
# Runs, as they stand and in this tree, the command lines that the pages mark as run by .ci/run: those
# that build, test, package or make the models and references anew: run_in_tree.sh PAGE...
#
# They share the tree's build folder, and each runs once; lines that .ci/run has itself are not run
# again. None may change a file outside of build* and out. apt-get installs to a scratch folder, and
# the references made anew must be those in the repository but for rounding; these are then put back.
set -euo pipefail
cd "$(dirname "$0")/../.."

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

# An apt that takes this machine's packages for installed, runs no script or trigger of theirs, and
# unpacks others below $scratch/root.
make_scratch_apt() {
  local root=$scratch/root
  mkdir -p "$root/var/lib/dpkg/"{info,triggers,updates} "$root/"{cache/archives/partial,log}
  cp /var/lib/dpkg/status "$root/var/lib/dpkg"
  cp /var/lib/dpkg/info/{*.list,format} "$root/var/lib/dpkg/info"
  cat >"$scratch/apt.conf" <<CONF
Dir::State::status "$root/var/lib/dpkg/status";
Dir::Cache "$root/cache";
Dir::Log "$root/log";
Debug::NoLocking "true";
APT::Sandbox::User "";
DPkg::Options {
  "--instdir=$root"; "--admindir=$root/var/lib/dpkg"; "--log=$root/log/dpkg.log";
  "--force-not-root,script-chrootless";
};
CONF
}

install_to_scratch() {
  make_scratch_apt
  APT_CONFIG=$scratch/apt.conf bash -c "$1" </dev/null
  "$scratch/root/usr/bin/cadmorph" --version
}

update_references() {
  cp -r models/reference "$scratch/reference"
  bash -c "$1"
  local mesh
  for mesh in "$scratch"/reference/*.vtu; do
    build/apps/cadmorph compare "$mesh" "models/reference/${mesh##*/}" --quiet ||
      fail "$1 makes another ${mesh##*/}"
  done
  cp -p "$scratch"/reference/* models/reference
}

# The checksums of all files that are no build's or run's output.
sum_tree() {
  find . -path ./.git -prune -o -path './build*' -prune -o -path ./out -prune -o -type f -print0 |
    sort --zero-terminated | xargs -0 sha256sum
}

run() {
  case $1 in
    apt-get\ *) install_to_scratch "$1" ;;
    scripts/update-references) update_references "$1" ;;
    *) bash -o pipefail -c "$1" </dev/null ;;
  esac
}

before=$(sum_tree)
lines=$(tests/docs/page_commands.py list .ci/run "$@" | sed 's/ *#.*//' | awk '!seen[$0]++')
while IFS= read -r line; do
  if grep --quiet --line-regexp --fixed-strings -- "$line" .ci/run; then continue; fi
  echo "$ $line"
  start=$SECONDS
  run "$line" || fail "$line"
  echo "($((SECONDS - start)) s)"
done <<<"$lines"
diff <(echo "$before") <(sum_tree) || fail "the lines leave changed files"
