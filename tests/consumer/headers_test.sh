#!/usr/bin/env bash
# Each public header compiles alone, with Eigen and the standard library as all that it needs, and
# no other header is installed: headers_test.sh INCLUDE_FOLDER COMPILER EIGEN
set -euo pipefail
include=$1
compiler=$2
eigen=$3

headers=$(cd "$include" && find . -name '*.h' | sed 's|^./||' | sort)
if (($(wc -l <<<"$headers") > 14)); then
  echo "more headers than a dozen or so are public: $headers" >&2
  exit 1
fi
for header in $headers; do
  if [[ $header != cadmorph/* ]]; then
    echo "$header lies outside of cadmorph/" >&2
    exit 1
  fi
  "$compiler" -std=c++20 -Wall -Wextra -Werror -fsyntax-only -I "$include" -isystem "$eigen" \
    -include "$header" -x c++ /dev/null
done
others=$(grep -hE '^#include <' -r "$include" | sort -u | grep -E '\.(h|hxx|hpp)>' || true)
if [[ -n $others ]]; then
  echo "public headers include $others" >&2
  exit 1
fi
