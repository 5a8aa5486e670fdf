#!/usr/bin/env bash
# Fuzzes every reader, guided by coverage, with a stable compiler.
#
#   bash tests/fuzz.sh [EXECUTIONS]      of each target
#
# The library and its tests are compiled with a counter in every block (LLVM's SanitizerCoverage, which cargo-fuzz uses, too);
# what they depend on is taken as it is.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# Cargo calls this script itself for each crate of the workspace: with the compiler and its arguments.
if [[ ${1:-} == *rustc* ]]; then
    case " $* " in
    *' --crate-name haptize '*' --crate-type lib '* | *' --crate-name reliability '*)
        exec "$@" -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=3 \
            -Cllvm-args=-sanitizer-coverage-inline-8bit-counters ;;
    # The program has the library's counters, and nobody who reads them.
    *' --crate-name haptize '*' --crate-type bin '*) exec "$@" -Clink-arg="$HAPTIZE_FUZZ_LINK" ;;
    *) exec "$@" ;;
    esac
fi

executions=${1:-17500}
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
echo 'void __sanitizer_cov_8bit_counters_init(char *first, char *end) { (void)first; (void)end; }' |
    cc -x c -c -o "$place/no_counters.o" -
export HAPTIZE_FUZZ_LINK=$place/no_counters.o
export RUSTC_WORKSPACE_WRAPPER=$PWD/tests/fuzz.sh
HAPTIZE_FUZZ=$executions cargo test --locked --workspace -p haptize --features viewer --test reliability -- fuzz --nocapture --test-threads 1
