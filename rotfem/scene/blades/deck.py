"""Blade files of other programs: text with errors that name line and column, what a format is, axes and matrices."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, NoReturn

import numpy as np
import numpy.typing as npt

from rotfem.errors import show, shown
from rotfem.registry import Registry
from rotfem.registry import blade_formats as registered
from rotfem.scene.files import Unreadable, number_in, read_bytes
from rotfem.scene.reference_line import ReferenceLine, as_line, line_through
from rotfem.scene.table import as_name, in_units, problem, problems_at
from rotfem.scene.values import DIGITS, Array


def find_file(folder: Path, name: str) -> Path | None:
    """Return the path of a file from a folder, its name as Windows may have it; None if there is none."""
    path = folder
    for part in Path(name.replace("\\", "/")).parts:
        here = path / part
        if not here.exists() and path.is_dir():
            others = [each for each in path.iterdir() if each.name.lower() == part.lower()]
            here = others[0] if len(others) == 1 else here
        path = here
    return path.resolve() if name and path.is_file() else None


class Deck:
    """A blade file, in UTF-8 or else in Latin-1, as old ones are.

    Attributes:
        path: the file.
        text: its content, lines ended by line feeds.
        lines: without their ends; messages count them from 1.
    """

    def __init__(self, path: Path):
        self.path = path
        try:
            content = read_bytes(path)
        except Unreadable as error:
            raise problem("section.from", shown(path), f"cannot be read: {error}") from None
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
        self.text = text.replace("\r\n", "\n").replace("\r", "\n")
        self.lines = self.text.split("\n")

    def fail(self, reason: str, line: int | None = None, column: int | None = None) -> NoReturn:
        """Refuse the file: what is wrong and what is allowed, with line and column of the value, from 1."""
        where = "" if line is None else f"line {line}: " if column is None else f"line {line}, column {column}: "
        raise problem("section.from", shown(self.path), f"{where}{reason}")

    def refuse(self, name: str, reason: str) -> NoReturn:
        """Refuse the value of the line `value  name …`."""
        self.fail(reason, self.named(name)[0], 1)

    def find(self, words: str) -> int:
        """Return the number of the first line in which all words stand, whatever their case."""
        wanted = words.lower().split()
        for number, line in enumerate(self.lines, start=1):
            if all(word in line.lower() for word in wanted):
                return number
        self.fail(f'no line with "{words}"')

    @cached_property
    def _named(self) -> dict[str, tuple[int, str]]:
        """Name ↦ (line, value) of the first line `value  name …`, as input files of NREL's programs have them."""
        out: dict[str, tuple[int, str]] = {}
        for number, line in enumerate(self.lines, start=1):
            if words := re.match(r"""\s*("[^"]*"|'[^']*'|\S+)\s+(\S+)""", line):
                out.setdefault(words[2].rstrip(":-,").lower(), (number, words[1].strip("\"'")))
        return out

    def has(self, name: str) -> bool:
        """Return whether there is a line `value  name …`."""
        return name.lower() in self._named

    def named(self, name: str) -> tuple[int, str]:
        """Return (line, value) of the line `value  name …`."""
        if not self.has(name):
            self.fail(f"no line with a value of {name}")
        return self._named[name.lower()]

    def file(self, name: str) -> Deck:
        """Return the file that the line `value  name …` names, beside this one."""
        line, value = self.named(name)
        if (path := find_file(self.path.parent, value)) is None:
            self.fail(f"there is no file {show(value)} beside it", line)
        return Deck(path)

    def number(self, name: str) -> float:
        """Return the number of the line `value  name …`."""
        line, text = self.named(name)
        return self.value(text, line, 1)

    def count(self, name: str, least: int) -> int:
        """Return the whole number of the line `value  name …`, at least so many."""
        line, text = self.named(name)
        if not text.isdecimal() or int(text) < least:
            self.fail(f"{name} must be a whole number, at least {least}", line, 1)
        return int(text)

    def value(self, text: str, line: int, column: int) -> float:
        """Return a word as a finite number; exponents may have Fortran's D."""
        number = number_in(re.sub(r"[dD]", "e", text))
        if number is None or not math.isfinite(number):
            self.fail("must be a finite number", line, column)
        return number

    def row(self, line: int, columns: int) -> list[float]:
        """Return the numbers of a line that has so many columns; what stands behind them is refused."""
        if line > len(self.lines):
            self.fail(f"the file ends before line {line}, where {columns} numbers should stand")
        words = self.lines[line - 1].split()
        if len(words) != columns:
            self.fail(f"has {len(words)} columns; must be {columns}", line)
        return [self.value(word, line, column) for column, word in enumerate(words, start=1)]

    def table(self, first: int, count: int, names: Sequence[str]) -> dict[str, Array]:
        """Return the columns (count,) of successive lines by name."""
        rows = [self.row(first + i, len(names)) for i in range(count)]
        return dict(zip(names, np.array(rows).T, strict=True))

    def columns(
        self,
        words: str,
        count: int,
        places: str,
        known: Collection[str],
        needed: Sequence[str],
    ) -> tuple[Array, dict[str, Array], int]:
        """Return the places of stations, columns there by name, and their first line, below the line with `words`."""
        head = self.find(words)
        right = {name.lower(): name for name in known}
        first, *names = [right.get(word.lower(), word) for word in self.lines[head - 1].split()]
        for column, name in enumerate(names, start=2):
            if name not in known or name in names[: column - 2]:
                why = f'the column "{name}" is not known, or stands twice; known: {", ".join(known)}'
                self.fail(why, head, column)
        if first not in places.split() or not set(needed) <= set(names):
            self.fail(f"the columns must be {places.replace(' ', ' or ')}, {', '.join(needed)}", head)
        table = self.table(head + 2, count, [first, *names])
        x = table.pop(first)
        self.increasing(x, range(head + 2, head + 2 + count), 1.0, first)
        return x, table, head + 2

    def hub_and_length(self, hub: str, tip: str) -> tuple[float, float]:
        """Return the radius of the hub and the length beyond it (m) of lines `value  name …`."""
        return self.number(hub), self.number(tip) - self.number(hub)

    def increasing(
        self, values: Sequence[float] | Array, lines: Sequence[int], last: float = 0.0, what: str = ""
    ) -> None:
        """Refuse a first column, on these lines, that does not rise from 0 strictly, to `last` if that is given."""
        ends = not last or math.isclose(values[-1], last, rel_tol=DIGITS)
        if values[0] != 0.0 or not np.all(np.diff(values) > 0.0) or not ends:
            self.fail(f"{what} must rise from 0{f' to {last:g}' if last else ''}", lines[0], 1)


