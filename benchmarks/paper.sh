#!/bin/sh
# Everything research/comparison.md shows, in one go: sh benchmarks/paper.sh MESHES LIST TRAINING_MESHES RUN
# What is finished is not done again, so it can be stopped and started. CoACD takes most of the time.
# Then  python benchmarks/results.py RUN research/comparison.md  puts the tables into the document.
set -eu
meshes=$1 list=$2 training=$3 run=$4

rlacd bench compare "$meshes" --list "$list" --out "$run/quick" --jobs 2 --limit 3600
rlacd bench paper-table-1 "$meshes" --list "$list" --out "$run/quick" --jobs 2 --limit 3600 --close 0.04
for page in paper-greedy paper-vhacd; do
    rlacd bench "$page" "$meshes" --list "$list" --out "$run/quick" --jobs 2
done
for page in paper-table-2 paper-table-3; do
    rlacd bench "$page" "$meshes" --list "$list" --out "$run/quick" --jobs 2 --threshold 0.1
done

rlacd bench paper-discounts "$training" --out "$run/training"
for page in paper-rewards paper-encoding paper-curves; do
    rlacd bench "$page" "$training" --out "$run/training" --preset quick
done
