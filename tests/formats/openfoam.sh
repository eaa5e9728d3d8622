# OpenFOAM cases of the bundled block. Sourced with: PROGRAM_FOLDER
source "$(dirname "${BASH_SOURCE[0]}")/../schedulers/common.sh" "$1"
# Debian's OpenFOAM has its settings here and no script that says so.
export WM_PROJECT_DIR=${WM_PROJECT_DIR:-/usr/share/openfoam}

need_openfoam() {
  need gmsh gmshToFoam checkMesh decomposePar
}

# make_case FOLDER: tetrahedra of models/bore/base.step.
make_case() {
  cp -r "$root/docs/formats/openfoam" "$1"
  gmsh "$root/docs/formats/bore.geo" -3 -format msh22 -o "$1/bore.msh" >"$1/gmsh.log"
  gmshToFoam -case "$1" "$1/bore.msh" >"$1/gmshToFoam.log"
}

# make_decomposed_case FOLDER: the same in three pieces, without the whole.
make_decomposed_case() {
  make_case "$1"
  decomposePar -case "$1" -constant >"$1/decomposePar.log"
  rm -r "$1/constant/polyMesh"
}
