#!/usr/bin/env bash
# Runs the sample of every hard case and renews table and picture in docs/stability.md.
#
# bash docs/stability.sh [PROGRAM]    PROGRAM: a built haptize; without it one is built in release mode.
set -euo pipefail
cd "$(dirname "$0")/.."
if [ $# -gt 0 ]; then haptize=$(realpath "$1"); else cargo build --release; haptize=$PWD/target/release/haptize; fi
out=out/stability
# The table is renewed also where a figure breaks its bound: that is then to be seen.
"$haptize" stability -o "$out" || echo "not every figure keeps its bound"
cp "$out/stability.png" docs/figures/stability.png
# What stands between the two marks gives way to the new table.
sed -e '/<!-- table -->/,/<!-- end of table -->/ { /<!-- table -->/ { p; r '"$out/stability.md"'
}; /<!-- end of table -->/!d }' -i docs/stability.md
