"""A YAML file whose values know where they stand, so that messages name line and column."""

from __future__ import annotations

from typing import Any, NoReturn

import numpy as np

from rotfem.scene.blades.deck import Deck
from rotfem.scene.values import Array


def yaml_tree(deck: Deck) -> YamlNode:
    """Return the root of a YAML file.

    Raises:
        PydanticCustomError: it is not YAML, or empty.
    """
    import yaml

    try:
        root = yaml.compose(deck.text, Loader=_loader())
    except RecursionError:
        deck.fail("is nested too deeply")
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        what = getattr(error, "problem", None) or "no YAML"
        deck.fail(f"not valid YAML: {what}", *((mark.line + 1, mark.column + 1) if mark else ()))
    if root is None:
        deck.fail("is empty")
    return YamlNode(deck, root)


def _loader() -> Any:
    """Return a loader for which an anchor may be named again: YAML 1.2 allows it (section 3.2.2.2), PyYAML does not."""
    import yaml

    class Loader(yaml.SafeLoader):  # type: ignore[misc]
        def compose_node(self, parent: Any, index: Any) -> Any:
            if not self.check_event(yaml.AliasEvent):
                self.anchors.pop(self.peek_event().anchor, None)
            return super().compose_node(parent, index)

    return Loader


class YamlNode:
    """A value of a YAML file and its place.

    Args:
        deck: the file.
        node: as the parser composes it.
        path: keys that lead to it, joined by points.
    """

    def __init__(self, deck: Deck, node: Any, path: str = ""):
        self.deck, self.node, self.path = deck, node, path
        self.line, self.column = node.start_mark.line + 1, node.start_mark.column + 1

    def fail(self, reason: str) -> NoReturn:
        """Refuse the file here."""
        self.deck.fail(f"{self.path or 'the file'} {reason}", self.line, self.column)

    def get(self, key: str) -> YamlNode | None:
        """Return what stands at a key; None if nothing does."""
        if self.node.id != "mapping":
            self.fail("must be a mapping of keys to values")
        pairs = {name.value: value for name, value in self.node.value if name.id == "scalar"}
        return YamlNode(self.deck, pairs[key], f"{self.path}.{key}".lstrip(".")) if key in pairs else None

    def __getitem__(self, key: str) -> YamlNode:
        """Return what stands at a key, or at several that are joined by points; nothing is refused."""
        node = self
        for part in key.split("."):
            found = node.get(part)
            if found is None:
                node.fail(f"has no {part}")
            node = found
        return node

    def text(self) -> str:
        """Return a single value as it is written."""
        if self.node.id != "scalar":
            self.fail("must be a single value")
        return str(self.node.value)

    def number(self) -> float:
        """Return a finite number."""
        if self.node.id != "scalar":
            self.fail("must be a number")
        return self.deck.value(self.node.value, self.line, self.column)

    def entries(self) -> list[YamlNode]:
        """Return the entries of a list."""
        if self.node.id != "sequence" or not self.node.value:
            self.fail("must be a list that is not empty")
        return [YamlNode(self.deck, entry, f"{self.path}[{i}]") for i, entry in enumerate(self.node.value)]

    def numbers(self) -> Array:
        """Return the numbers of a list, (n,)."""
        return np.array([entry.number() for entry in self.entries()])

    def grid(self, count: int) -> Array:
        """Return the places (count,), from 0 to 1, of as many values."""
        grid = self.numbers()
        if len(grid) != count or len(grid) < 2:
            self.fail(f"has {len(grid)} places for {count} values")
        if grid[0] != 0.0 or not np.isclose(grid[-1], 1.0, rtol=1e-6) or np.any(np.diff(grid) <= 0.0):
            self.fail("must rise from 0 to 1")
        return grid
