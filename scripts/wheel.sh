# shellcheck shell=sh disable=SC2154
# SPDX-License-Identifier: Apache-2.0
# Part of ./dev: wheels that need nothing but a Python, for x86-64 and aarch64. Compiled by zig, whose clang
# comes with the headers of any glibc; Ceres, built from Debian's sources with neither SuiteSparse nor LAPACK, is
# linked into the extension, and so is the C++ library.

wheels=build/wheels # the results; what they are built of is in build/wheel
glibc=2.17
platform=manylinux_2_17 # the tag of that

# What both wheels and tests need first: in build/wheel/ARCH a compiler, headers and Ceres.
prepare() { # x86_64 or aarch64
  need_base
  need_python "$(requirements wheel)"
  export CCACHE_COMPILERTYPE=clang
  make_toolchain "$1"
  build_ceres "$1"
}

folder_of() { # Python module
  $venv/bin/python -c "import $1; print($1.__path__[0])"
}

tag_of() { # Python
  "$1" -c 'import sys; print("cp%d%d" % sys.version_info[:2])'
}

# A compiler for a kind of processor, as CMake wants it: build/wheel/ARCH/toolchain.cmake.
make_toolchain() { # x86_64 or aarch64
  tools=$PWD/build/wheel/$1
  mkdir -p "$tools/include"
  zig=$(folder_of ziglang)/zig
  for tool in cc c++ ar ranlib; do
    target=
    case $tool in c*) target="-target $1-linux-gnu.$glibc" ;; esac
    # The version is here for ccache, which looks at this file and not behind it.
    printf '#!/bin/sh\n# zig %s\nexec "%s" %s %s "$@"\n' "$("$zig" version)" "$zig" "$tool" "$target" >"$tools/zig-$tool"
    chmod +x "$tools/zig-$tool"
  done
  cat >"$tools/toolchain.cmake" <<END
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR $1)
set(CMAKE_C_COMPILER $tools/zig-cc)
set(CMAKE_CXX_COMPILER $tools/zig-c++)
set(CMAKE_AR $tools/zig-ar)
set(CMAKE_RANLIB $tools/zig-ranlib)
END
  # Headers without those of this machine's C library beside them.
  for headers in eigen3 boost nanoflann.hpp; do
    ln -sfn "/usr/include/$headers" "$tools/include/$headers"
  done
  # Debian's Pythons have the sizes of their types there, which are the same on both kinds of processors.
  mkdir -p "$tools/include/$1-linux-gnu"
  for headers in "/usr/include/$(uname -m)-linux-gnu"/python3*; do
    [ ! -d "$headers" ] || ln -sfn "$headers" "$tools/include/$1-linux-gnu/"
  done
}

