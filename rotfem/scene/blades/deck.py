"""The text of a blade file, read line by line, with errors that name file, line and column."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from rotfem.errors import show, shown
from rotfem.scene.files import SHOWN_CELL, Unreadable, read_bytes
from rotfem.scene.values import problem

#: Bytes of a blade file, at most.
LARGEST = 50_000_000


def find_file(folder: Path, name: str) -> Path | None:
    r"""Return the path of a file, from a folder, None if there is none.

    Programs on Windows wrote the name: its parts may be joined by \\ and have letters of another case, if only one
    entry of the folder has that name then.
    """
    path = folder
    try:
        for part in Path(name.replace("\\", "/")).parts:
            here = path / part
            if not here.exists() and path.is_dir():
                others = [each for each in path.iterdir() if each.name.lower() == part.lower()]
                here = others[0] if len(others) == 1 else here
            path = here
        return path.resolve() if name and path.is_file() else None
    except (OSError, ValueError):
        return None


class Deck:
    """A blade file, in UTF-8 or else in Latin-1, as old ones are.

    Args:
        path: the file.

    Attributes:
        text: its content, lines ended by line feeds.
        lines: without their ends; messages count them from 1.

    Raises:
        PydanticCustomError: it cannot be read as text.
    """

    def __init__(self, path: Path):
        self.path = path
        try:
            content = read_bytes(path, LARGEST)
        except Unreadable as error:
            raise problem("", shown(path), f"cannot be read: {error.reason}") from None
        if b"\0" in content:
            raise problem("", shown(path), "cannot be read: it is no text")
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
        self.text = text.replace("\r\n", "\n").replace("\r", "\n")
        self.lines = self.text.split("\n")

    def fail(self, reason: str, line: int | None = None, column: int | None = None) -> NoReturn:
        """Refuse the file.

        Args:
            reason: what is wrong and what is allowed.
            line: from 1.
            column: of the value, from 1.

        Raises:
            PydanticCustomError: always.
        """
        where = "" if line is None else f"line {line}: " if column is None else f"line {line}, column {column}: "
        raise problem("", shown(self.path), f"{where}{reason}")

    def check_version(self, program: str, known: Sequence[str], kind: str = "blade") -> None:
        """Refuse a file whose first line does not name a version that is known.

        Args:
            program: whose file it is, which stands before the version.
            known: versions, such as "1.00".
            kind: which of its files it is.

        Raises:
            PydanticCustomError: it names another one, or none.
        """
        found = re.search(rf"{program}\s+V(\d+\.\d+)", self.lines[0], re.IGNORECASE)
        if found is None or found[1] not in known:
            version = found[1] if found else "missing"
            possessive = f"{program}'" if program.endswith("s") else f"{program}'s"
            self.fail(f"the version of {possessive} {kind} file is {version}; known: {', '.join(known)}", 1)

    def find(self, words: str, start: int = 1) -> int:
        """Return the number of the first line, not before start, in which all words stand, whatever their case."""
        wanted = words.lower().split()
        for number, line in enumerate(self.lines[start - 1 :], start=start):
            low = line.lower()
            if all(word in low for word in wanted):
                return number
        self.fail(f'no line with "{words}" from line {start} on')

    def named(self, name: str, start: int = 1) -> tuple[int, str]:
        """Return (line, value) of the line `value  name …`, as input files of NREL's programs have them."""
        if (found := self._named(name, start)) is None:
            self.fail(f"no line with a value of {name} from line {start} on")
        return found

    def has(self, name: str) -> bool:
        """Return whether there is a line `value  name …`."""
        return self._named(name, 1) is not None

    def _named(self, name: str, start: int) -> tuple[int, str] | None:
        for number, line in enumerate(self.lines[start - 1 :], start=start):
            words = re.match(r"""\s*("[^"]*"|'[^']*'|\S+)\s+(\S+)""", line)
            if words and words[2].rstrip(":-,").lower() == name.lower():
                return number, words[1].strip("\"'")
        return None

    def file(self, name: str) -> Deck:
        """Return the file that the line `value  name …` names, beside this one."""
        line, value = self.named(name)
        if (path := find_file(self.path.parent, value)) is None:
            self.fail(f"there is no file {show(value)} beside it", line)
        return Deck(path)

    def number(self, name: str, start: int = 1) -> float:
        """Return the number of the line `value  name …`."""
        line, text = self.named(name, start)
        return self.value(text, line, 1)

    def count(self, name: str, least: int, start: int = 1) -> int:
        """Return the whole number of the line `value  name …`, at least so many."""
        line, text = self.named(name, start)
        if not text.isdecimal() or int(text) < least:
            self.fail(f'{name} is "{text[:SHOWN_CELL]}"; must be a whole number, at least {least}', line, 1)
        return int(text)

    def value(self, text: str, line: int, column: int) -> float:
        """Return a word as a finite number; exponents may have Fortran's D."""
        try:
            number = float(re.sub(r"[dD]", "e", text)) if text.isascii() and "_" not in text else math.nan
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            shown = (
                f'"{text}"' if len(text) <= SHOWN_CELL and text.isprintable() else f"a text of {len(text)} characters"
            )
            self.fail(f"{shown} must be a finite number", line, column)
        return number

    def row(self, line: int, columns: int) -> list[float]:
        """Return the numbers of a line that has so many columns; what stands behind them is refused."""
        if line > len(self.lines):
            self.fail(f"the file ends before line {line}, where {columns} numbers should stand")
        words = self.lines[line - 1].split()
        if len(words) != columns:
            self.fail(f"has {len(words)} columns; must be {columns}", line)
        return [self.value(word, line, column) for column, word in enumerate(words, start=1)]

    def rows(self, first: int, count: int, columns: int) -> list[list[float]]:
        """Return the numbers of successive lines."""
        return [self.row(first + i, columns) for i in range(count)]

    def increasing(self, values: Sequence[float], first: int, last: float | None = None, what: str = "x") -> None:
        """Refuse a first column, on lines from `first` on, that does not rise from 0 strictly (up to `last`)."""
        if values[0] != 0.0:
            self.fail(f"{what} must start at 0, not at {values[0]:g}", first, 1)
        for i in range(1, len(values)):
            if values[i] <= values[i - 1]:
                self.fail(f"{what} must increase: {values[i]:g} ≤ {values[i - 1]:g}", first + i, 1)
        if last is not None and not math.isclose(values[-1], last, rel_tol=1e-6):
            self.fail(f"{what} must end at {last:g}, not at {values[-1]:g}", first + len(values) - 1, 1)
