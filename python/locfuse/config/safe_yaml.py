# SPDX-License-Identifier: Apache-2.0
"""SafeLoader with limits on size, merge keys and number length."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import yaml

MAX_LETTERS = 2_000_000  # some 20 s and 300 MB
MAX_NUMBER_LENGTH = 300  # characters: still printable, and a float as powers of 60
MAX_MERGED_KEYS = 1000  # per mapping, nested merges included
_NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")
_MERGE = "tag:yaml.org,2002:merge"
HALF_OF_A_PAIR = re.compile("[\ud800-\udfff]")


class StrictYamlLoader(yaml.SafeLoader):
    """SafeLoader with limits on size, merge keys and number length, without unpaired surrogates."""

    def __init__(self, text: str | bytes) -> None:
        if len(text) > MAX_LETTERS:
            raise yaml.YAMLError(f"{len(text)} characters of YAML, expected at most {MAX_LETTERS}")
        super().__init__(text)

    def compose_scalar_node(self, anchor: Any) -> yaml.ScalarNode:
        node: yaml.ScalarNode = super().compose_scalar_node(anchor)
        if node.tag in _NUMBERS and len(node.value) > MAX_NUMBER_LENGTH:
            self.refuse(f"a number of {len(node.value)} characters is out of bounds", node)
        if HALF_OF_A_PAIR.search(node.value):
            self.refuse("half of a surrogate pair is not a character", node)
        return node

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        merged = 0
        for taken in _taken_in(node):
            self.flatten_mapping(taken)
            merged += len(taken.value)
            if merged > MAX_MERGED_KEYS:
                self.refuse(f"more than {MAX_MERGED_KEYS} keys are merged", node)
        super().flatten_mapping(node)

    def refuse(self, problem: str, node: yaml.Node) -> None:
        """Raise the error that names the line of a node."""
        raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark)


def _taken_in(node: yaml.MappingNode) -> Iterator[yaml.MappingNode]:
    """Yield the mappings that a mapping merges, once more for each time it names them."""
    for key, value in node.value:
        if key.tag == _MERGE:
            named = value.value if isinstance(value, yaml.SequenceNode) else [value]
            yield from (each for each in named if isinstance(each, yaml.MappingNode))
