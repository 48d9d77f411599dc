"""HAWC2's st file: sets of sections over the arc length, with centres or with full matrices (FPM); and its htc file.

As the manual of HAWC2 has them, x_c2 to the leading edge and y_c2 to the suction side: centres from the line of c2_def;
stiffness about the elastic centre along principal axes that are turned by `pitch`, shear and torsion about the shear
centre, of a full matrix all about the elastic centre; order of a matrix: shear in x, y, axial, bending about x, y,
torsion. Radii of gyration are about the mass centre along the principal axes, as in the public files of reference
turbines, whose matrices of OpenFAST say the same (the manual speaks of the elastic centre). The line and its twist are
not in this file but in c2_def: `line` and `pretwist` of the scene, or a straight blade. A main body of the htc file has
both, from the half chord, whose first point is the clamp here; its twist is about z, right-handed, as `pretwist` is.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from rotfem.registry import register
from rotfem.scene.blades.axes import FROM_HAWC2, about_axis, is_positive, rows_over, shifted, turned_matrix
from rotfem.scene.blades.deck import Deck
from rotfem.scene.blades.formats import Asked, BladeFormat
from rotfem.scene.blades.hawc2_body import c2_def, is_htc, main_body, named_file
from rotfem.scene.reference_line import as_line, line_through
from rotfem.scene.values import Array, problem

#: Columns of a row with centres, and with a full matrix.
CENTRES = [
    *("r", "m", "x_cg", "y_cg", "ri_x", "ri_y", "x_sh", "y_sh", "E", "G", "I_x", "I_y", "I_p"),
    *("k_x", "k_y", "A", "pitch", "x_e", "y_e"),
]
FULL = ["r", "m", "x_cg", "y_cg", "ri_x", "ri_y", "pitch", "x_e", "y_e"]
FULL += [f"K{i + 1}{j + 1}" for i, j in zip(*np.triu_indices(6), strict=True)]

#: Columns that must be greater than 0.
POSITIVE = (
    "m",
    "ri_x",
    "ri_y",
    "E",
    "G",
    "I_x",
    "I_y",
    "I_p",
    "k_x",
    "k_y",
    "A",
    "K11",
    "K22",
    "K33",
    "K44",
    "K55",
    "K66",
)

#: Part by which the last r may differ from the length of the line, which HAWC2 has by a spline of its own.
SAME_LENGTH = 1e-3


def recognises(deck: Deck) -> bool:
    """Return whether there are main bodies, or lines of sets (#1) and of their parts ($1 with a number of rows)."""
    return is_htc(deck) or (
        any(re.match(r"\s*#\d+", line) for line in deck.lines) and any(_part(line) for line in deck.lines)
    )


def _part(line: str) -> re.Match[str] | None:
    return re.match(r"\s*\$(\d+)\s+(\d+)\s*($|\S)", line)


def read(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return length and section of an st file, or line, pretwist and section of the body that section.body names."""
    if is_htc(deck):
        return _body(deck, asked)
    if "body" in asked.section:
        raise problem("section.body", asked.section["body"], "is only of an htc file; section.set is of an st file")
    r, stiffness, mass = _sections(deck, asked.section.get("set"))
    return {"length": float(r[-1]), "section": {"stiffness": rows_over(r, stiffness), "mass": rows_over(r, mass)}}


def _body(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return line, pretwist and section of a main body of an htc file."""
    if "set" in asked.section:
        raise problem("section.set", asked.section["set"], f"given twice; {deck.path.name} has it too")
    wanted = asked.section.get("body")
    if wanted is not None and not isinstance(wanted, str):
        raise problem("section.body", wanted, "must be the name of a main body")
    body = main_body(deck, wanted)
    kind = body.command("type")
    if kind.words[1].lower() != "timoschenko":
        kind.fail(f"the type {kind.words[1]} is not known; known: timoschenko", 2)
    if (extra := body.find("concentrated_mass")) is not None:
        extra.fail("concentrated_mass is not read; take it out and give structure.masses in the scene")
    points, head = c2_def(body)
    table = np.array(points)
    line = (table[:, :3] - table[0, :3]) @ FROM_HAWC2.T
    through = line_through(as_line(line.tolist()))
    at = np.array([0.0, *through.knots, through.length])
    if len(at) != len(line):
        head.fail("two points of c2_def are the same")
    beam = body.block("timoschenko_input")
    which, full = beam.command("set"), beam.find("fpm")
    st = named_file(beam.command("filename"), deck)
    r, stiffness, mass = _sections(st, [which.whole(2), which.whole(3)], None if full is None else bool(full.whole(2)))
    if abs(r[-1] / through.length - 1.0) > SAME_LENGTH:
        which.fail(f"its sections end at r = {r[-1]:g} m, and the line of c2_def at {through.length:g} m")
    r = r * (through.length / r[-1])
    r[-1] = through.length
    section = {"stiffness": rows_over(r, stiffness), "mass": rows_over(r, mass)}
    return {"line": line.tolist(), "pretwist": rows_over(at, np.radians(table[:, 3])), "section": section}


def _sections(deck: Deck, wanted: Any, full: bool | None = None) -> tuple[Array, Array, Array]:
    """Return r (n,) and matrices (n, 6, 6) of stiffness and mass of a set, which must be given where there are several.

    Args:
        deck: the st file.
        wanted: [set, part], or None.
        full: whether an htc file says that it has full matrices; None if nothing does.
    """
    parts = _parts(deck)
    names = ", ".join(f"[{number}, {part}]" for number, part in parts)
    if wanted is None and len(parts) > 1:
        raise problem("section.set", None, f"must say which of the sets of {deck.path.name}: {names}")
    key = next(iter(parts)) if wanted is None else next((each for each in parts if list(each) == wanted), None)
    if key is None:
        raise problem("section.set", wanted, f"is not in {deck.path.name}; allowed: {names}")
    first, count = parts[key]
    columns = len(deck.lines[first - 1].split()) if first <= len(deck.lines) else 0
    known = {len(names): names for names in (CENTRES, FULL) if full is None or full == (names is FULL)}
    if columns not in known:
        kinds = {len(CENTRES): "with centres", len(FULL): "with a full matrix"}
        allowed = ", or ".join(f"{number} {kinds[number]}" for number in known)
        deck.fail(f"has {columns} columns; must be {allowed}" + ("" if full is None else f", as FPM {full:d}"), first)
    table = dict(zip(known[columns], np.array(deck.rows(first, count, columns)).T, strict=True))
    deck.increasing(table["r"], first, what="r")
    for column, name in enumerate(known[columns], start=1):
        for i in np.flatnonzero(table[name] <= 0.0) if name in POSITIVE else ():
            deck.fail(f"{name} must be greater than 0, not {table[name][i]:g}", first + int(i), column)
    rows = [{name: float(values[i]) for name, values in table.items()} for i in range(count)]
    stiffness = np.array([_stiffness(row) for row in rows])
    for i, matrix in enumerate(stiffness):
        if not is_positive(matrix):
            deck.fail("the stiffness matrix is not positive definite", first + i)
    mass = np.array([_mass(row) for row in rows])
    return table["r"], stiffness, mass


def _parts(deck: Deck) -> dict[tuple[int, int], tuple[int, int]]:
    """Return (set, part) ↦ (first line, number of rows)."""
    out: dict[tuple[int, int], tuple[int, int]] = {}
    number = 0
    for line, text in enumerate(deck.lines, start=1):
        if found := re.match(r"\s*#(\d+)", text):
            number = int(found[1])
        elif part := _part(text):
            if number == 0:
                deck.fail("a part ($) before its set (#)", line)
            if int(part[2]) < 2:
                deck.fail(f"must have at least two rows, not {part[2]}", line, 2)
            out[number, int(part[1])] = (line + 1, int(part[2]))
    if not out:
        deck.fail("has no set (#1) with a part ($1 and its number of rows)")
    return out


def _stiffness(row: dict[str, float]) -> Array:
    """Return the stiffness matrix along our axes about the line of c2_def."""
    elastic, turn = (row["x_e"], row["y_e"]), about_axis(np.radians(row["pitch"]))
    if "K11" in row:
        K = np.zeros((6, 6))
        for i, j in zip(*np.triu_indices(6), strict=True):
            K[i, j] = K[j, i] = row[f"K{i + 1}{j + 1}"]
        principal, B = turned_matrix(K, FROM_HAWC2), shifted(elastic, elastic)
    else:
        E, G, A = row["E"], row["G"], row["A"]
        shear = (row["k_x"] * G * A, row["k_y"] * G * A)
        principal = np.diag([E * A, *shear, G * row["I_p"], E * row["I_x"], E * row["I_y"]])
        B = shifted(elastic, (row["x_sh"], row["y_sh"]))
    return np.asarray(B.T @ turn @ principal @ turn.T @ B)


def _mass(row: dict[str, float]) -> Array:
    """Return the mass matrix along our axes about the line of c2_def."""
    m, turn = row["m"], about_axis(np.radians(row["pitch"]))
    flap, edge = m * row["ri_x"] * row["ri_x"], m * row["ri_y"] * row["ri_y"]
    center = (row["x_cg"], row["y_cg"])
    B = shifted(center, center)
    return np.asarray(B.T @ turn @ np.diag([m, m, m, flap + edge, flap, edge]) @ turn.T @ B)


register(BladeFormat("hawc2", "HAWC2's st file, with centres or full matrices, or its htc file", recognises, read))
