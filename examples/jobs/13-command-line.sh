#!/bin/sh
# The command line alone: a motion, a cycle, a branch, and a map that is interrupted and resumed, of
# the model file next to this script, and the results as CSV files. Prints the output of each command;
# takes half a minute. POINTS is the resolution of the map.
set -e
MODEL="$(dirname "$0")/13-crate.toml"
POINTS="${POINTS:-400}"

stickslip run "$MODEL" --set V=0.3
stickslip cycle "$MODEL"
stickslip branch "$MODEL" --over V=0.05:1 --cycle

sweep="stickslip sweep $MODEL --over V=0.05:1:$POINTS --over mu_s=0.31:0.8:$POINTS --measure period --out crate.zarr"
timeout -s INT "${SECONDS_BEFORE:-6}" $sweep || echo "interrupted, as by Ctrl-C"
$sweep # resumed by the same command

stickslip export out/crate/trajectory.nc --out crate-motion.csv --quantity x --quantity d_x --step 0.01
stickslip export crate.zarr --out crate-map.csv
head -3 crate-motion.csv crate-map.csv
