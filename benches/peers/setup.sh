#!/usr/bin/env bash
# Makes the virtual environment of the Python peers in target/peers. Needs python3 and the network, once.
set -euo pipefail
cd "$(dirname "$0")/../.."
[ -x target/peers/bin/python ] || python3 -m venv target/peers
target/peers/bin/pip install --quiet numpy scipy interpn numba
target/peers/bin/python -c 'import scipy; print("SciPy", scipy.__version__, "in target/peers")'
