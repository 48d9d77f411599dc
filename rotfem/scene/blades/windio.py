"""A blade in a windIO file (YAML): reference axis, twist, 6×6 matrices, and of the rotor hub radius and precone.

Version 1 is the ontology of IEA Wind Task 37, without a version in it: `elastic_properties_mb.six_x_six` has axis,
twist and matrices as rows of the upper triangle, angles are in radians. Version 2 has one axis for the blade, the twist
of `outer_shape`, the elements of the matrices by name in `structure.elastic_properties`, and degrees. In both `grid` is
a part of the arc length, and axes and order of the matrices are those of BeamDyn: x flapwise, y edgewise, z along the
blade. Comments in the schema of version 2 have x along the chord; its example blades and its converter from version 1
have not, nor has the reference axis beside them, so a blade that would be stiffer flapwise than edgewise is refused.
"""

from __future__ import annotations

from typing import Any, NoReturn

import numpy as np

from rotfem.registry import register
from rotfem.scene.blades.deck import (
    FROM_IEC,
    Asked,
    BladeFormat,
    Deck,
    coned_root,
    iec_pretwist,
    line_of,
    rows_over,
    scaled_rows,
    turned_matrix,
)
from rotfem.scene.values import DIGITS, UPPER, Array, symmetric_matrices

#: Elements of a stiffness matrix of version 2, those on the diagonal among them; others are 0 where they are not given.
ELEMENTS = [f"K{place}" for place in UPPER]
DIAGONAL = [f"K{i}{i}" for i in range(1, 7)]


def recognises(deck: Deck) -> bool:
    """Return whether it is a YAML file with a blade among its components."""
    named = all(f"{word}:" in deck.text for word in ("components", "blade"))
    return deck.path.suffix.lower() in (".yaml", ".yml") and named


