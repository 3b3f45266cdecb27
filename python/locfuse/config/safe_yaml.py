# SPDX-License-Identifier: Apache-2.0
"""Safe YAML without what its parser makes too much of."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import yaml

LONGEST_NUMBER = 300  # characters: it has a text then, and as powers of 60 it is a float
MOST_MERGED = 1000  # keys that a mapping takes from others, which may have taken them, too
_NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")
_MERGE = "tag:yaml.org,2002:merge"
HALF_OF_A_PAIR = re.compile("[\ud800-\udfff]")


class CarefulLoader(yaml.SafeLoader):
    """Refuses numbers and merges without measure, and halves of surrogate pairs."""

    def compose_scalar_node(self, anchor: Any) -> yaml.ScalarNode:
        node: yaml.ScalarNode = super().compose_scalar_node(anchor)
        if node.tag in _NUMBERS and len(node.value) > LONGEST_NUMBER:
            self.refuse(f"a number of {len(node.value)} characters is out of bounds", node)
        if HALF_OF_A_PAIR.search(node.value):
            self.refuse("half of a surrogate pair is no character", node)
        return node

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        merged = 0
        for taken in _taken_in(node):
            self.flatten_mapping(taken)
            merged += len(taken.value)
            if merged > MOST_MERGED:
                self.refuse(f"more than {MOST_MERGED} keys are merged", node)
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
