#!/usr/bin/env bash
# The rules of docs/schedulers/Snakefile run by Snakemake: snakemake_test.sh PROGRAM_FOLDER
source "$(dirname "$0")/common.sh" "$1"
need snakemake

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
enter_user_folder "$scratch/user"
write_manifest variants.csv 6
echo "bad,$root/models/bore/hex.vtu,0" >>variants.csv # no STEP file: fails alone

run_snakemake() {
  HOME=$scratch run_shown_commands docs/schedulers.md >snakemake.log 2>&1 ||
    { cat snakemake.log >&2; fail "snakemake"; }
}

run_snakemake
code=0
cadmorph batch base.step mesh.vtu --quiet --manifest variants.csv -o expected 2>/dev/null || code=$?
[[ $code == 8 ]] || fail "a batch with a bad variant ends with $code"
require_same_results expected out
[[ -f out/share.1.mark && -f out/share.4.mark ]] || fail "no marks"

run_snakemake
grep -q 'Nothing to be done' snakemake.log || fail "a finished batch is run again"

# A share run again keeps what is finished.
rm out/share.2.mark
touch -d 2000-01-01 reference out/*.vtu
run_snakemake
for mesh in out/*.vtu; do [[ ! $mesh -nt reference ]] || fail "$mesh was made again"; done