def read(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return line, pretwist and section, and where the file has a hub its radius and precone."""
    tree = Node(deck, _tree(deck))
    if (version := tree.get("windIO_version")) is None:
        return _blade_1(tree) | _hub(tree, degrees=False)
    if not version.text().startswith(("2.0", "2.1")):
        version.fail(f"is {version.text()}; known are 2.0 and 2.1, and files of the first version, without it")
    return _blade_2(tree["components.blade"]) | _hub(tree, degrees=True)


def _blade_1(tree: Node) -> dict[str, Any]:
    """Return line, pretwist and section of a file of the first version: rows of the upper triangles."""
    properties = tree["components.blade.elastic_properties_mb.six_x_six"]
    keys, length = _axis(properties["reference_axis"], properties["twist"], degrees=False)
    section = {}
    for name, key in (("stiffness", "stiff_matrix"), ("mass", "inertia_matrix")):
        upper = properties[key]["values"].numbers(len(properties[key]["grid"].grid()), len(ELEMENTS))
        section[name] = _matrices(properties[key], length, upper)
    return {**keys, "section": section}


def _blade_2(blade: Node) -> dict[str, Any]:
    """Return line, pretwist, section and masses along the blade, as flanges, of a file of version 2."""
    properties = blade["structure.elastic_properties"]
    keys, length = _axis(blade["reference_axis"], blade["outer_shape.twist"], degrees=True)
    keys["section"] = {
        "stiffness": _stiffness(properties["stiffness_matrix"], length),
        "mass": _mass(properties["inertia_matrix"], length),
    }
    if (masses := properties.get("point_mass")) is not None:
        grid = masses["grid"].grid()
        pairs = zip(grid * length, masses["mass"].numbers(len(grid)), strict=True)
        keys["masses"] = [{"x": float(x), "mass": float(m)} for x, m in pairs if m != 0.0]
    return keys


def _axis(axis: Node, twist: Node, degrees: bool) -> tuple[dict[str, Any], float]:
    """Return points of the line and rows of pretwist there, and its length; each coordinate has a grid of its own."""
    parts = [axis[name].over_grid() for name in "xyz"]
    grid = np.unique(np.concatenate([places for places, _ in parts]))
    grid = grid[np.concatenate([[True], np.diff(grid) > DIGITS])]
    line = np.stack([np.interp(grid, *part) for part in parts], axis=-1) @ FROM_IEC.T
    rows, through, at = line_of(line)
    angles = np.interp(at / through.length, *twist.over_grid())
    pretwist = iec_pretwist(through.at(at)[1], np.radians(angles) if degrees else angles)
    return {"line": rows, "pretwist": rows_over(at, pretwist)}, through.length


def _hub(tree: Node, degrees: bool) -> dict[str, Any]:
    """Return place and precone of the root, none if there is no hub; the file's cone is positive on either side."""
    hub = tree["components"].get("hub")
    if hub is None:
        return {}
    diameter, cone = hub["diameter"], float(hub["cone_angle"].numbers())
    if (radius := float(diameter.numbers()) / 2) < 0.0:
        diameter.fail("must be at least 0")
    if cone == 0.0:
        return coned_root(radius, 0.0)
    orientation = tree["assembly.rotor_orientation"]
    if (side := orientation.text().lower()) not in ("upwind", "downwind"):
        orientation.fail(f'is "{side}"; must be upwind or downwind, which is the sign of the precone')
    precone = (np.radians(cone) if degrees else cone) * (-1.0 if side == "upwind" else 1.0)
    return coned_root(radius, float(precone))


def _stiffness(table: Node, length: float) -> list[list[Any]]:
    """Return the table of stiffness matrices from their elements, each over the grid."""
    grid = table["grid"].grid()
    columns = {name: _column(table, name, len(grid), needed=name in DIAGONAL) for name in ELEMENTS}
    outer = grid >= 0.5
    if np.all(columns["K44"][outer] < columns["K55"][outer]):
        table["K44"].fail(
            "is less than K55 on the outer half of the blade: x and y of the matrices must be those of the reference "
            "axis, x flapwise, so that K44 is edgewise and K55 flapwise bending"
        )
    return _matrices(table, length, np.stack(list(columns.values()), axis=-1))


def _mass(table: Node, length: float) -> list[list[Any]]:
    """Return the table of mass matrices from mass, centre and inertias about the reference axis."""
    count = len(table["grid"].grid())
    mass, edge, flap, polar = (_column(table, name, count) for name in ("mass", "i_edge", "i_flap", "i_plr"))
    x, y, cross = (_column(table, name, count, needed=False) for name in ("cm_x", "cm_y", "i_cp"))
    M = {"K11": mass, "K16": -mass * y, "K22": mass, "K26": mass * x, "K33": mass, "K34": mass * y, "K35": -mass * x}
    M |= {"K44": edge, "K45": -cross, "K55": flap, "K66": polar}
    upper = np.stack([M.get(element, np.zeros(count)) for element in ELEMENTS], axis=-1)
    return _matrices(table, length, upper)


def _column(table: Node, name: str, count: int, needed: bool = True) -> Array:
    """Return the values (count,) of an element; zeros where it need not be given and is not."""
    if not needed and table.get(name) is None:
        return np.zeros(count)
    return table[name].numbers(count)


def _matrices(table: Node, length: float, upper: Array) -> list[list[Any]]:
    """Return the rows of matrices along our axes, of upper triangles (n, 21) along x, y, z at the places of a grid."""
    return scaled_rows(table["grid"].grid(), length, turned_matrix(symmetric_matrices(upper), FROM_IEC))


# --- YAML -------------------------------------------------------------------------------------------------------------


def _tree(deck: Deck) -> Any:
    """Return the content of a YAML file as texts; anchors may be named again, as in YAML 1.2, not in PyYAML."""
    import yaml

    fast = (yaml.composer.Composer, yaml.cyaml.CParser, yaml.constructor.BaseConstructor, yaml.resolver.BaseResolver)
    bases: Any = fast if yaml.__with_libyaml__ else (yaml.BaseLoader,)

    class Loader(*bases):  # type: ignore[misc]
        def __init__(self, text: str) -> None:
            for base in bases:
                base.__init__(self, *([text] if base in (yaml.cyaml.CParser, yaml.BaseLoader) else []))

        def compose_node(self, parent: Any, index: Any) -> Any:
            if not self.check_event(yaml.AliasEvent):
                self.anchors.pop(self.peek_event().anchor, None)
            return super().compose_node(parent, index)

    try:
        return yaml.load(deck.text, Loader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        what = getattr(error, "problem", None) or "no YAML"
        deck.fail(f"not valid YAML: {what}", *((mark.line + 1, mark.column + 1) if mark else ()))


class Node:
    """A value of a YAML file, and its keys joined by points."""

    def __init__(self, deck: Deck, value: Any, path: str = ""):
        self.deck, self.value, self.path = deck, value, path

    def fail(self, reason: str) -> NoReturn:
        """Refuse the file here."""
        self.deck.fail(f"{self.path or 'the file'} {reason}")

    def get(self, key: str) -> Node | None:
        """Return what stands at a key; None if nothing does."""
        if not isinstance(self.value, dict):
            self.fail("must be a mapping of keys to values")
        return Node(self.deck, self.value[key], f"{self.path}.{key}".lstrip(".")) if key in self.value else None

    def __getitem__(self, key: str) -> Node:
        """Return what stands at a key, or at several that are joined by points."""
        node = self
        for part in key.split("."):
            found = node.get(part)
            if found is None:
                node.fail(f"has no {part}")
            node = found
        return node

    def text(self) -> str:
        """Return a single value as it is written."""
        if not isinstance(self.value, str):
            self.fail("must be a single value")
        return self.value

    def numbers(self, *shape: int) -> Array:
        """Return numbers of a shape."""
        try:
            found = np.array(self.value, dtype=float)
        except (TypeError, ValueError) as error:
            self.fail(f"must be numbers: {error}")
        if found.shape != shape:
            self.fail(f"has {' × '.join(map(str, found.shape)) or 1} values; must have {' × '.join(map(str, shape))}")
        return found

    def grid(self) -> Array:
        """Return places that rise from 0 to 1."""
        grid = self.numbers(len(self.value)) if isinstance(self.value, list) else np.zeros(1)
        if len(grid) < 2 or grid[0] != 0.0 or abs(grid[-1] - 1.0) > DIGITS or np.any(np.diff(grid) <= 0.0):
            self.fail("must rise from 0 to 1")
        return grid

    def over_grid(self) -> tuple[Array, Array]:
        """Return the places and values of a table of both."""
        grid = self["grid"].grid()
        return grid, self["values"].numbers(len(grid))


register(BladeFormat("windio", "windIO, a YAML file with components.blade", recognises, read))
