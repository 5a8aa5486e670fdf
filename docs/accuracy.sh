#!/usr/bin/env bash
# Redraws the figures of docs/accuracy.md. Takes some minutes.
#
# bash docs/accuracy.sh [PROGRAM]    PROGRAM: a built haptize; without it one is built in release mode.
set -euo pipefail
cd "$(dirname "$0")/.."
if [ $# -gt 0 ]; then haptize=$(realpath "$1"); else cargo build --release; haptize=$PWD/target/release/haptize; fi
out=out/accuracy
"$haptize" accuracy datasets/sphere.toml --points 460000 -o "$out"
cp "$out"/accuracy-{spacing,time,refinement}.png docs/figures/
