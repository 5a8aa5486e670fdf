#!/usr/bin/env bash
# Tests haptize.torch, haptize.jax and the environment of Gymnasium with the libraries themselves, some gigabytes of downloads, and prints
# which versions of what passed.
#
#   bash python/tests/learners.sh WHEEL [PYTHON]
set -euo pipefail
wheel=$(realpath "${1:?usage: learners.sh WHEEL [PYTHON]}")
cd "$(dirname "${BASH_SOURCE[0]}")"
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
"${2:-python3}" -m venv "$place/test"
"$place/test/bin/pip" --quiet --disable-pip-version-check install "$wheel" pytest gymnasium h5netcdf jax netCDF4 torch xarray
"$place/test/bin/pytest" --verbose --no-header -p no:cacheprovider test_array_field.py test_learning.py test_dataset.py
"$place/test/bin/python" - <<'END'
from importlib.metadata import version

for library in ("numpy", "torch", "jax", "gymnasium", "xarray", "h5netcdf", "netCDF4"):
    print(f"{library:12} {version(library)}")
END