# --- formats ---------------------------------------------------------------------------------------------------------

#: What the stiffness EI/L² or EI of bending is multiplied by for stiffnesses that are called rigid: what they add to
#: deflections is below a millionth, and round-off stays below 1e-9.
RIGID = 1e6

#: Keys of [structure] that a scene may give although the file has them: they say how the blade is used.
SETTINGS = ("damping", "root")


@dataclass(frozen=True)
class Asked:
    """What a scene gives of a blade in addition to its file.

    Attributes:
        structure: the table [structure] as it is given, without its section.
        section: the table of the section as it is given.
        hints: what the files have and the scene does not get; readers add to it.
        rigid: properties that the files leave open, of a scene whose section.rigid says that they are large.
    """

    structure: Mapping[str, Any]
    section: Mapping[str, Any]
    hints: list[str] = field(default_factory=list)
    rigid: list[str] = field(default_factory=list)

    def length(self, deck: Deck, why: str) -> float:
        """Return structure.length (m), which the file does not have; refuse a scene without."""
        with problems_at("length", None):
            length = in_units(self.structure.get("length"), ["m"])
        if not isinstance(length, int | float) or isinstance(length, bool) or not length > 0.0:
            raise problem("length", length, f"must be given, greater than 0 (m), with {deck.path.name}: {why}")
        return float(length)

    def needs(self, deck: Deck, keys: tuple[str, ...], why: str) -> None:
        """Refuse a file that leaves properties open which the scene does not give."""
        missing = [key for key in keys if key not in self.section]
        if self.section.get("rigid") is True:
            self.rigid.extend(missing)
        elif missing:
            given = f"must have {', '.join(missing)}, or rigid = true (import --rigid), with {deck.path.name}: {why}"
            raise problem("section", None, given)

    def leaves_out(self, deck: Deck, what: str, key: str = "") -> None:
        """Say what a file has that is not taken, and the key of the scene that takes its place."""
        self.hints.append(f"{deck.path.name}: left out: {what}" + (f"; {key} is the key for it" if key else ""))


@dataclass(frozen=True)
class BladeFormat:
    """A format of blade files.

    Attributes:
        name: what `section.format` calls it.
        what: description of the files.
        recognises: file ↦ whether it has the format.
        read: (file, what the scene gives in addition) ↦ keys of [structure], section among them.
    """

    registry: ClassVar[Registry[BladeFormat]] = registered

    name: str
    what: str
    recognises: Callable[[Deck], bool]
    read: Callable[[Deck, Asked], dict[str, Any]]


def format_of(deck: Deck, name: Any) -> BladeFormat:
    """Return the format that is asked for, or the one format that a file says it has."""
    if name is not None:
        chosen: BladeFormat = registered[as_name(name, registered, "section.format")]
        return chosen
    found: list[BladeFormat] = [each for each in registered if each.recognises(deck)]
    if len(found) != 1:
        known = "; ".join(f"{show(each.name)}: {each.what}" for each in registered)
        deck.fail(f"does not say which format it has; give section.format, or a file of one of these: {known}")
    return found[0]


