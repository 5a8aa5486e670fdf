#!/usr/bin/env bash
# Builds the wheel, installs it in clean virtual environments with the oldest and the newest Python at hand, and runs its tests there, on
# NumPy 1.26 with the oldest. Says what it skips where there is no Python or no package index.
#
#   bash python/tests/run.sh
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
place=$(mktemp -d)
licences=$PWD/LICENSE-THIRD-PARTY
trap 'rm -rf "$place" "$licences"' EXIT

# Interpreters that the wheel is for, oldest first: those on the path, and those that pyenv keeps.
pythons() {
    local minor python
    for minor in 10 11 12 13 14; do
        for python in "python3.$minor" "$HOME/.pyenv/versions/3.$minor".*/bin/python; do
            if "$python" -c 'import ensurepip, venv' 2>/dev/null; then
                echo "$python"
                break
            fi
        done
    done
}

# environment NAME PYTHON PACKAGE...
environment() {
    "$2" -m venv "$place/$1" && "$place/$1/bin/pip" --quiet --disable-pip-version-check install "${@:3}"
}

mapfile -t found < <(pythons)
if [ ${#found[@]} -eq 0 ]; then
    echo 'skipped: no Python 3.10 or newer with venv; on Debian and Ubuntu install python3-venv'
    exit 0
fi
oldest=${found[0]} newest=${found[-1]}
if ! environment build "$newest" 'maturin>=1.9,<2'; then
    echo 'skipped: maturin cannot be installed; is there a network?'
    exit 0
fi

# Features that the tests ask of the package's dependencies, and the package does not: each has the engine compiled once more, for minutes.
features() {
    cargo tree --locked --prefix none -f '{p} [{f}]' "$@" | sed 's/ (\*)$//' | sort -u
}
twice=$(comm -13 <(features --workspace --features viewer -e all) <(features -p haptize-python --features as-tested -e normal,build) |
    { grep -v '^haptize-python ' || true; })
if [ -n "$twice" ]; then
    echo 'these would be compiled twice, and the engine with them: give as-tested in python/Cargo.toml the features that the workspace has of them'
    echo '(cargo tree --workspace --features viewer -e all -f "{p} [{f}]")'
    sed 's/^/  /' <<<"$twice"
    exit 1
fi

# The texts of the licences of all that is compiled in, as the wheels of a release have them.
"$newest" ../.ci/notices.py haptize-python > "$licences"
# The profile and the features of the tests, so that what they have compiled is used.
"$place/build/bin/maturin" build --quiet --locked --profile dev --features as-tested --compatibility linux --auditwheel skip --compression-method stored --out "$place"
wheel=$(ls "$place"/haptize-*.whl)
echo "built $(basename "$wheel")"

# tested PYTHON PACKAGE...
tested() {
    echo "with $("$1" --version), ${*:2}"
    environment test "$1" pytest "$wheel" "${@:2}"
    # Not `python -m`, which would look for the package in this folder first, where it is not built.
    local pytest=("$place/test/bin/pytest" --quiet -p no:cacheprovider) forking=(tests/test_fork.py tests/test_package.py)
    # What forks has a process in which JAX has begun no threads.
    "${pytest[@]}" "${forking[@]}"
    "${pytest[@]}" "${forking[@]/#/--ignore=}" tests
}

tested "$oldest" 'numpy<2'
rm -rf "$place/test"
tested "$newest" 'numpy>=2' mypy matplotlib h5py h5netcdf netCDF4 xarray gymnasium 'jax==0.10.2; python_version >= "3.11"'
echo 'skipped: haptize.torch, since PyTorch is gigabytes; bash python/tests/torch.sh WHEEL tests it'
cd "$place" && test/bin/stubtest haptize._haptize
