#!/bin/sh
# The photon grid beside a k-d tree and a plain hash grid: sh tests/bench/grid/run.sh
# GRID_ROUNDS sets the rounds (7), GRID_FOUND how many points a query finds ("1 10 100"), GRID_CELL the cells' side in radii (3).
set -eu
cd "$(dirname "$0")"
exec cargo run --release --target-dir ../../../target/grid-bench
