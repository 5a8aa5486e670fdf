#!/usr/bin/env bash
# Every check of this repository, in the order in which it is cheapest to fail: formatting, lints, tests, documentation
# and a minute of fuzzing. Needs a Rust toolchain; installs lavapipe, Mesa's software Vulkan, where it is missing, since
# the compute kernels are always tested on it: the same on every machine; and Mono, which compiles and runs C#.
#
#   bash tests/run.sh
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
PATH=$PATH:$HOME/.cargo/bin:/usr/sbin:/sbin
export CARGO_TERM_COLOR=${CARGO_TERM_COLOR:-auto} RUST_BACKTRACE=1
# Everything is compiled once: what makes the next build faster would only make this one slower.
export CARGO_INCREMENTAL=${CARGO_INCREMENTAL:-0}

summary=()
failures=0

# step NAME COMMAND...: runs it, and remembers how it ended and how long it took.
step() {
    local name=$1 begin=$SECONDS
    shift
    printf '\n== %s\n' "$name"
    if "$@"; then
        summary+=("$(printf 'passed  %4d s  %s' $((SECONDS - begin)) "$name")")
    else
        summary+=("$(printf 'FAILED  %4d s  %s' $((SECONDS - begin)) "$name")")
        failures=$((failures + 1))
    fi
}

# beside NAME COMMAND...: the same while the steps that follow run. `joined` waits for it and shows what it printed.
beside() {
    local begin=$SECONDS
    aside_name=$1
    shift
    {
        "$@" >"$aside/printed" 2>&1
        echo "$? $((SECONDS - begin))" >"$aside/ended"
    } &
}
joined() {
    local code seconds
    wait
    read -r code seconds <"$aside/ended"
    step "$aside_name, beside others ($seconds s)" eval "cat '$aside/printed'; [ $code = 0 ]"
}
aside=$(mktemp -d)
trap 'rm -rf "$aside"' EXIT

# The file by which the Vulkan loader finds lavapipe; nothing where it is not installed.
lavapipe() {
    find /usr/share/vulkan/icd.d /usr/local/share/vulkan/icd.d /etc/vulkan/icd.d -name 'lvp_icd*.json' 2>/dev/null | head -n 1
}

# installed PACKAGE...: of Debian and Ubuntu.
installed() {
    local as_root=()
    [ "$(id -u)" = 0 ] || as_root=(sudo)
    "${as_root[@]}" apt-get update -qq &&
        DEBIAN_FRONTEND=noninteractive "${as_root[@]}" apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

have_lavapipe() {
    [ -n "$(lavapipe)" ] && ldconfig -p | grep -q 'libvulkan\.so\.1'
}

install_lavapipe() {
    have_lavapipe && return
    if ! command -v apt-get >/dev/null; then
        echo 'lavapipe (software Vulkan) is missing and this is no Debian or Ubuntu: install it and run this again.'
        echo '  Fedora: dnf install mesa-vulkan-drivers vulkan-loader    Arch: pacman -S vulkan-swrast vulkan-icd-loader'
        return 1
    fi
    installed mesa-vulkan-drivers libvulkan1 || {
        echo 'lavapipe could not be installed: as root, run apt-get install mesa-vulkan-drivers libvulkan1'
        return 1
    }
    have_lavapipe
}

# For the C# file of the C interface. A test says that it is skipped where there is none.
install_mono() {
    command -v mcs >/dev/null && command -v mono >/dev/null && return
    command -v apt-get >/dev/null || return 0
    installed mono-mcs mono-runtime || echo 'Mono could not be installed: the C# file is not tested'
}

have_rust() {
    command -v cargo >/dev/null || { echo 'cargo is missing: install Rust from https://rustup.rs'; return 1; }
    cargo fmt --version && cargo clippy --version || rustup component add rustfmt clippy
}

# Runs the test programs that it reads, "FOLDER:PROGRAM" a line, so many at a time. Fuzzing comes later, guided by coverage.
run_programs() {
    tr '\n' '\0' | xargs -0 -n 1 -P "$1" bash -c '
        cd "${1%%:*}" || exit 1
        printed=$("${1#*:}" --quiet --skip fuzz:: 2>&1)
        code=$?
        printf "\n== %s\n%s\n" "$(basename "${1%-*}")" "$printed"
        exit $code' tests
}

# Every test. Two programs at a time, since some wait, for a kernel to be compiled or for a process that they kill, while
# others compute; the longest come first, and what needs the kernels of `gpu` behind it, when most are compiled. Those that
# live by the clock have the machine to themselves.
tests() {
    local messages programs name failed=0
    messages=$(cargo test --locked --workspace --features viewer --quiet --no-run --message-format json-render-diagnostics) || return 1
    programs=$(sed -n 's/.*"manifest_path":"\([^"]*\)\/Cargo.toml".*"profile":{[^}]*"test":true}.*"executable":"\([^"]*\)".*/\1:\2/p' <<<"$messages")
    local clock='/devices-[0-9a-f]*$' long='/(object|cli|contact|sweep|reliability|haptize|viewer)-[0-9a-f]*$'
    {
        for name in object cli contact sweep reliability haptize viewer; do grep -E "/$name-[0-9a-f]*$" <<<"$programs"; done
        grep -Ev "$long|$clock" <<<"$programs"
    } | RUST_TEST_THREADS=$(($(nproc) / 2 + 1)) run_programs 2 || failed=1
    grep -E "$clock" <<<"$programs" | run_programs 1 || failed=1
    cargo test --locked --workspace --features viewer --quiet --doc || failed=1
    return $failed
}

step 'Rust toolchain' have_rust
step 'lavapipe' install_lavapipe
step 'Mono' install_mono
# Vulkan sees lavapipe and nothing else; a test that finds no adapter fails.
VK_DRIVER_FILES=$(lavapipe)
export VK_DRIVER_FILES VK_ICD_FILENAMES=$VK_DRIVER_FILES

step 'formatting' cargo fmt --all --check
step 'lints' cargo clippy --locked --workspace --all-targets --features viewer --quiet -- -D warnings
# A test of the bindings brings the features of most that was checked before: a third of the crates are not checked again.
step 'lints, without the window' cargo clippy --locked --workspace --lib --bins --test header --quiet -- -D warnings
# The bindings are tested in the same build, so that what they share is compiled once.
step 'tests' tests
# It waits for downloads, and tests with one thread.
beside 'Python package' bash python/tests/run.sh
step 'documentation' env RUSTDOCFLAGS='-D warnings' cargo doc --locked --workspace --features viewer --no-deps --quiet
step 'documentation as a site' bash docs/site/build.sh
step 'its pages in a browser' python3 docs/site/browser.py target/pictures target/site/gallery/*.html
# Last, because it leaves a library and a program in which every block is counted.
step 'fuzzing, guided by coverage' bash tests/fuzz.sh
joined

printf '\n== summary (%d s)\n' "$SECONDS"
printf '%s\n' "${summary[@]}"
if [ "$failures" -gt 0 ]; then
    echo "$failures of ${#summary[@]} steps failed"
    exit 1
fi
echo 'all passed'
