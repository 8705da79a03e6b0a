"""Read YAML as nested lists, mappings, numbers and text; duplicate keys are errors.

PyYAML alone would keep the last of several equal keys, and would raise exceptions other than ``YAMLError``
for some values that it cannot read. It also takes ``1e7`` and ``-.5`` for text, and follows YAML 1.1, in
which ``1:30`` is 90, ``010`` is 8 and ``1_0`` is 10. Here ``1e7`` and ``-.5`` are numbers, as in YAML 1.2,
and the others are errors.
"""

from __future__ import annotations

import re
from typing import Any

from .optional import missing

try:
    import yaml
    from yaml import YAMLError as YAMLError
    from yaml.constructor import ConstructorError
    from yaml.nodes import MappingNode, Node, ScalarNode
except ModuleNotFoundError:
    raise missing("PyYAML", "pyyaml") from None


class _Loader(yaml.SafeLoader):  # type: ignore[misc]
    """Refuses duplicate keys, and reads dates as text."""

    def compose_mapping_node(self, anchor: Any) -> MappingNode:
        node = super().compose_mapping_node(anchor)
        keys = set()
        for key, _ in node.value:
            if isinstance(key, ScalarNode):
                if (key.tag, key.value) in keys:
                    raise ConstructorError(None, None, f"{key.value!r} appears twice", key.start_mark)
                keys.add((key.tag, key.value))
        return node

    def construct_object(self, node: Node, deep: bool = False) -> Any:
        try:
            value = super().construct_object(node, deep)
            if isinstance(value, str):
                value.encode()  # half of a surrogate pair is no text
            return value
        except (ValueError, LookupError, OverflowError):
            kind = node.tag.rpartition(":")[2]
            hint = "" if kind == "str" else ": quote it if it is text"
            raise ConstructorError(None, None, f"cannot be read as {kind}{hint}", node.start_mark) from None

    def construct_int(self, node: Node) -> int:
        if "_" in self.construct_scalar(node):
            raise ValueError
        return int(self.construct_scalar(node), 0)

    def construct_float(self, node: Node) -> float:
        if set(":_").intersection(self.construct_scalar(node)):
            raise ValueError
        return self.construct_yaml_float(node)


TAG = "tag:yaml.org,2002:"
_FLOAT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$|[-+]\.\d+$")
_Loader.add_implicit_resolver(f"{TAG}float", _FLOAT, list("-+.0123456789"))
_Loader.add_constructor(f"{TAG}int", _Loader.construct_int)
_Loader.add_constructor(f"{TAG}float", _Loader.construct_float)
_Loader.add_constructor(f"{TAG}timestamp", _Loader.construct_yaml_str)


def load_yaml(text: str) -> Any:
    """Return the contents of a YAML document.

    Raises:
        YAMLError: if ``text`` is not valid YAML, has a duplicate key or is nested too deeply.
    """
    try:
        return yaml.load(text, _Loader)
    except RecursionError:
        raise YAMLError("the document is nested too deeply") from None
