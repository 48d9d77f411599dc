"""A blade in a windIO file (YAML): reference axis, twist, 6×6 matrices, and of the rotor hub radius and precone.

Version 1 is the ontology of IEA Wind Task 37, without a version in it: `elastic_properties_mb.six_x_six` has axis,
twist and matrices as rows of the upper triangle, angles are in radians. Version 2 has one axis for the blade, the twist
of `outer_shape`, the elements of the matrices by name in `structure.elastic_properties`, and degrees. In both `grid` is
a part of the arc length, and axes and order of the matrices are those of BeamDyn: x flapwise, y edgewise, z along the
blade. Comments in the schema of version 2 have x along the chord; its example blades and its converter from version 1
have not, nor has the reference axis beside them, so a blade that would be stiffer flapwise than edgewise is refused.
"""

from __future__ import annotations

import re
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
from rotfem.scene.values import DIGITS, UPPER, Array, is_positive, symmetric_matrices

#: Key that later versions have, and those that are known.
VERSION, KNOWN = "windIO_version", re.compile(r"2\.[01](\.\d+)?")

#: Characters of a file, at most, without libyaml and with it. A list of single digits, the slowest content, then takes
#: ten seconds; a blade has some 800 000.
MOST_YAML = (900_000, 4_500_000)

#: Elements of a stiffness matrix of version 2, those on the diagonal among them; others are 0 where they are not given.
ELEMENTS = [f"K{place}" for place in UPPER]
DIAGONAL = [f"K{i}{i}" for i in range(1, 7)]


def recognises(deck: Deck) -> bool:
    """Return whether it is a YAML file with a blade among its components."""
    return deck.path.suffix.lower() in (".yaml", ".yml") and all(
        f"{word}:" in deck.text for word in ("components", "blade")
    )


