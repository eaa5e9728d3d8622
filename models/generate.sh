#!/usr/bin/env bash
# Builds the generator and writes all models anew: CAD at the base and 20 steps, meshes, small
# shapes. Writes into OUTDIR alone.
# Usage: models/generate.sh [OUTDIR [options]]   (default: out/models; --family NAME, --step N)
set -euo pipefail
out=$(realpath --canonicalize-missing "${1:-$(dirname "$0")/../out/models}")
cd "$(dirname "$0")/.."

scripts/install-dependencies --models
scripts/build -DCADMORPH_BUILD_MODELS=ON cadmorph-models
mkdir -p "$out"
build/models/cadmorph-models "$out" "${@:2}"
