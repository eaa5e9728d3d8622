#!/usr/bin/env bash
# From CAD to solver as docs/formats.md shows it, judged by the solvers' own readers:
# walks_test.sh PROGRAM_FOLDER
source "$(dirname "$0")/openfoam.sh" "$1"
need_openfoam
need ccx
PATH=/usr/bin:$PATH # Debian's Python, which has Debian's meshio
python3 -c 'import meshio' 2>/dev/null || {
  echo "skipped: there is no meshio; scripts/install-dependencies --formats brings it"
  exit 77
}

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$scratch"
cp -r "$root/models" "$root/docs" .
mkdir out
run_shown_commands docs/formats.md >walks.log 2>&1 || {
  tail -n 40 walks.log >&2
  fail "a shown command"
}

# points_of FILE: as meshio reads them.
points_of() {
  python3 -c "import meshio, sys; print(len(meshio.read(sys.argv[1]).points))" "$1" ||
    fail "meshio can't read $1"
}
[[ $(points_of out/bore.su2) == "$(points_of out/wide.su2)" ]] || fail "SU2: other points"
[[ $(points_of out/bore.msh) == "$(points_of out/wide.msh)" ]] || fail "gmsh: other points"
[[ $(points_of out/tetrahedra.xdmf) == "$(points_of out/wide.xdmf)" ]] || fail "XDMF: other points"
[[ $(points_of out/tetrahedra.med) == "$(points_of out/wide.med)" ]] || fail "MED: other points"

# counts_of CASE: points, faces and cells as checkMesh counts them.
counts_of() {
  checkMesh -case "$1" -constant | sed -nE '/Mesh stats/,/Checking topology/p'
}
diff <(counts_of out/case) <(counts_of out/wide_case) || fail "OpenFOAM: other counts"
checkMesh -case out/wide_case -constant >check.log
grep -q '^Mesh OK' check.log || fail "OpenFOAM: mesh not OK"

# reaction FOLDER: the force under the foot, newtons.
reaction() { awk '/total force/ {getline; getline; print $3}' "$1/bore_weight.dat"; }
mkdir base_analysis
cp out/bore.inp base_analysis/mesh.inp
cp docs/formats/bore_weight.inp base_analysis
(cd base_analysis && ccx bore_weight >ccx.log)
awk -v base="$(reaction base_analysis)" -v wide="$(reaction out/analysis)" \
  'BEGIN { exit !(base > 0 && wide > 0 && base != wide) }' || fail "CalculiX: no other weight"

# The same CAD gives the same bytes.
gmsh docs/formats/bore.geo -3 -o out/bore.unv >/dev/null
for mesh in out/bore.su2 out/bore.msh out/bore.inp out/bore.unv out/tetrahedra.med; do
  cadmorph models/bore/base.step models/bore/base.step "$mesh" -o "out/same.${mesh##*.}" --quiet
  cmp "$mesh" "out/same.${mesh##*.}" || fail "an identity changes $mesh"
done
cadmorph models/bore/base.step models/bore/base.step out/case -o out/same_case --quiet
diff -r out/case out/same_case || fail "an identity changes the case"
