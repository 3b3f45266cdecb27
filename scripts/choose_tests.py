# SPDX-License-Identifier: Apache-2.0
"""Choose the tests of a room or of a source file.

Usage: choose_tests.py cpp BUILD_FOLDER ROOM_OR_FILE | py PATH

`cpp` prints one line per test executable, its name and a filter for GoogleTest; `py` prints one
path per line for pytest. The tests of a source are those that mirror it by name; where there are
none, those that include or import it; where there are none either, those of its room.
"""

from __future__ import annotations

import json
import re
import sys
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CPP_TESTS = ROOT / "tests/cpp"
CPP_SOURCES = (ROOT / "cpp/src", ROOT / "cpp/include/locfuse")
# Sources of Python, the folder of their tests, and the name under which they are imported.
PYTHON_PARTS = (
    (ROOT / "python/locfuse", ROOT / "tests/python", "locfuse"),
    (ROOT / "papers", ROOT / "tests/papers", "papers"),
)
TEST = re.compile(r"^\s*(TEST|TEST_F|TEST_P|TYPED_TEST)\(\s*(\w+),\s*(\w+)", re.MULTILINE)


def mirrors(stem: str, siblings: Iterable[str], tests: Iterable[Path]) -> list[Path]:
    """Return the tests `test_STEM*` of which no sibling's name covers more.

    Where there are none, those of the name without its last word: mcl for mcl_scouts.
    """
    siblings, tests = set(siblings), list(tests)
    longer = [other for other in siblings if other.startswith(f"{stem}_")]

    def covers(name: str, test: Path) -> bool:
        return f"{test.stem}_".startswith(f"test_{name}_")

    found = sorted(
        test
        for test in tests
        if covers(stem, test) and not any(covers(other, test) for other in longer)
    )
    shorter = stem.rpartition("_")[0]
    return found if found or not shorter else mirrors(shorter, siblings, tests)


def cpp_tests(path: Path) -> list[Path]:
    """Return the test sources of a room, of a source or header, or of a test source."""
    if path.is_relative_to(CPP_TESTS) and path.is_file():
        return [path]
    for folder in (CPP_TESTS, *CPP_SOURCES):
        if path.is_relative_to(folder):
            inside = path.relative_to(folder)
            break
    else:
        hint = "; bindings are tested by ./dev test py tests/python/bindings"
        raise SystemExit(
            f"dev: {path.relative_to(ROOT)} is not a part of the C++ library or its tests"
            + (hint if path.is_relative_to(ROOT / "bindings") else "")
        )
    if path.is_dir():
        chosen = sorted((CPP_TESTS / inside).rglob("test_*.cpp"))
    else:
        room = CPP_TESTS / inside.parent
        siblings = {
            source.stem
            for folder in CPP_SOURCES
            for source in (folder / inside.parent).glob("*.?pp")
        }
        header = f'"{(Path("locfuse") / inside).with_suffix(".hpp")}"'
        chosen = (
            mirrors(inside.stem, siblings, room.glob("test_*.cpp"))
            or sorted(t for t in CPP_TESTS.rglob("test_*.cpp") if header in t.read_text())
            or sorted(room.glob("test_*.cpp"))
        )
    if not chosen:
        raise SystemExit(f"dev: {path.relative_to(ROOT)} has no tests in tests/cpp")
    return chosen


def resolve_cpp(name: str) -> Path:
    """Return the absolute path of a room or a file, by its name."""
    for path in (ROOT / name, CPP_TESTS / name, *(folder / name for folder in CPP_SOURCES)):
        if path.is_file() or (path.is_dir() and any(path.rglob("*.?pp"))):
            return path.resolve()
    rooms = ", ".join(
        sorted(path.name for path in CPP_TESTS.iterdir() if any(path.glob("**/test_*.cpp")))
    )
    raise SystemExit(f"dev: {name} is neither a file nor a room of the C++ library: {rooms}")


def cpp(build: Path, name: str) -> Iterable[str]:
    """Yield executables with filters, by the compile commands of a build folder."""
    executables: dict[Path, str] = {}
    for entry in json.loads((build / "compile_commands.json").read_text()):
        target = re.search(r" -o \S*CMakeFiles/(test_\w+)\.dir/", entry["command"])
        if target:
            executables[Path(entry["file"]).resolve()] = target[1]
    filters = defaultdict(list)
    for source in cpp_tests(resolve_cpp(name)):
        if source not in executables:
            raise SystemExit(f"dev: {source.relative_to(ROOT)} is not in tests/cpp/CMakeLists.txt")
        for macro, suite, test in TEST.findall(source.read_text()):
            if macro == "TYPED_TEST":
                filters[executables[source]].append(f"{suite}/*.{test}")
            elif macro == "TEST_P":
                filters[executables[source]].append(f"*{suite}.{test}/*")
            else:
                filters[executables[source]].append(f"{suite}.{test}")
    for executable, names in filters.items():
        yield f"{executable} {':'.join(names)}"


def python_tests(path: Path) -> list[Path]:
    """Return the tests of a package or a module, or a path of tests itself."""
    part = next((part for part in PYTHON_PARTS if path.is_relative_to(part[0])), None)
    if part is None:
        return [path]
    folder, tests, package = part
    inside = path.relative_to(folder)
    if path.stem == "__init__":
        inside, path = inside.parent, path.parent
    parts = [*inside.parts[:-1], inside.stem] if inside.parts else []
    if path.is_dir() and (tests / inside).is_dir():
        return [tests / inside]
    if not parts:
        return [tests]
    siblings = {source.stem for source in path.parent.glob("*.py")}
    found = mirrors(parts[-1], siblings, (tests / inside.parent).glob("test_*.py"))
    if found:
        return found
    module = re.escape(".".join([package, *parts]))
    parent = re.escape(".".join([package, *parts[:-1]]))
    imports = re.compile(
        rf"^\s*(?:from {module}\b|import {module}\b"
        rf"|from {parent} import (?:\([^)]*|[^\n(]*)\b{re.escape(parts[-1])}\b)",
        re.MULTILINE,
    )
    found = sorted(
        test
        for _, root, _ in PYTHON_PARTS
        for test in root.rglob("test_*.py")
        if imports.search(test.read_text())
    )
    if found:
        return found
    for room in inside.parents:
        if room.parts and (tests / room).is_dir():
            return [tests / room]
    raise SystemExit(f"dev: no test mirrors or imports {path.relative_to(ROOT)}")


def python(name: str) -> Iterable[str]:
    """Yield paths for pytest."""
    file, _, test = name.partition("::")
    path = (ROOT / file).resolve()
    if not path.exists():
        raise SystemExit(f"dev: {file} does not exist")
    if not path.is_relative_to(ROOT):
        raise SystemExit(f"dev: {file} is not in this checkout")
    for chosen in python_tests(path):
        yield f"{chosen.relative_to(ROOT)}{f'::{test}' if test else ''}"


def main() -> None:
    """Print what was chosen."""
    kind, *rest = sys.argv[1:]
    lines = cpp(Path(rest[0]), rest[1]) if kind == "cpp" else python(rest[0])
    print("\n".join(lines))


if __name__ == "__main__":
    main()
