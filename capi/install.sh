#!/bin/sh
# Installs the C interface under PREFIX: libraries, header, and what pkg-config and CMake read. PREFIX may be moved later.
#
#   cargo build -p haptize-capi --profile dist && sh capi/install.sh PREFIX
#
# HAPTIZE_BUILT names the folder of the built libraries where that is not target/dist. On Windows a shell comes with Git.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
prefix=${1:?usage: install.sh PREFIX}
built=${HAPTIZE_BUILT:-$here/../target/dist}
version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$here/Cargo.toml" | head -n 1)
abi=$(sed -n 's/^#define HZ_ABI \([0-9]*\).*/\1/p' "$here/include/haptize.h")

case $prefix in
    -*) prefix=./$prefix ;;
esac
mkdir -p "$prefix/include" "$prefix/lib/pkgconfig" "$prefix/lib/cmake/Haptize"
cp "$here/include/haptize.h" "$prefix/include/"
cp "$here/cmake/HaptizeConfig.cmake" "$prefix/lib/cmake/Haptize/"
# versioned FILE INSTALLED
versioned() {
    sed "s|@VERSION@|$version|" "$here/$1" > "$prefix/lib/$2"
}
versioned cmake/HaptizeConfigVersion.cmake.in cmake/Haptize/HaptizeConfigVersion.cmake
versioned haptize.pc.in pkgconfig/haptize.pc
if [ -e "$built/haptize_capi.dll" ]; then
    mkdir -p "$prefix/bin"
    cp "$built/haptize_capi.dll" "$prefix/bin/"
    cp "$built/haptize_capi.dll.lib" "$prefix/lib/haptize.lib"
elif [ -e "$built/libhaptize_capi.dylib" ]; then
    cp "$built/libhaptize_capi.a" "$prefix/lib/libhaptize.a"
    cp "$built/libhaptize_capi.dylib" "$prefix/lib/libhaptize.dylib"
    install_name_tool -id @rpath/libhaptize.dylib "$prefix/lib/libhaptize.dylib"
else
    cp "$built/libhaptize_capi.a" "$prefix/lib/libhaptize.a"
    cp "$built/libhaptize_capi.so" "$prefix/lib/libhaptize.so.$abi"
    ln -sf "libhaptize.so.$abi" "$prefix/lib/libhaptize.so"
fi