# The sources of the Ceres in Debian 12, signed: build/wheel/ceres-solver-*.
fetch_ceres() {
  ls -d build/wheel/ceres-solver-*/ >/dev/null 2>&1 && return 0
  apt=$PWD/build/wheel/apt
  mkdir -p "$apt/lists/partial" "$apt/cache/archives/partial"
  apt-get indextargets --format 'deb-src [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $(SITE) bookworm main' \
    'Created-By: Packages' 'Component: main' | grep '/debian bookworm' | sort -u | head -n 1 >"$apt/sources.list"
  [ -s "$apt/sources.list" ] || fail "apt has no archive of Debian in its sources, where those of Ceres would be"
  options="-o Dir::Etc::SourceList=$apt/sources.list -o Dir::Etc::SourceParts=/dev/null
    -o Dir::State::Lists=$apt/lists -o Dir::Cache=$apt/cache"
  # shellcheck disable=SC2086
  quietly "apt-get did not get the list of Debian's sources" apt-get $options update
  # shellcheck disable=SC2086
  (cd build/wheel && quietly "apt-get did not get the sources of Ceres" apt-get $options source --download-only ceres-solver)
  rm -rf build/wheel/unpacked
  mkdir build/wheel/unpacked
  tar -C build/wheel/unpacked -xf build/wheel/ceres-solver_*.orig.tar.*
  mv build/wheel/unpacked/* build/wheel
}

# A static Ceres in build/wheel/ARCH, that solves by Eigen and logs nothing.
build_ceres() { # x86_64 or aarch64
  [ -e "build/wheel/$1/lib/libceres.a" ] && return 0
  fetch_ceres
  echo "building Ceres for $1"
  quietly "CMake cannot configure Ceres" cmake -S build/wheel/ceres-solver-*/ -B "build/wheel/$1/ceres" -G Ninja \
    "-DCMAKE_TOOLCHAIN_FILE=$PWD/build/wheel/$1/toolchain.cmake" "-DCMAKE_INSTALL_PREFIX=$PWD/build/wheel/$1" \
    -DCMAKE_BUILD_TYPE=Release "-DCMAKE_CXX_FLAGS=$wheel_flags -fvisibility=hidden" \
    -DCMAKE_POSITION_INDEPENDENT_CODE=ON -DEigen3_DIR=/usr/share/eigen3/cmake -DEIGENSPARSE=ON \
    -DMINIGLOG=ON -DGFLAGS=OFF -DSUITESPARSE=OFF -DCXSPARSE=OFF -DLAPACK=OFF -DCUDA=OFF -DSCHUR_SPECIALIZATIONS=OFF \
    -DBUILD_TESTING=OFF -DBUILD_EXAMPLES=OFF -DBUILD_BENCHMARKS=OFF
  quietly "Ceres does not build" cmake --build "build/wheel/$1/ceres" --target install
}

# No debugging, and of Eigen nothing that is not under the MPL; what nobody calls is left out. On x86-64
# nothing needs zig's runtime, whose sine and exponential would be taken in place of the C library's; on aarch64, where
# Boost computes quantiles in long doubles that are emulated, they are.
wheel_flags="-g0 -DEIGEN_MPL2_ONLY -ffunction-sections -fdata-sections -fcomplex-arithmetic=improved"

# How CMake builds the library for a kind of processor.
wheel_options() { # x86_64 or aarch64
  tools=$PWD/build/wheel/$1
  echo "-DCMAKE_TOOLCHAIN_FILE=$tools/toolchain.cmake -DLOCFUSE_WITH_PCL=OFF -DCeres_DIR=$tools/lib/cmake/Ceres
    -DEigen3_DIR=/usr/share/eigen3/cmake -DLOCFUSE_NANOFLANN_INCLUDE_DIR=$tools/include
    -DBoost_NO_BOOST_CMAKE=ON -DBoost_INCLUDE_DIR=$tools/include"
}

# The texts of the licences of what is inside a wheel, which it carries.
collect_licences() {
  rm -rf build/wheel/licences
  mkdir -p build/wheel/licences
  zig_folder=$(folder_of ziglang)
  cp build/wheel/ceres-solver-*/LICENSE build/wheel/licences/Ceres
  cp /usr/share/doc/libeigen3-dev/copyright build/wheel/licences/Eigen # of which -DEIGEN_MPL2_ONLY takes what is MPL
  cp /usr/share/doc/libnanoflann-dev/copyright build/wheel/licences/nanoflann
  awk '/^License: BSL-1.0$/ { getline; if (/^ /) { found = 1; print; next } } found && /^ / { print; next } found { exit }' \
    /usr/share/doc/libboost1*-dev/copyright >build/wheel/licences/Boost
  cp "$zig_folder/lib/libcxx/LICENSE.TXT" build/wheel/licences/libc++
  cp "$zig_folder/lib/libunwind/LICENSE.TXT" build/wheel/licences/libunwind
  cp "$zig_folder/LICENSE" build/wheel/licences/compiler_rt
  cp "$(folder_of pybind11)"-*.dist-info/licenses/LICENSE \
    build/wheel/licences/pybind11
  grep -q "Boost Software License" build/wheel/licences/Boost || fail "the licence of Boost was not found"
}

