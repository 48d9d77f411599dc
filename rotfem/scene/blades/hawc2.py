"""HAWC2's st file: sets of sections over the arc length, with centres or with full matrices (FPM); and its htc file.

As the manual of HAWC2 has them, x_c2 to the leading edge and y_c2 to the suction side: centres from the line of c2_def;
stiffness about the elastic centre along principal axes that are turned by `pitch`, shear and torsion about the shear
centre, of a full matrix all about the elastic centre; order of a matrix: shear in x, y, axial, bending about x, y,
torsion. Radii of gyration are about the mass centre along the principal axes, as in the public files of reference
turbines, whose matrices of OpenFAST say the same (the manual speaks of the elastic centre). The line and its twist are
not in this file but in c2_def: `line` and `pretwist` of the scene, or a straight blade. A main body of the htc file has
both, from the half chord, whose first point is the clamp here; its twist is about z, right-handed, as `pretwist` is.

In an htc file a command is the words of a line up to a semicolon; `begin NAME` and `end` bracket blocks,
`continue_in_file` goes on in another file, which `exit` ends. Paths start where HAWC2 is run, which the file does not
say: here at the folder of the htc file or at one of the two above, where its models have `htc` and `htc/_master`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, NamedTuple, NoReturn

import numpy as np

from rotfem.errors import show
from rotfem.registry import register
from rotfem.scene.blades.deck import FROM_HAWC2, Asked, BladeFormat, Deck, find_file, line_of, rows_over, turned_matrix
from rotfem.scene.section import about_reference, mass_matrices
from rotfem.scene.table import problem
from rotfem.scene.values import DIGITS, UPPER, Array, symmetric_matrices

#: Columns of a row with centres, and with a full matrix.
CENTRES = [
    *("r", "m", "x_cg", "y_cg", "ri_x", "ri_y", "x_sh", "y_sh", "E", "G", "I_x", "I_y", "I_p"),
    *("k_x", "k_y", "A", "pitch", "x_e", "y_e"),
]
FULL = ["r", "m", "x_cg", "y_cg", "ri_x", "ri_y", "pitch", "x_e", "y_e"]
FULL += [f"K{place}" for place in UPPER]


def recognises(deck: Deck) -> bool:
    """Return whether there are main bodies, or lines of sets (#1) and of their parts ($1 with a number of rows)."""
    return _is_htc(deck) or (
        any(re.match(r"\s*#\d+", line) for line in deck.lines) and any(_part(line) for line in deck.lines)
    )


def _part(line: str) -> re.Match[str] | None:
    return re.match(r"\s*\$(\d+)\s+(\d+)\s*($|\S)", line)


def read(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return length and section of an st file, or line, pretwist and section of the body that section.body names."""
    if _is_htc(deck):
        return _body(deck, asked)
    if "body" in asked.section:
        raise problem("section.body", asked.section["body"], "is only of an htc file; section.set is of an st file")
    table = _table(deck, asked.section.get("set"))
    return {"length": float(table["r"][-1]), "section": _section(table)}


def _body(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return line, pretwist and section of a main body of an htc file."""
    if "set" in asked.section:
        raise problem("section.set", asked.section["set"], f"given twice; {deck.path.name} has it too")
    wanted = asked.section.get("body")
    if wanted is not None and not isinstance(wanted, str):
        raise problem("section.body", wanted, "must be the name of a main body")
    body = _main_body(deck, wanted)
    kind = _the(body, "type")
    if kind.words[1].lower() != "timoschenko":
        kind.fail(f"the type {kind.words[1]} is not known; known: timoschenko", 2)
    for extra in _all(body, "concentrated_mass"):
        extra.fail("concentrated_mass is not read; take it out and give structure.masses in the scene")
    rows, head = _c2_def(body)
    points = np.array(rows)
    line, through, at = line_of((points[:, :3] - points[0, :3]) @ FROM_HAWC2.T)
    if len(at) != len(line):
        head.fail("two points of c2_def are the same")
    which, full = _the(body, "set"), _all(body, "fpm")
    st = _named_file(_the(body, "filename"), deck)
    table = _table(st, [which.number(2), which.number(3)], bool(full[-1].number(2)) if full else None)
    if abs(table["r"][-1] / through.length - 1.0) > 1e-2:  # r often counts along a straight axis
        which.fail(f"its sections end at r = {table['r'][-1]:g} m, and the line of c2_def at {through.length:g} m")
    if abs(table["r"][-1] / through.length - 1.0) > DIGITS:
        asked.hints.append(
            f"{st.path.name}: its sections end at r = {table['r'][-1]:g} m and the line of c2_def at "
            f"{through.length:g} m: the last section holds up to there"
        )
    for name in ("damping", "damping_posdef", "damping_aniso"):
        if _all(body, name):
            asked.leaves_out(deck, f"{name} of {_the(body, 'name').words[1]}", "structure.damping")
    section = _section(_up_to(table, through.length))
    return {"line": line, "pretwist": rows_over(at, np.radians(points[:, 3])), "section": section}


def _up_to(table: dict[str, Array], length: float) -> dict[str, Array]:
    """Return the columns up to a length (m) beyond which nothing is; the last row holds where they end before."""
    r = table["r"]
    inside = r < length * (1.0 - DIGITS)
    x = np.append(r[inside], length)
    return {name: np.interp(x, r, values) for name, values in table.items()} | {"r": x}


def _table(deck: Deck, wanted: Any, full: bool | None = None) -> dict[str, Array]:
    """Return the columns (n,) of a set, [set, part]; `full`: whether they are full matrices, as an htc file says."""
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
    table = deck.table(first, count, known[columns])
    deck.increasing(table["r"], range(first, first + count), what="r")
    return table


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


def _section(table: dict[str, Array]) -> dict[str, Any]:
    """Return the section of columns: with full matrices, or properties about centres, linear between rows."""
    if "K11" in table:
        return {name: rows_over(table["r"], found) for name, found in _matrices(table).items()}
    table = _with_rows_between(table)
    centres = {"mass_center": "cg", "shear_center": "sh", "tension_center": "e"}
    points = {key: np.stack([table[f"x_{at}"], table[f"y_{at}"]], axis=-1) for key, at in centres.items()}
    other = points | {"principal_angle": np.radians(table["pitch"])}
    return {key: rows_over(table["r"], values) for key, values in (_products(table) | other).items()}


def _products(table: dict[str, Array]) -> dict[str, Array]:
    """Return the properties that are products of columns with centres."""
    m, E, GA = table["m"], table["E"], table["G"] * table["A"]
    return {
        "EA": E * table["A"],
        "GA2": table["k_x"] * GA,
        "GA3": table["k_y"] * GA,
        "GJ": table["G"] * table["I_p"],
        "EI2": E * table["I_x"],
        "EI3": E * table["I_y"],
        "mass_per_length": m,
        "rotary_inertia2": m * table["ri_x"] ** 2,
        "rotary_inertia3": m * table["ri_y"] ** 2,
    }


def _with_rows_between(table: dict[str, Array]) -> dict[str, Array]:
    """Return columns with so many linear parts between rows that products linear there are right to 1e-4."""
    r = table["r"]
    ends, middle = _products(table), _products({name: (c[1:] + c[:-1]) / 2 for name, c in table.items()})
    off = np.max([np.abs((ends[key][1:] + ends[key][:-1]) / (2 * middle[key]) - 1.0) for key in ends], axis=0)
    parts = np.maximum(1, np.ceil(np.sqrt(off / 1e-4))).astype(int)
    places = np.interp(np.arange(parts.sum() + 1), np.cumsum([0, *parts]), r)
    return {name: np.interp(places, r, column) for name, column in table.items()} | {"r": places}


def _matrices(table: dict[str, Array]) -> dict[str, Array]:
    """Return stiffness and mass matrices (n, 6, 6) along our axes about the line of c2_def, of rows with full ones."""
    K = turned_matrix(symmetric_matrices(np.stack([table[f"K{place}"] for place in UPPER], axis=-1)), FROM_HAWC2)
    elastic, center = (np.stack([table[f"x_{at}"], table[f"y_{at}"]], axis=-1) for at in ("e", "cg"))
    m, angle = table["m"], np.radians(table["pitch"])
    mass = mass_matrices(m, m * table["ri_x"] ** 2, m * table["ri_y"] ** 2, center, angle)
    return {"stiffness": about_reference(K, elastic, elastic, angle), "mass": mass}


# --- main bodies of an htc file ---------------------------------------------------------------------------------------


class Command(NamedTuple):
    """The words of a line, and where it stands."""

    deck: Deck
    line: int
    words: list[str]

    def fail(self, reason: str, column: int | None = None) -> NoReturn:
        """Refuse the file here."""
        self.deck.fail(reason, self.line, column)

    def number(self, column: int) -> float:
        """Return a word as a finite number; columns count from 1."""
        if column > len(self.words):
            self.fail(f"has {len(self.words)} columns; {self.words[0]} has a number in column {column}")
        return self.deck.value(self.words[column - 1], self.line, column)


def _is_htc(deck: Deck) -> bool:
    """Return whether there is a main body, or another file that may have one."""
    words = (line.lower().split(";")[0].split() for line in deck.lines)
    return any(each[:2] == ["begin", "main_body"] or each[:1] == ["continue_in_file"] for each in words)


def _all(body: list[Command], name: str) -> list[Command]:
    return [each for each in body if each.words[0].lower() == name]


def _the(body: list[Command], name: str) -> Command:
    """Return the last command of a name, which must be there, with something behind it; its `begin` is the first."""
    found = _all(body, name)
    if not found or len(found[-1].words) < 2:
        (found or body)[-1 if found else 0].fail(f"the main body has no {name} with something behind it")
    return found[-1]


def _main_body(deck: Deck, wanted: str | None) -> list[Command]:
    """Return the commands of a main body by its name, or of the only one; a copy is the body that it copies."""
    bodies = _main_bodies(deck)
    allowed = ", ".join(show(name) for name in bodies)
    if not bodies:
        deck.fail("has no begin main_body")
    if wanted is None and len(bodies) > 1:
        raise problem("section.body", None, f"must say which of the main bodies of {deck.path.name}: {allowed}")
    name = next(iter(bodies)) if wanted is None else wanted
    for _ in bodies:
        if name not in bodies:
            raise problem("section.body", name, f"is not in {deck.path.name}; allowed: {allowed}")
        if not _all(bodies[name], "copy_main_body"):
            return bodies[name]
        name = _the(bodies[name], "copy_main_body").words[1]
    bodies[name][0].fail("main bodies copy each other in a circle")


def _main_bodies(deck: Deck) -> dict[str, list[Command]]:
    """Return name ↦ commands, `begin` first, of the main bodies of a file and of those in which it continues."""
    bodies: dict[str, list[Command]] = {}
    body: list[Command] = []
    for command in _commands(deck, deck):
        word, *behind = (word.lower() for word in command.words)
        main = behind[:1] == ["main_body"]
        body = [command] if main and word == "begin" else [*body, command]
        if main and word == "end":
            bodies[_the(body, "name").words[1]] = body
    return bodies


def _c2_def(body: list[Command]) -> tuple[list[list[float]], Command]:
    """Return rows (x, y, z in m, twist in degrees) of a body's line, and the command that says how many there are."""
    head, sections = _the(body, "nsec"), _all(body, "sec")
    count = int(head.number(2))
    if count < 2 or len(sections) != count:
        head.fail(f"nsec is {count}, at least 2, and there are {len(sections)} lines of sec", 2)
    return [[section.number(column) for column in range(3, 7)] for section in sections], head


def _commands(deck: Deck, main: Deck, depth: int = 30) -> Iterator[Command]:
    """Yield the commands of a file, with those of files in which it continues in their places."""
    for line, text in enumerate(deck.lines, start=1):
        if not (words := text.split(";")[0].split()):
            continue
        command, word = Command(deck, line, words), words[0].lower()
        if word == "exit":
            return
        if word != "continue_in_file":
            yield command
        elif depth == 0:  # a file may name itself
            command.fail("too many files continue one in the other")
        else:
            yield from _commands(_named_file(command, main), main, depth - 1)


def _named_file(command: Command, main: Deck) -> Deck:
    """Return the one file that a command names, from the folder of the main file or from one of the two above."""
    name = (*command.words, "")[1].strip("\"'")
    found = sorted({path for folder in list(main.path.parents)[:3] if (path := find_file(folder, name)) is not None})
    if len(found) != 1:
        what = "there is no file" if not found else "there are several files"
        command.fail(f"{what} {show(name)} from the folder of {main.path.name} or the two above", 2)
    return Deck(found[0])


register(BladeFormat("hawc2", "HAWC2's st file, with centres or full matrices, or its htc file", recognises, read))
