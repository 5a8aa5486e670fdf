#!/usr/bin/env bash
# Redraws the figure of docs/solids.md, and prints its numbers. Takes some minutes.
#
# bash docs/solids.sh
set -euo pipefail
cd "$(dirname "$0")/.."
cargo test --locked --release --test object errors_fall -- --ignored --nocapture
cp out/solids/solids-convergence.png docs/figures/
