# SPDX-License-Identifier: Apache-2.0
"""Marks of checks that have passed, by the content of all they depend on.

A mark is an empty file named by a digest, in the user's cache, where it survives the checkout. It
counts for a week, and not at all where LOCFUSE_CHECK_ALL is set.
"""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Iterable
from pathlib import Path

WEEK_S = 7 * 24 * 3600.0
CACHE = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))


class Passed:
    """The marks of one kind of check."""

    def __init__(self, kind: str) -> None:
        self._folder = CACHE / f"locfuse-{kind}"
        self._folder.mkdir(parents=True, exist_ok=True)
        for mark in self._folder.iterdir():
            if time.time() - mark.stat().st_mtime > WEEK_S:
                mark.unlink(missing_ok=True)

    def has(self, digest: str) -> bool:
        """Return whether a check of this digest has passed within the last week."""
        return not os.environ.get("LOCFUSE_CHECK_ALL") and (self._folder / digest).exists()

    def add(self, digest: str) -> None:
        """Remember that a check of this digest has passed."""
        (self._folder / digest).touch()


def digest_of(settings: bytes, files: Iterable[Path]) -> str:
    """Return the SHA-256 of settings and of the content of files, in their order."""
    whole = hashlib.sha256(settings)
    for file in files:
        data = file.read_bytes()
        whole.update(f"{len(data)} ".encode())
        whole.update(data)
    return whole.hexdigest()