# What is inside a wheel, as CycloneDX, which it carries (PEP 770). Of zig that is its libc++, libunwind and compiler_rt.
write_bill() {
  need_python "$(requirements sbom)"
  version_of() { dpkg-query -W -f '${source:Upstream-Version}' "$1"; }
  ceres=$(basename build/wheel/ceres-solver-*/)
  boost=$(sed -n 's/^#define BOOST_LIB_VERSION "\(.*\)"/\1/p' /usr/include/boost/version.hpp | tr _ .)
  zig=$("$(folder_of ziglang)/zig" version)
  quietly "the bill of materials cannot be written" $venv/bin/python scripts/sbom.py build/wheel/sbom.cdx.json \
    "$(sed -n 's/^  VERSION \([0-9.]*\)$/\1/p' CMakeLists.txt)" \
    "ceres-solver=${ceres#ceres-solver-}" "eigen=$(version_of libeigen3-dev)" "boost=$boost" \
    "nanoflann=$(version_of libnanoflann-dev)" "zig=$zig" \
    "pybind11=$($venv/bin/python -c 'import pybind11; print(pybind11.__version__)')"
}

# The Pythons that wheels are for: $WHEEL_PYTHON, or those of this machine that locfuse supports, one for each version.
pythons() {
  if [ -n "${WHEEL_PYTHON:-}" ]; then
    echo "$WHEEL_PYTHON"
    return
  fi
  for version in 3.10 3.11 3.12 3.13 3.14; do
    for found in "/usr/bin/python$version" "/usr/local/bin/python$version" \
      "${PYENV_ROOT:-$HOME/.pyenv}"/versions/"$version".*/bin/python \
      "$HOME"/.local/share/uv/python/cpython-"$version".*/bin/python"$version"; do
      if "$found" -c '
import ensurepip, os, sys, sysconfig, venv
os.stat(sysconfig.get_path("include") + "/Python.h")
assert sys.implementation.name == "cpython" and not sysconfig.get_config_var("Py_GIL_DISABLED")' 2>/dev/null; then
        echo "$found"
        break
      fi
    done
  done
}

build_wheel() { # x86_64 or aarch64, Python
  tag=$(tag_of "$2")
  own=build/wheel/$tag
  [ -x "$own/bin/python" ] || quietly "python3 -m venv failed" "$2" -m venv "$own"
  # shellcheck disable=SC2046
  quietly "pip could not install the packages" "$own/bin/python" -m pip install --progress-bar off \
    $(requirements build)
  echo "building the wheel of $tag for $1"
  settings=
  for option in $(wheel_options "$1") "-DCMAKE_CXX_COMPILER_LAUNCHER=ccache" \
    "-DPYTHON_MODULE_EXTENSION=.cpython-${tag#cp}-$1-linux-gnu.so" "-DLOCFUSE_LICENCES=$PWD/build/wheel/licences" \
    "-DLOCFUSE_SBOM=$PWD/build/wheel/sbom.cdx.json"; do
    settings="$settings --config-settings=cmake.define.${option#-D}"
  done
  # shellcheck disable=SC2086
  CMAKE_GENERATOR=Ninja quietly "the wheel does not build" "$own/bin/python" -m pip wheel . --verbose \
    --no-build-isolation --no-deps --wheel-dir $wheels $settings \
    --config-settings=build-dir="build/wheel/$1/$tag" \
    --config-settings=wheel.tags="$tag-$tag-${platform}_$1" \
    "--config-settings=cmake.define.CMAKE_CXX_FLAGS=$wheel_flags -isystem $PWD/build/wheel/$1/include" \
    "--config-settings=cmake.define.CMAKE_MODULE_LINKER_FLAGS=-Wl,--gc-sections"
}

