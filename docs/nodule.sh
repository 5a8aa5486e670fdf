#!/usr/bin/env bash
# Redraws the figure of docs/nodule.md: datasets/nodule.toml and the same slab without its nodule, stroked alike.
#
# bash docs/nodule.sh [PROGRAM]    PROGRAM: a built haptize; without it one is built in release mode.
set -euo pipefail
cd "$(dirname "$0")/.."
if [ $# -gt 0 ]; then haptize=$(realpath "$1"); else cargo build --release; haptize=$PWD/target/release/haptize; fi
out=out/nodule
mkdir -p "$out"

# The plain slab: the scene without the table of the inclusion.
awk '/^\[\[object.elasticity.inclusion\]\]/ { skip = 1; next } /^\[/ { skip = 0 } !skip' datasets/nodule.toml >"$out/plain.toml"
cp datasets/slab.obj "$out"
"$haptize" bake datasets/nodule.toml -o "$out/nodule.haptize"
"$haptize" bake "$out/plain.toml" -o "$out/plain.haptize"
"$haptize" play "$out/nodule.haptize" --motion scrape --beside "$out/plain.haptize" -o "$out/stroke"
cp "$out/stroke/force.png" docs/figures/nodule-force.png
cp "$out/stroke/torque.png" docs/figures/nodule-torque.png
