#!/usr/bin/env bash
# Tests haptize.torch with PyTorch itself, of which Linux downloads some gigabytes, and prints the version that passed.
#
#   bash python/tests/torch.sh WHEEL [PYTHON]
set -euo pipefail
wheel=$(realpath "${1:?usage: torch.sh WHEEL [PYTHON]}")
cd "$(dirname "${BASH_SOURCE[0]}")"
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
"${2:-python3}" -m venv "$place/test"
"$place/test/bin/pip" --quiet --disable-pip-version-check install "$wheel" pytest torch==2.15.0
"$place/test/bin/pytest" --quiet --no-header -p no:cacheprovider -k torch test_array_field.py test_learning.py
"$place/test/bin/python" -c 'import torch; print("PyTorch", torch.__version__)'
