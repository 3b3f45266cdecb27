# SPDX-License-Identifier: Apache-2.0
"""What the extension refuses, so that the process goes on: pickling, a second interpreter."""

from __future__ import annotations

import subprocess
import sys

import pytest

REFUSES_EVERY_PROTOCOL = """
import pickle
from locfuse import _core
made = [_core.Gate(0.9)]
for name, cls in vars(_core).items():
    if isinstance(cls, type) and type(cls) is type(_core.Gate):
        try:
            made.append(cls())
        except (TypeError, ValueError):  # needs arguments
            pass
        assert "__reduce__" in vars(cls) and "__reduce_ex__" in vars(cls), name
assert len(made) > 30, len(made)
for one in made:
    for attempt in (*(lambda p=p: pickle.dumps(one, p) for p in range(6)), one.__reduce__):
        try:
            attempt()
        except TypeError as error:
            assert f"cannot pickle '{type(one).__name__}' object" in str(error), error
        else:
            raise AssertionError(f"{one!r} was pickled")
assert pickle.loads(pickle.dumps(_core.Verdict.FUSED)) is _core.Verdict.FUSED
print("done")
"""

IN_A_SUB_INTERPRETER = """
try:
    import _interpreters as interpreters
    made = interpreters.create("legacy")
except ImportError:
    import _xxsubinterpreters as interpreters
    made = interpreters.create(isolated=False)
interpreters.run_string(made, '''
try:
    import locfuse._core
except ImportError as error:
    print(error)
''')
"""


def run(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_no_protocol_of_pickle_ends_the_process() -> None:
    assert run(REFUSES_EVERY_PROTOCOL) == "done\n"


@pytest.mark.skipif(sys.version_info >= (3, 13), reason="numpy itself refuses sub-interpreters")
def test_a_sub_interpreter_is_refused_and_does_not_hang() -> None:
    assert "main interpreter only" in run(IN_A_SUB_INTERPRETER)
