#!/usr/bin/env bash
# Redraws the instrument's figures of docs/real-objects.md from its logs, where they lie beside the repository. `haptize paper` draws
# the others.
#
# bash docs/real-objects.sh [PROGRAM]    PROGRAM: a built haptize; without it one is built in release mode.
set -euo pipefail
cd "$(dirname "$0")/.."
logs=../shared/real-logs
[ -d "$logs" ] || { echo "nothing to draw: the instrument's logs are not in $logs"; exit 1; }
if [ $# -gt 0 ]; then haptize=$(realpath "$1"); else cargo build --release; haptize=$PWD/target/release/haptize; fi
out=out/real-objects
mkdir -p "$out"

"$haptize" gridize "$logs"/*.txt --columns datasets/instrument.toml --step 0.02 -o "$out/instrument.haptize" \
    --held-out 0.1 --within inf --figures "$out/instrument"
cp "$out/instrument/torque.png" docs/figures/instrument-torque.png
cp "$out/instrument/hysteresis.png" docs/figures/instrument-hysteresis.png
