#!/usr/bin/env bash
# The window of `haptize view` as the README shows it, light and dark, and an imported arm. Needs no display; any Vulkan will do, software too.
#
#   bash docs/figures/screenshots.sh
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
HAPTIZE=${HAPTIZE:-cargo run --quiet --release --features viewer --}
$HAPTIZE view --motion press --time 2.2 --force --screenshot docs/figures/view-light.png
$HAPTIZE view --motion scrape --time 2.4 --dark --force --screenshot docs/figures/view-dark.png
# The arm of docs/robots.md, with its links' shapes.
folder=$(mktemp -d)
$HAPTIZE import tests/robots/arm.urdf --tip probe --lock roll=0.3 --spacing 0.02 -o "$folder/arm.toml"
$HAPTIZE bake "$folder/arm.toml" -o "$folder/arm.haptize"
$HAPTIZE view "$folder/arm.haptize" --force --screenshot docs/figures/import.png
rm -r "$folder"
