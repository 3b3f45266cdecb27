#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Regenerates python/locfuse/_core.pyi, or with --check fails if it is out of date.
set -eu
bin=$1
out=build/stubs
rm -rf $out
"$bin/pybind11-stubgen" locfuse._core --output-dir $out --numpy-array-use-type-var \
  --exit-code >/dev/null
# pybind11-stubgen writes members of native enums as annotations, which type checkers do not accept. That
# no class can be pickled is not repeated for each.
sed -i -e 's/^    \([A-Z][A-Z0-9_]*\): typing.ClassVar\[.*\]$/    \1 = .../' \
  -e '/^    @classmethod$/{N;N;/def __new__(cls, value)/d}' \
  -e '/^    @staticmethod$/{N;/def __reduce/{N;N;N;d}}' \
  -e 's/__hash__: typing.ClassVar\[None\] = None/&  # type: ignore[assignment]/' \
  -e '/^    def __format__(self, format_spec):$/{N;d}' $out/locfuse/_core.pyi
"$bin/ruff" format -q --config 'line-length = 100' $out/locfuse/_core.pyi
if [ "${2:-}" = --check ]; then
  cmp -s $out/locfuse/_core.pyi python/locfuse/_core.pyi || {
    echo "python/locfuse/_core.pyi is out of date: run scripts/stubs.sh $bin" >&2
    exit 1
  }
else
  cp $out/locfuse/_core.pyi python/locfuse/_core.pyi
fi
