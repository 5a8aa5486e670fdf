#!/usr/bin/env bash
# The window of `haptize view` as the README shows it, light and dark. Needs no display; any Vulkan will do, software too.
#
#   bash docs/figures/screenshots.sh
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
HAPTIZE=${HAPTIZE:-cargo run --quiet --release --}
$HAPTIZE view --motion press --time 2.2 --screenshot docs/figures/view-light.png
$HAPTIZE view --motion scrape --time 2.4 --dark --screenshot docs/figures/view-dark.png
