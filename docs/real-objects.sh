#!/usr/bin/env bash
# Redraws the figures of docs/real-objects.md from nothing: scans the simulated spongy block (10 to 20 s each), gridizes and
# feels it, and, where the instrument's logs lie beside the repository, imports them.
#
# bash docs/real-objects.sh [PROGRAM]    PROGRAM: a built haptize; without it one is built in release mode.
set -euo pipefail
cd "$(dirname "$0")/.."
if [ $# -gt 0 ]; then haptize=$(realpath "$1"); else cargo build --release; haptize=$PWD/target/release/haptize; fi
out=out/real-objects
mkdir -p "$out"

for name in sponge sponge_fabric sponge_side; do
    [ -f "$out/$name.csv" ] || "$haptize" scan "datasets/$name.toml" -o "$out/$name.csv"
    "$haptize" gridize "$out/$name.csv" --step 0.03 -o "$out/$name.haptize" --figures "$out/$name"
done
"$haptize" play "$out/sponge.haptize" --motion scrape --beside "$out/sponge_fabric.haptize" -o "$out/scrape"
"$haptize" play "$out/sponge_side.haptize" -o "$out/press"
cp "$out/sponge/gridized.png" docs/figures/sponge-gridized.png      # Fig. 4
cp "$out/scrape/force.png" docs/figures/sponge-scrape.png           # Fig. 8
cp "$out/press/press.png" docs/figures/sponge-side.png              # Fig. 9

logs=../shared/real-logs
if [ -d "$logs" ]; then
    "$haptize" gridize "$logs"/*.txt --columns datasets/instrument.toml --step 0.02 -o "$out/instrument.haptize" \
        --held-out 0.1 --figures "$out/instrument"
    cp "$out/instrument/torque.png" docs/figures/instrument-torque.png
    cp "$out/instrument/hysteresis.png" docs/figures/instrument-hysteresis.png
else
    echo "left out: the instrument's logs are not in $logs"
fi
