"""A blade in a windIO file (YAML): reference axis, twist and the 6×6 matrices of `elastic_properties_mb`.

It is windIO of the first version, in which the ontology of IEA Wind Task 37 has its reference turbines and angles are
in radians; files that name a later version are refused. `grid` is a part of the arc length; x, y and z are the axes of
OpenFAST, and so is the order of the matrices, of which a row holds the upper triangle.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rotfem.registry import register
from rotfem.scene.blades.axes import FROM_IEC, iec_pretwist, rows_over, scaled_rows, turned_matrix
from rotfem.scene.blades.deck import Deck
from rotfem.scene.blades.formats import Asked, BladeFormat
from rotfem.scene.reference_line import as_line, line_through
from rotfem.scene.values import Array

#: Where the matrices are, below the components.
PLACE = ("components", "blade", "elastic_properties_mb", "six_x_six")

#: Key that later versions have.
VERSION = "windIO_version"


def recognises(deck: Deck) -> bool:
    """Return whether it is a YAML file with a blade among its components."""
    return deck.path.suffix.lower() in (".yaml", ".yml") and all(f"{word}:" in deck.text for word in PLACE[:2])


def read(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return line, pretwist and section."""
    tree = _Node(deck, _composed(deck))
    if (version := tree.get(VERSION)) is not None:
        version.fail(f"is {version.node.value}; known are files of the first version, without it")
    properties = tree
    for key in PLACE:
        properties = properties[key]
    axis = {name: properties["reference_axis"][name] for name in "xyz"}
    for part in axis.values():
        part["grid"].check_grid(len(part["values"].numbers()))
    grid = axis["z"]["grid"].numbers()
    values = [np.interp(grid, part["grid"].numbers(), part["values"].numbers()) for part in axis.values()]
    line = np.stack(values, axis=-1) @ FROM_IEC.T
    line -= line[0]
    through = line_through(as_line(line.tolist()))
    at = np.array([0.0, *through.knots, through.length])
    twist = properties["twist"]
    twist["grid"].check_grid(len(twist["values"].numbers()))
    angles = np.interp(at / through.length, twist["grid"].numbers(), twist["values"].numbers())
    section = {
        "stiffness": _matrices(properties["stiff_matrix"], through.length),
        "mass": _matrices(properties["inertia_matrix"], through.length),
    }
    pretwist = iec_pretwist(through.at(at)[1], angles)
    return {"line": line.tolist(), "pretwist": rows_over(at, pretwist), "section": section}


def _matrices(table: _Node, length: float) -> list[list[Any]]:
    """Return the table of matrices from rows of 21 entries."""
    rows = table["values"].entries()
    table["grid"].check_grid(len(rows))
    upper, out = np.triu_indices(6), []
    for row in rows:
        entries = row.numbers()
        if len(entries) != 21:
            row.fail(f"has {len(entries)} entries; must be the 21 of the upper triangle")
        M = np.zeros((6, 6))
        M[upper] = entries
        out.append(turned_matrix(M + np.triu(M, 1).T, FROM_IEC))
    return scaled_rows(table["grid"].numbers(), length, np.array(out))


def _composed(deck: Deck) -> Any:
    """Return the root node of the file, which knows where each value stands."""
    import yaml

    try:
        root = yaml.compose(deck.text, Loader=yaml.SafeLoader)
    except RecursionError:
        deck.fail("is nested too deeply")
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        what = getattr(error, "problem", None) or "no YAML"
        deck.fail(f"not valid YAML: {what}", *((mark.line + 1, mark.column + 1) if mark else ()))
    if root is None:
        deck.fail("is empty")
    return root


class _Node:
    """A value of a YAML file and its place."""

    def __init__(self, deck: Deck, node: Any, path: str = ""):
        self.deck, self.node, self.path = deck, node, path
        self.line, self.column = node.start_mark.line + 1, node.start_mark.column + 1

    def fail(self, reason: str) -> Any:
        """Refuse the file here."""
        return self.deck.fail(f"{self.path or 'the file'} {reason}", self.line, self.column)

    def get(self, key: str) -> _Node | None:
        """Return what stands at a key; None if nothing does."""
        if self.node.id != "mapping":
            self.fail("must be a mapping of keys to values")
        pairs = {name.value: value for name, value in self.node.value if name.id == "scalar"}
        return _Node(self.deck, pairs[key], f"{self.path}.{key}".lstrip(".")) if key in pairs else None

    def __getitem__(self, key: str) -> _Node:
        found = self.get(key)
        return self.fail(f"has no {key}") if found is None else found

    def entries(self) -> list[_Node]:
        """Return the entries of a list."""
        if self.node.id != "sequence" or not self.node.value:
            self.fail("must be a list that is not empty")
        return [_Node(self.deck, entry, f"{self.path}[{i}]") for i, entry in enumerate(self.node.value)]

    def numbers(self) -> Array:
        """Return the numbers of a list, (n,)."""
        entries = self.entries()
        for entry in entries:
            if entry.node.id != "scalar":
                entry.fail("must be a number")
        return np.array([self.deck.value(e.node.value, e.line, e.column) for e in entries])

    def check_grid(self, count: int) -> None:
        """Refuse a grid that does not run from 0 to 1 with one place for each value."""
        grid = self.numbers()
        if len(grid) != count or len(grid) < 2:
            self.fail(f"has {len(grid)} places for {count} values")
        if grid[0] != 0.0 or not np.isclose(grid[-1], 1.0, rtol=1e-6) or np.any(np.diff(grid) <= 0.0):
            self.fail("must rise from 0 to 1")


register(BladeFormat("windio", "windIO, a YAML file with components.blade", recognises, read))
