#!/bin/sh
# Rays per second against Embree (ROBUST, single rays), round by round in one run: sh tests/bench/rays/run.sh
# RAYS_ROUNDS sets the rounds (9), RAYS_SCENES the scenes ("32 70k 1m"). Without Embree only our side is timed.
set -eu
cd "$(dirname "$0")/../../.."
out=target/embree_rays
mkdir -p target
rm -f "$out"
if printf '#include <embree3/rtcore.h>\n' | ${CXX:-c++} -x c++ -E - >/dev/null 2>&1; then
    ${CXX:-c++} -O3 -march=native -o "$out" tests/bench/rays/embree_rays.cpp -lembree3
    RAYS_EMBREE="$PWD/$out"
    export RAYS_EMBREE
else
    echo "Embree 3 not found (Debian: libembree-dev): timing our side alone" >&2
    unset RAYS_EMBREE
fi
exec cargo bench --bench rays