def keys_of(path: Path, asked: Asked) -> dict[str, Any]:
    """Return the keys of [structure] that a blade file stands for, and those that the scene may give itself."""
    deck = Deck(path)
    kind = format_of(deck, asked.section.get("format"))
    with problems_at("section.from", shown(path)), np.errstate(all="ignore"):
        read = kind.read(deck, asked)  # what overflows is refused by the section, with its key
    own = {key: value for key, value in asked.section.items() if key not in ("from", "format", "set", "body", "rigid")}
    if asked.rigid:
        _complete(deck, asked, read)
    for where, given, there in (("section.", own, read["section"]), ("", asked.structure, read)):
        for key in there:
            if key in given and key not in ("section", *SETTINGS):
                raise problem(f"{where}{key}", None, f"given twice; {path.name} has it too")
    settings = {key: asked.structure[key] for key in SETTINGS if key in asked.structure}
    return {**asked.structure, **read, **settings, "section": {**read["section"], **own}}


def _complete(deck: Deck, asked: Asked, read: dict[str, Any]) -> None:
    """Give stiffnesses that a file leaves open values at which they add nothing; a hint says them."""
    section = read["section"]
    bending = max(float(np.max([row[1] for row in section[key]])) for key in ("EI2", "EI3"))
    length = read.get("length") or asked.length(deck, "rigid stiffnesses follow from it")
    large = {key: RIGID * bending / (1.0 if key == "GJ" else length**2) for key in asked.rigid}
    section |= large
    asked.hints.append(f"{deck.path.name}: rigid: " + ", ".join(f"{key} = {large[key]:.3g}" for key in large))


# --- from the axes of files to those of a spatial beam (docs/blades.md) -----------------------------------------------

#: Components along our axes 1, 2, 3 from those along x (flapwise, downwind), y (to the trailing edge), z (to the tip)
#: of IEC 61400-13 and OpenFAST.
FROM_IEC = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])

#: The same from x (to the leading edge), y (downwind, suction side), z (to the tip) of HAWC2.
FROM_HAWC2 = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def turned_matrix(matrix: npt.ArrayLike, axes: Array) -> Array:
    """Return a 6×6 matrix along our axes; axes (3, 3) gives components along ours from those of the file."""
    both = np.kron(np.eye(2), axes)
    return np.asarray(both @ np.asarray(matrix) @ both.T)


def scaled_rows(x: npt.ArrayLike, length: float, values: npt.ArrayLike) -> list[list[Any]]:
    """Return the table [[x, value], …] of values over fractions of the length, ended by the length exactly."""
    places = np.asarray(x, dtype=float) * length
    places[-1] = length
    return rows_over(places, values)


def rows_over(x: npt.ArrayLike, values: npt.ArrayLike) -> list[list[Any]]:
    """Return the table [[x, value], …] of places (m) and values there, numbers, points or matrices."""
    return [[float(place), value.tolist()] for place, value in zip(np.asarray(x), np.asarray(values), strict=True)]


def iec_pretwist(tangent: Array, twist: Array) -> Array:
    """Return the pretwist (n,), rad, of a twist (n,) about −z from axes whose x has no part along y, as in BeamDyn.

    It is −twist, and the angle about the tangents (n, 3) from our axis 3 without twist to that x.
    """
    t_2 = np.cross([0.0, 0.0, 1.0], tangent)
    t_2 /= np.linalg.norm(t_2, axis=1)[:, None]
    t_3 = np.cross(tangent, t_2)
    x = np.cross([0.0, -1.0, 0.0], tangent)  # across our axis 2, which is −y
    x /= np.linalg.norm(x, axis=1)[:, None]
    between = np.arctan2(-np.sum(x * t_2, axis=1), np.sum(x * t_3, axis=1))
    return np.asarray(between - np.unwrap(twist))


def coned_root(radius: float, precone: float) -> dict[str, Any]:
    """Return the keys of a hub radius along the coned axis (m) and a precone (rad, towards axis 3)."""
    if precone == 0.0:
        return {"hub_radius": radius}
    offset = [radius * float(np.cos(precone)), 0.0, radius * float(np.sin(precone))]
    return {"hub_offset": offset, "precone": precone}


def line_of(points: npt.ArrayLike) -> tuple[list[Any], ReferenceLine, Array]:
    """Return the rows of a line through points (m) from its first one, the line itself and its arc lengths there."""
    rows = (np.asarray(points) - np.asarray(points)[0]).tolist()
    through = line_through(as_line(tuple(map(tuple, rows))))
    return rows, through, np.array([0.0, *through.knots, through.length])
