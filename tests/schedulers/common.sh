# Helpers of the scheduler tests. Sourced with: PROGRAM_FOLDER
set -euo pipefail
root=$(realpath "$(dirname "${BASH_SOURCE[0]}")/../..")
script=$(realpath "$0")
schedulers=$root/docs/schedulers
PATH="$(realpath "$1"):$PATH"
export PATH

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

# Skips the test (ctest's SKIP_RETURN_CODE) where a program is not installed.
need() {
  local program
  for program in "$@"; do
    if ! command -v "$program" >/dev/null; then
      echo "skipped: there is no $program; scripts/install-dependencies --schedulers --formats brings it"
      exit 77
    fi
  done
}

# write_manifest FILE COUNT: variants v01, v02, ... of the bundled block.
write_manifest() {
  local steps=(step05 step10 step20) i
  {
    echo id,step,size
    for ((i = 0; i < $2; ++i)); do
      printf 'v%02d,%s,%d\n' $((i + 1)) "$root/models/bore/${steps[i % 3]}.step" $((i % 3))
    done
  } >"$1"
}

# A folder with what the commands of a page name: base.step, mesh.vtu and the page's own files.
enter_user_folder() {
  mkdir "$1"
  cd "$1"
  cp "$root/models/bore/base.step" base.step
  cp "$root/models/bore/hex.vtu" mesh.vtu
  ln -s "$root/docs" docs
}

# run_shown_commands PAGE: those that PAGE marks as run by this test, as they stand, in one shell.
run_shown_commands() {
  local lines
  lines=$("$root/tests/docs/page_commands.py" list "$(realpath --relative-to="$root" "$script")" \
    "$root/$1")
  [[ -n $lines ]] || fail "$1 shows nothing that this test runs"
  bash -euo pipefail -c "$lines"
}

# The columns of results.csv that tell of the results; the seconds are the machine's.
results_of() {
  awk -F, 'NR == 1 { for (i = 1; i <= NF; ++i) if ($i == "seconds") skip = i }
    { $skip = ""; print }' OFS=, "$1/results.csv"
}

# require_same_results EXPECTED GOT: two batch folders have the same rows and meshes to the last bit.
require_same_results() {
  diff <(results_of "$1") <(results_of "$2") || fail "results of $2 differ"
  local mesh
  for mesh in "$1"/*.vtu; do
    cmp "$mesh" "$2/${mesh##*/}" || fail "${mesh##*/} differs"
  done
  [[ $(cd "$1" && ls -- *.vtu) == "$(cd "$2" && ls -- *.vtu)" ]] || fail "other meshes in $2"
}
