#!/usr/bin/env bash
# Redraws the figures of docs/store.md. Takes some minutes.
#
# bash docs/store.sh
set -euo pipefail
cd "$(dirname "$0")/.."
for bench in store growth; do
    cargo bench --locked --bench "$bench"
done
cp out/store/store-{error,growth}.png docs/figures/
