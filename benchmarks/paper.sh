#!/bin/sh
# Everything docs/results.md shows, in one go: sh benchmarks/paper.sh MESHES LIST TRAINING_MESHES RUN
# What is finished is not done again, so it can be stopped and started. CoACD takes most of the time.
set -eu
meshes=$1 list=$2 training=$3 run=$4

rlacd bench compare "$meshes" --list "$list" --out "$run/quick" --jobs 2
rlacd bench paper-table-1 "$meshes" --list "$list" --out "$run/quick" --jobs 2
rlacd bench paper-greedy "$meshes" --list "$list" --out "$run/quick" --jobs 2
rlacd bench paper-vhacd "$meshes" --list "$list" --out "$run/quick" --jobs 2
rlacd bench paper-table-2 "$meshes" --list "$list" --out "$run/quick" --jobs 2
rlacd bench paper-table-3 "$meshes" --list "$list" --out "$run/quick" --jobs 2

rlacd bench paper-discounts "$training" --out "$run/training"
for experiment in paper-rewards paper-encoding paper-curves; do
    rlacd bench "$experiment" "$training" --out "$run/training" --preset quick
done
