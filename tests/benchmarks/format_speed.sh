#!/usr/bin/env bash
# Reading and writing a block of N^3 nodes in many formats, against a copy of the bytes and against
# meshio's reader: format_speed.sh BUILD_FOLDER [N]
set -euo pipefail
here=$(dirname "$(realpath "$0")")
program=$(realpath "$1")/tests/benchmarks/format_speed
n=${2:-100}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$scratch"
cat >block.geo <<GEO
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 1, 1};
Transfinite Curve {:} = $n;
Transfinite Surface {:};
Transfinite Volume {:};
Physical Volume("block") = {1};
Physical Surface("skin") = {1:6};
GEO
make() { gmsh block.geo -3 -o "$@" >/dev/null; }
make block.su2
make block.msh -format msh41
make block22.msh -format msh22
make block22b.msh -format msh22 -bin
make block41b.msh -format msh41 -bin
make block.inp
make block.bdf
make block.mesh
/usr/bin/python3 "$here/format_speed_files.py" "$n"
"$program" block*.*[!o] foam
for file in block.su2 block.msh block22.msh block22b.msh block.inp block.mesh; do
  /usr/bin/time -f "meshio reads $file: %e s, %U s CPU" /usr/bin/python3 -c \
    "import meshio; meshio.read('$file')" 2>&1 | tail -1
done
