#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Builds the C++ targets the way OSS-Fuzz asks for: with $CXX, $CXXFLAGS and $LIB_FUZZING_ENGINE into
# $OUT, each with a zip of its corpus, and beside them the libraries they load. Run in the checkout.
# shellcheck disable=SC2154
set -eu

# PCL and Ceres are compiled with the compiler's usual standard library.
export CXXFLAGS="${CXXFLAGS//-stdlib=libc++/}"
build=${WORK:-$PWD/build}/oss_fuzz
cmake -S . -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=None -DCMAKE_CXX_COMPILER="$CXX" \
  -DCMAKE_BUILD_RPATH_USE_ORIGIN=ON "-DCMAKE_EXE_LINKER_FLAGS=-Wl,-rpath,'\$ORIGIN/lib'" \
  -DLOCFUSE_BUILD_TESTS=OFF -DLOCFUSE_BUILD_EXAMPLES=OFF -DLOCFUSE_BUILD_FUZZERS=ON \
  "-DLOCFUSE_FUZZING_ENGINE=$LIB_FUZZING_ENGINE"
cmake --build "$build"

mkdir -p "$OUT/lib"
for target in "$build"/fuzz/fuzz_*; do
  [ -f "$target" ] && [ -x "$target" ] || continue
  name=$(basename "$target")
  cp "$target" "$OUT"
  python3 -m zipfile -c "$OUT/${name}_seed_corpus.zip" "fuzz/corpus/${name#fuzz_}"/*
  ldd "$target" | awk '/=> \// {print $3}' | grep -v '/ld-linux\|/libc\.so\|/libm\.so' |
    xargs -r cp -n -t "$OUT/lib"
done
