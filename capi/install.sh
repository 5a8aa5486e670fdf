#!/bin/sh
# Installs the C interface under PREFIX: libraries, header, pkg-config file and CMake find module.
#
#   cargo build -p haptize-capi --profile dist && sh capi/install.sh PREFIX
#
# HAPTIZE_BUILT names the folder of the built libraries where that is not target/dist.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
prefix=${1:?usage: install.sh PREFIX}
built=${HAPTIZE_BUILT:-$here/../target/dist}
version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$here/Cargo.toml" | head -n 1)
abi=$(sed -n 's/^#define HZ_ABI \([0-9]*\).*/\1/p' "$here/include/haptize.h")

case $prefix in
    /*) ;;
    *) prefix=$PWD/$prefix ;;
esac
case $prefix in
    *[\"\$\\\#]* | *"
"*)
        echo "install.sh: pkg-config files cannot name a prefix with \", \$, \\, # or a line break: $prefix" >&2
        exit 1
        ;;
esac
mkdir -p "$prefix/include" "$prefix/lib/pkgconfig" "$prefix/share/haptize/cmake"
prefix=$(cd "$prefix" && pwd)
cp "$here/include/haptize.h" "$prefix/include/"
cp "$here/cmake/FindHaptize.cmake" "$prefix/share/haptize/cmake/"
cp "$built/libhaptize_capi.a" "$prefix/lib/libhaptize.a"
if [ -e "$built/libhaptize_capi.dylib" ]; then
    cp "$built/libhaptize_capi.dylib" "$prefix/lib/libhaptize.dylib"
    install_name_tool -id "$prefix/lib/libhaptize.dylib" "$prefix/lib/libhaptize.dylib"
else
    cp "$built/libhaptize_capi.so" "$prefix/lib/libhaptize.so.$abi"
    ln -sf "libhaptize.so.$abi" "$prefix/lib/libhaptize.so"
fi
# What sed would take for something else stands for itself.
escaped=$(printf '%s\n' "$prefix" | sed 's/[&|]/\\&/g')
sed -e "s|@PREFIX@|$escaped|" -e "s|@VERSION@|$version|" "$here/haptize.pc.in" > "$prefix/lib/pkgconfig/haptize.pc"
