#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Every check that needs no test run. $1 is the folder of the Python tools.
set -eu
bin=$1
. scripts/progress.sh
step() {
  echo "lint: $*" | cut -c1-100
  showing "build/lint.$$.log" "$@" || fail "lint: $1 failed"
  rm -f "build/lint.$$.log"
}

step python3 scripts/check_layers.py
sources=$(git ls-files '*.hpp' '*.cpp') # not in a pipe, where nobody would see git fail
echo "$sources" | step xargs clang-format --dry-run --Werror
sources=$(git ls-files '*CMakeLists.txt' '*.cmake')
echo "$sources" | step xargs "$bin/gersemi" --check
step "$bin/ruff" format --check --quiet .
step "$bin/ruff" check --quiet .
step "$bin/mypy" python/locfuse scripts papers examples/python benchmarks/run.py benchmarks/rows.py benchmarks/python tests/python tests/papers
# By itself: the packages for ROS 1 and ROS 2 have the same name.
step env MYPYPATH=ros1/locfuse_ros/src:tests/ros "$bin/mypy" ros1/locfuse_ros/src/locfuse_ros \
  tests/ros/conftest.py tests/ros/namespace.py tests/ros/other_driver.py tests/ros/ros1_peer.py tests/ros/soak_ros1.py tests/ros/test_ros1_*.py
# By itself, too: its conftest.py is not the only one.
step env MYPYPATH=tests/browser "$bin/mypy" tests/browser/*.py
step "$bin/codespell"
step "$bin/check-jsonschema" --builtin-schema vendor.github-workflows .github/workflows/*.yml
step "$bin/check-jsonschema" --builtin-schema vendor.github-issue-forms .github/ISSUE_TEMPLATE/[!c]*.yml
step "$bin/check-jsonschema" --builtin-schema vendor.github-issue-config .github/ISSUE_TEMPLATE/config.yml
step "$bin/check-jsonschema" --builtin-schema vendor.dependabot .github/dependabot.yml
step "$bin/lint-imports" --no-logo
step sh scripts/stubs.sh "$bin" --check
# Without precompiled headers, which are of another compiler than clang-tidy, and source by source.
to_check() { # folder, CMake options
  folder=$1
  shift
  cmake -S . -B "$folder" -G Ninja -DCMAKE_BUILD_TYPE=Debug -DCMAKE_EXPORT_COMPILE_COMMANDS=ON \
    -DLOCFUSE_BUILD_TESTS=OFF -DLOCFUSE_BUILD_EXAMPLES=OFF -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON \
    -DLOCFUSE_UNITY_BUILD=OFF "$@" >/dev/null
}
without="cpp/src/frontends/kd_tree_nanoflann.cpp cpp/src/without_ceres.cpp"
to_check build/lint-without -DLOCFUSE_WITH_PCL=OFF -DLOCFUSE_WITH_CERES=OFF
# shellcheck disable=SC2086
step "$bin/python" scripts/tidy.py build/lint-without $without
# Benchmarks, too, which no other check compiles.
to_check build/lint -DLOCFUSE_BUILD_BENCHMARKS=ON
sources=$(git ls-files 'cpp/src/*.cpp' 'benchmarks/cpp/bench_*.cpp')
for source in $without; do
  sources=$(echo "$sources" | grep -vx "$source")
done
echo "$sources" | step xargs "$bin/python" scripts/tidy.py build/lint
