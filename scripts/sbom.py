# SPDX-License-Identifier: Apache-2.0
"""Write what the package consists of as a CycloneDX bill of materials: ``sbom.py FILE``.

Its components are the Python packages that locfuse needs to run, as installed here, the Debian
packages of the libraries that its extension loads, and of the headers that are compiled into it.

``sbom.py FILE VERSION NAME=VERSION ...`` writes that of a wheel of that version, which has these
libraries inside.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.output.json import JsonV1Dot6
from packageurl import PackageURL
from packaging.requirements import Requirement

HEADERS = ("libeigen3-dev", "libboost-dev", "libflann-dev")
BUILD = ("pybind11",)  # headers, too


def needed(names: list[str]) -> Iterator[Distribution]:
    """Yield the distributions that some need, themselves included, each once."""
    seen: set[str] = set()
    while names:
        name = names.pop().lower().replace("_", "-")
        if name in seen:
            continue
        seen.add(name)
        try:
            found = distribution(name)
        except PackageNotFoundError:
            sys.exit(f"{name} is not installed; ./dev setup installs it")
        yield found
        for text in found.requires or []:
            requirement = Requirement(text)
            if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
                names.append(requirement.name)


def said(*command: str, check: bool = True) -> str:
    """Return the output of a command, which must succeed unless `check` is False."""
    return subprocess.run(command, capture_output=True, text=True, check=check).stdout


def owner_of(path: str) -> str:
    """Return the Debian package that a file is of.

    What /lib was before it became a link to /usr/lib is found by its old name only.
    """
    for name in (path, path.removeprefix("/usr")):
        if found := said("dpkg", "-S", name, check=False):
            return found.split(":")[0]
    sys.exit(f"no Debian package has {path}")


def loaded(library: str) -> list[str]:
    """Return the Debian packages of the libraries that one loads, in order of their names."""
    paths = {str(Path(path).resolve()) for path in re.findall(r"=> (/\S+)", said("ldd", library))}
    return sorted({owner_of(path) for path in paths})


def component(name: str, version: str, url: PackageURL) -> Component:
    """Return a library as a component."""
    return Component(name=name, version=version, purl=url, bom_ref=str(url),
                     type=ComponentType.LIBRARY)  # fmt: skip


def bill() -> Bom:
    """Return the bill of materials of the package as it is installed."""
    ours, *others = needed(["locfuse"])
    parts = [
        component(part.name, part.version, PackageURL("pypi", None, part.name, part.version))
        for part in (*others, *map(distribution, BUILD))
    ]
    for name in (*loaded(import_module("locfuse._core").__file__ or ""), *HEADERS):
        version = said("dpkg-query", "-W", "-f", "${Version}", name)
        parts.append(component(name, version, PackageURL("deb", "debian", name, version)))
    return consisting_of(ours.version, parts)


def bill_of_wheel(version: str, inside: list[str]) -> Bom:
    """Return the bill of materials of a wheel, with its libraries as NAME=VERSION."""
    parts = []
    for text in inside:
        name, _, of_it = text.partition("=")
        if not of_it:
            sys.exit(f"{text}: expected NAME=VERSION")
        parts.append(component(name, of_it, PackageURL("generic", None, name, of_it)))
    return consisting_of(version, parts)


def consisting_of(version: str, parts: list[Component]) -> Bom:
    """Return the bill of materials of a version of locfuse that consists of parts."""
    root = component("locfuse", version, PackageURL("pypi", None, "locfuse", version))
    bom = Bom()
    bom.metadata.component = root
    for part in parts:
        bom.components.add(part)
    bom.register_dependency(root, parts)
    return bom


if __name__ == "__main__":
    found = bill_of_wheel(sys.argv[2], sys.argv[3:]) if len(sys.argv) > 2 else bill()
    JsonV1Dot6(found).output_to_file(sys.argv[1], allow_overwrite=True, indent=1)
    print(f"{len(found.components)} components: {sys.argv[1]}")