def read(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return line, pretwist and section, and where the file has a hub its radius and precone."""
    tree = _yaml_tree(deck)
    if (version := tree.get(VERSION)) is None:
        return _blade_1(tree) | _hub(tree, degrees=False)
    if not KNOWN.fullmatch(version.text()):
        version.fail(f"is {version.text()}; known are 2.0 and 2.1, and files of the first version, without it")
    return _blade_2(tree["components.blade"]) | _hub(tree, degrees=True)


def _blade_1(tree: YamlNode) -> dict[str, Any]:
    """Return line, pretwist and section of a file of the first version."""
    properties = tree["components.blade.elastic_properties_mb.six_x_six"]
    keys, length = _axis(properties["reference_axis"], properties["twist"], degrees=False)
    section = {"stiffness": _rows_of_21(properties["stiff_matrix"], length, definite=True)}
    section["mass"] = _rows_of_21(properties["inertia_matrix"], length, definite=False)
    return {**keys, "section": section}


def _blade_2(blade: YamlNode) -> dict[str, Any]:
    """Return line, pretwist, section and masses of a file of version 2."""
    properties = blade["structure.elastic_properties"]
    keys, length = _axis(blade["reference_axis"], blade["outer_shape.twist"], degrees=True)
    section = {"stiffness": _stiffness(properties["stiffness_matrix"], length)}
    section["mass"] = _mass(properties["inertia_matrix"], length)
    return {**keys, "section": section, **_point_masses(properties, length)}


def _point_masses(properties: YamlNode, length: float) -> dict[str, Any]:
    """Return the masses along the blade, as flanges."""
    if (table := properties.get("point_mass")) is None:
        return {}
    mass = table["mass"].numbers()
    places = table["grid"].grid(len(mass)) * length
    return {"masses": [{"x": float(x), "mass": float(m)} for x, m in zip(places, mass, strict=True) if m != 0.0]}


def _axis(axis: YamlNode, twist: YamlNode, degrees: bool) -> tuple[dict[str, Any], float]:
    """Return points of the line and rows of pretwist there, and its length; each coordinate has a grid of its own."""
    parts = []
    for name in "xyz":
        values = axis[name]["values"].numbers()
        parts.append((axis[name]["grid"].grid(len(values)), values))
    grid = np.unique(np.concatenate([places for places, _ in parts]))
    grid = grid[np.concatenate([[True], np.diff(grid) > DIGITS])]
    line = np.stack([np.interp(grid, *part) for part in parts], axis=-1) @ FROM_IEC.T
    rows, through, at = line_of(line)
    angles = twist["values"].numbers()
    angles = np.interp(at / through.length, twist["grid"].grid(len(angles)), angles)
    pretwist = iec_pretwist(through.at(at)[1], np.radians(angles) if degrees else angles)
    return {"line": rows, "pretwist": rows_over(at, pretwist)}, through.length


def _hub(tree: YamlNode, degrees: bool) -> dict[str, Any]:
    """Return place and precone of the root, none if there is no hub; the file's cone is positive on either side."""
    hub = tree["components"].get("hub")
    if hub is None:
        return {}
    diameter, cone = hub["diameter"], hub["cone_angle"].number()
    if diameter.number() < 0.0:
        diameter.fail("must be at least 0")
    if cone == 0.0:
        return coned_root(diameter.number() / 2, 0.0)
    orientation = tree["assembly.rotor_orientation"]
    if (side := orientation.text().lower()) not in ("upwind", "downwind"):
        orientation.fail(f'is "{side}"; must be upwind or downwind, which is the sign of the precone')
    precone = (np.radians(cone) if degrees else cone) * (-1.0 if side == "upwind" else 1.0)
    return coned_root(diameter.number() / 2, float(precone))


def _rows_of_21(table: YamlNode, length: float, definite: bool) -> list[list[Any]]:
    """Return the table of matrices, definite or semidefinite, from rows of 21 entries."""
    rows = table["values"].entries()
    grid = table["grid"].grid(len(rows))
    upper = [row.numbers() for row in rows]
    for row, entries in zip(rows, upper, strict=True):
        if len(entries) != len(ELEMENTS):
            row.fail(f"has {len(entries)} entries; must be the 21 of the upper triangle")
    return scaled_rows(grid, length, _matrices(np.array(upper), rows, definite))


def _stiffness(table: YamlNode, length: float) -> list[list[Any]]:
    """Return the table of stiffness matrices from their elements, each over the grid."""
    count = len(table["K44"].numbers())
    grid = table["grid"].grid(count)
    columns = {name: _column(table, name, count, needed=name in DIAGONAL) for name in ELEMENTS}
    for name in DIAGONAL:
        for i in np.flatnonzero(columns[name] <= 0.0):
            table[name].entries()[i].fail(f"is {columns[name][i]:g}; must be greater than 0")
    outer = grid >= 0.5
    if np.all(columns["K44"][outer] < columns["K55"][outer]):
        table["K44"].fail(
            "is less than K55 on the outer half of the blade: x and y of the matrices must be those of the reference "
            "axis, x flapwise, so that K44 is edgewise and K55 flapwise bending"
        )
    upper = np.stack(list(columns.values()), axis=-1)
    return scaled_rows(grid, length, _matrices(upper, table["K44"].entries(), definite=True))


def _mass(table: YamlNode, length: float) -> list[list[Any]]:
    """Return the table of mass matrices from mass, centre and inertias about the reference axis."""
    mass = table["mass"].numbers()
    count = len(mass)
    grid = table["grid"].grid(count)
    for i in np.flatnonzero(mass <= 0.0):
        table["mass"].entries()[i].fail(f"is {mass[i]:g}; must be greater than 0")
    edge, flap, polar = (_column(table, name, count) for name in ("i_edge", "i_flap", "i_plr"))
    x, y, cross = (_column(table, name, count, needed=False) for name in ("cm_x", "cm_y", "i_cp"))
    M = {"K11": mass, "K16": -mass * y, "K22": mass, "K26": mass * x, "K33": mass, "K34": mass * y, "K35": -mass * x}
    M |= {"K44": edge, "K45": -cross, "K55": flap, "K66": polar}
    upper = np.stack([M.get(element, np.zeros(count)) for element in ELEMENTS], axis=-1)
    return scaled_rows(grid, length, _matrices(upper, table["mass"].entries(), definite=False))


def _column(table: YamlNode, name: str, count: int, needed: bool = True) -> Array:
    """Return the values (count,) of an element; zeros where it need not be given and is not."""
    if not needed and table.get(name) is None:
        return np.zeros(count)
    values = table[name].numbers()
    if len(values) != count:
        table[name].fail(f"has {len(values)} values for {count} places")
    return values


def _matrices(upper: Array, places: list[YamlNode], definite: bool) -> Array:
    """Return matrices (n, 6, 6) along our axes of upper triangles (n, 21) along x, y, z; refuse what no section has."""
    out = turned_matrix(symmetric_matrices(upper), FROM_IEC)
    for M, place in zip(out, places, strict=True):
        if not is_positive(M, definite, DIGITS):
            place.fail(
                "is of a matrix that is not positive definite" + ("; nor may shear stiffness be 0" if definite else "")
            )
    return out


# --- YAML whose values know where they stand ----------------------------------------------------------------------


def _yaml_tree(deck: Deck) -> YamlNode:
    """Return the root of a YAML file; refuse one that is none, or empty, or not read in ten seconds."""
    import yaml

    most = MOST_YAML[bool(yaml.__with_libyaml__)]
    if len(deck.text) > most:
        deck.fail(f"has {len(deck.text)} characters; of YAML at most {most} are read")
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
    """Return a loader for which an anchor may be named again: YAML 1.2 allows it (section 3.2.2.2), PyYAML does not.

    Where PyYAML has libyaml, that parses the text.
    """
    import yaml

    fast = bool(yaml.__with_libyaml__)
    parser: Any = yaml.cyaml.CParser if fast else yaml.SafeLoader
    bases = (yaml.composer.Composer, parser, yaml.resolver.Resolver) if fast else (parser,)

    class Loader(*bases):  # type: ignore[misc]
        def __init__(self, text: str) -> None:
            parser.__init__(self, text)
            for base in bases:
                if base is not parser:
                    base.__init__(self)

        def compose_node(self, parent: Any, index: Any) -> Any:
            if not self.check_event(yaml.AliasEvent):
                self.anchors.pop(self.peek_event().anchor, None)
            return super().compose_node(parent, index)

    return Loader


class YamlNode:
    """A value of a YAML file, as the parser composes it, and its place: line, column and keys joined by points."""

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
        if grid[0] != 0.0 or not np.isclose(grid[-1], 1.0, rtol=DIGITS) or np.any(np.diff(grid) <= 0.0):
            self.fail("must rise from 0 to 1")
        return grid


register(BladeFormat("windio", "windIO, a YAML file with components.blade", recognises, read))