build_wheels() { # x86_64, aarch64, both by default
  [ $# -gt 0 ] || set -- x86_64 aarch64
  [ -n "$(pythons)" ] || fail "there is no CPython 3.10 to 3.14 with its headers here; WHEEL_PYTHON names one"
  mkdir -p $wheels
  for arch in "$@"; do
    case $arch in x86_64 | aarch64) ;; *) fail "expected x86_64 or aarch64, got $arch" ;; esac
    prepare "$arch"
    collect_licences
    write_bill
    rm -f $wheels/*"_$arch.whl"
    pythons | while read -r found; do
      build_wheel "$arch" "$found" </dev/null
    done || exit 1
    for wheel in $wheels/*"_$arch.whl"; do
      check_wheel "$wheel"
    done
  done
}

check_wheel() { # file
  policy=$($venv/bin/auditwheel show "$1" | tr '\n' ' ')
  case $policy in
  *"is consistent with the following platform tag: \"${platform}_"*) ;;
  *) fail "auditwheel objects to $1: $policy" ;;
  esac
  [ "$(wc -c <"$1")" -le 6000000 ] || fail "$1 is larger than 6 MB"
  inside=$($venv/bin/python -m zipfile -l "$1")
  for part in locfuse/licences/Ceres .dist-info/sboms/sbom.cdx.json; do
    case $inside in *"$part"*) ;; *) fail "$1 holds no $part" ;; esac
  done
  ls -l "$1"
}

# Each wheel for this processor in an empty environment and folder, as a user has it: the demo, the help of every
# command; then the tests of the bindings and the golden runs.
test_wheels() {
  for wheel in "$wheels"/*"$(uname -m)".whl; do
    [ -e "$wheel" ] || fail "there is no wheel in $wheels: ./dev wheel"
    tag=$(basename "$wheel" | cut -d- -f3)
    found=$(pythons | while read -r candidate; do
      [ "$(tag_of "$candidate")" != "$tag" ] || echo "$candidate"
    done)
    [ -n "$found" ] || fail "there is no Python for $wheel"
    empty=$PWD/build/wheel/empty-$tag
    rm -rf "$empty" && mkdir -p "$empty/folder"
    began=$(date +%s)
    quietly "python3 -m venv failed" "$found" -m venv "$empty/venv"
    quietly "pip could not install the wheel" "$empty/venv/bin/python" -m pip install --progress-bar off "$wheel[plots]"
    (cd "$empty/folder" && quietly "locfuse demo failed" ../venv/bin/locfuse demo && [ -s out/demo/report.html ]) ||
      fail "locfuse demo wrote no report"
    echo "$tag: demo after $(($(date +%s) - began)) s from an empty environment"
    for command in $("$empty/venv/bin/python" -c 'from locfuse.cli.app import COMMANDS; print(*COMMANDS)'); do
      "$empty/venv/bin/locfuse" "$command" --help >/dev/null || fail "locfuse $command --help failed"
    done
    quietly "pip could not install the packages of the tests" "$empty/venv/bin/python" -m pip install --progress-bar off \
      $(requirements test)
    showing "build/wheel/$tag.log" "$empty/venv/bin/python" -m pytest -q -p no:cacheprovider \
      tests/python/bindings tests/python/test_golden.py || fail "a test of the wheel failed"
  done
}

# All C++ tests but those that build another project, compiled for aarch64 and run by qemu.
test_arm() {
  prepare aarch64
  need_debian qemu-user libc6-arm64-cross
  built=build/wheel/aarch64
  if [ ! -e $built/lib/libgtest.a ]; then
    echo "building GoogleTest for aarch64"
    quietly "CMake cannot configure GoogleTest" cmake -S /usr/src/googletest -B $built/gtest -G Ninja \
      "-DCMAKE_TOOLCHAIN_FILE=$PWD/$built/toolchain.cmake" "-DCMAKE_INSTALL_PREFIX=$PWD/$built" -DCMAKE_BUILD_TYPE=Release
    quietly "GoogleTest does not build" cmake --build $built/gtest --target install
  fi
  # shellcheck disable=SC2046
  build_cpp $built/tests -DCMAKE_BUILD_TYPE=Release "-DCMAKE_CXX_FLAGS=$wheel_flags" $(wheel_options aarch64) \
    -DLOCFUSE_BUILD_EXAMPLES=OFF "-DGTest_DIR=$PWD/$built/lib/cmake/GTest" \
    "-DCMAKE_CROSSCOMPILING_EMULATOR=/usr/bin/qemu-aarch64;-L;/usr/aarch64-linux-gnu"
  showing build/ctest-arm.log ctest --test-dir $built/tests --output-on-failure --no-tests=error --parallel 2 \
    --exclude-regex '^(Consumer|Portable)' || fail "a C++ test failed on aarch64"
}
