#!/usr/bin/env bash
# docs/schedulers/dakota_driver with parameters files in the two formats of Dakota ("Parameters
# file format" in its documentation); Dakota itself is not packaged: dakota_test.sh PROGRAM_FOLDER
source "$(dirname "$0")/common.sh" "$1"

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
enter_user_folder "$scratch/user"

# The "CAD system": the step nearest to the radius asked for, and nothing else.
cat >make_variant <<END
#!/usr/bin/env bash
[[ \$2 == radius=* && \$3 == depth=2.5e+00 ]] || exit 1
case \${2#radius=} in
  5.0*) step=step05 ;;
  2.0*e+01) step=step20 ;;
  *) exit 1 ;;
esac
cp "$root/models/bore/\$step.step" "\$1"
END
# The "solver": the smallest scaled Jacobian and the number of arguments.
cat >solve <<'END'
#!/usr/bin/env bash
python3 -c 'import json, sys; print(json.load(open(sys.argv[1]))["after"]["min_scaled_jacobian"])' "$2"
[[ -s $1 ]] && echo $#
END
chmod +x make_variant solve

write_standard() { # RADIUS
  cat >params.in <<END
                                          2 variables
                      $1 radius
                      2.5e+00 depth
                                          2 functions
                                          1 ASV_1:quality
                                          1 ASV_2:count
                                          2 derivative_variables
                                          1 DVV_1:radius
                                          2 DVV_2:depth
                                          0 analysis_components
                                          3 eval_id
END
}

write_aprepro() { # RADIUS
  cat >params.in <<END
                    { DAKOTA_VARS = 2 }
                    { radius = $1 }
                    { depth = 2.5e+00 }
                    { DAKOTA_FNS = 2 }
                    { ASV_1:quality = 1 }
                    { ASV_2:count = 1 }
                    { DAKOTA_DER_VARS = 2 }
                    { DVV_1:radius = 1 }
                    { DVV_2:depth = 2 }
                    { DAKOTA_AN_COMPS = 0 }
                    { DAKOTA_EVAL_ID = 3 }
END
}

evaluate() {
  rm -f results.out
  run_shown_commands docs/schedulers.md 2>driver.log || fail "the driver ends with $?"
}

quality_of() { # STEP
  cadmorph base.step "$root/models/bore/$1.step" mesh.vtu -o moved.vtu --quiet \
    --json report.json
  ./solve moved.vtu report.json
}

for write in write_standard write_aprepro; do
  $write 5.0e+00
  evaluate
  diff results.out <(quality_of step05) || fail "$write: other results"
done
write_standard 2.0e+01
evaluate
diff results.out <(quality_of step20) || fail "other results"

expect_failure() {
  evaluate
  [[ $(cat results.out) == FAIL ]] || fail "$1: the results are $(cat results.out)"
}
write_standard 7.0e+00
expect_failure "no CAD variant"
write_standard 5.0e+00
CADMORPH_OPTIONS="--min-scaled-jacobian 0.99" expect_failure "elements below what was asked"
printf '#!/bin/sh\nexit 1\n' >solve
expect_failure "a solver that fails"
printf '#!/bin/sh\necho 1\n' >solve
expect_failure "one response of two"
echo "not a parameters file" >params.in
expect_failure "no parameters"
[[ -z $(find . -name '*.failed.vtu') ]] || fail "files are left behind"
