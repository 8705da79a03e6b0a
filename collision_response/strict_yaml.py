"""YAML as nested lists, mappings, numbers and text, with nothing said twice.

PyYAML takes the last of equal keys, and leaves some of what it cannot read to the exceptions of Python.
"""

from __future__ import annotations

from typing import Any

import yaml
from yaml import YAMLError as YAMLError
from yaml.constructor import ConstructorError
from yaml.nodes import MappingNode, Node, ScalarNode


class _Loader(yaml.SafeLoader):  # type: ignore[misc]
    """Dates are text, as they are written."""

    def compose_mapping_node(self, anchor: Any) -> MappingNode:
        node = super().compose_mapping_node(anchor)
        keys = set()
        for key, _ in node.value:
            if isinstance(key, ScalarNode):
                if (key.tag, key.value) in keys:
                    raise ConstructorError(None, None, f"{key.value!r} is there twice", key.start_mark)
                keys.add((key.tag, key.value))
        return node

    def construct_object(self, node: Node, deep: bool = False) -> Any:
        try:
            return super().construct_object(node, deep)
        except (ValueError, LookupError, OverflowError):
            kind = node.tag.rpartition(":")[2]
            raise ConstructorError(None, None, f"cannot be read as {kind}", node.start_mark) from None


_Loader.add_constructor("tag:yaml.org,2002:timestamp", yaml.SafeLoader.construct_yaml_str)


def load_yaml(text: str) -> Any:
    """What a document holds.

    Raises:
        YAMLError: it is none.
    """
    try:
        return yaml.load(text, _Loader)
    except RecursionError:
        raise YAMLError("it is nested too deeply") from None
