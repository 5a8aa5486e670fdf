#!/usr/bin/env bash
# What a look-up costs from Rust, C and Python, on this machine in one run: one after the other, and a million in a batch on all cores; and what
# memory the dataset takes in Python.
#
#   bash benches/bindings.sh DATASET [PYTHON]        # a Python with the package installed, built alike; by default python3
#
# PROFILE names another profile than dist.
set -euo pipefail
dataset=$(realpath "${1:?usage: bindings.sh DATASET [PYTHON]}")
python=${2:-python3}
cd "$(dirname "${BASH_SOURCE[0]}")/.."
profile=${PROFILE:-dist}
built=${CARGO_TARGET_DIR:-target}/$([ "$profile" = dev ] && echo debug || echo "$profile")
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
cargo build --quiet --locked --workspace -p haptize-capi --profile "$profile" --lib --example time
HAPTIZE_BUILT=$built sh capi/install.sh "$place"
cc -std=c99 -O2 -Wall -Wextra -Werror -pedantic -I"$place/include" capi/examples/time.c -L"$place/lib" -lhaptize -o "$place/time"
"$built/examples/time" "$dataset"
LD_LIBRARY_PATH=$place/lib "$place/time" "$dataset"
# From elsewhere, where this repository's sources are not taken for the package.
here=$PWD
cd "$place"
"$python" "$here"/python/examples/time_look_up.py "$dataset"
