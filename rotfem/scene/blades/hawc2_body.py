"""Main bodies in HAWC2's input file (htc): which st file a body has, and its line and twist (c2_def).

A command is the words of a line up to a semicolon; `begin NAME` and `end` bracket blocks, `continue_in_file` goes on in
another file, which `exit` ends. Paths start where HAWC2 is run, which the file does not say: here at the folder of the
htc file or at one of the two above, where its models have their folders `htc` and `htc/_master`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NoReturn

from rotfem.errors import show
from rotfem.scene.blades.deck import Deck
from rotfem.scene.values import problem

#: Files within files, at most.
DEEPEST = 8


@dataclass(frozen=True)
class Command:
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

    def whole(self, column: int) -> int:
        """Return a word as a whole number."""
        number = self.number(column)
        if number != int(number):
            self.fail(f"{number:g} must be a whole number", column)
        return int(number)


@dataclass
class Block:
    """What stands between `begin NAME` and its end: commands and blocks in it."""

    begin: Command
    commands: list[Command] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)

    @property
    def name(self) -> str:
        """What `begin` says."""
        return self.begin.words[1].lower() if len(self.begin.words) > 1 else ""

    def find(self, name: str) -> Command | None:
        """Return the last command of a name; None if there is none."""
        found = [each for each in self.commands if each.words[0].lower() == name]
        return found[-1] if found else None

    def command(self, name: str) -> Command:
        """Return a command that must be there, with something behind its name."""
        found = self.find(name)
        if found is None:
            self.begin.fail(f"begin {self.name} has no {name}")
        if len(found.words) < 2:
            found.fail(f"{name} has nothing behind it")
        return found

    def block(self, name: str) -> Block:
        """Return a block that must be there."""
        found = next((each for each in self.blocks if each.name == name), None)
        if found is None:
            self.begin.fail(f"begin {self.name} has no begin {name}")
        return found


def is_htc(deck: Deck) -> bool:
    """Return whether there is a main body."""
    return any(line.lower().split(";")[0].split()[:2] == ["begin", "main_body"] for line in deck.lines) or any(
        line.lower().split()[:1] == ["continue_in_file"] for line in deck.lines
    )


def main_body(deck: Deck, wanted: str | None) -> Block:
    """Return a main body by its name, or the only one there is; a copy is the body that it copies.

    Raises:
        PydanticCustomError: there is none of that name, or the scene must say which.
    """
    bodies = {block.command("name").words[1]: block for block in _main_bodies(deck)}
    allowed = ", ".join(show(name) for name in bodies)
    if not bodies:
        deck.fail("has no begin main_body")
    if wanted is None and len(bodies) > 1:
        raise problem("section.body", None, f"must say which of the main bodies of {deck.path.name}: {allowed}")
    name = next(iter(bodies)) if wanted is None else wanted
    for _ in bodies:
        if name not in bodies:
            raise problem("section.body", name, f"is not in {deck.path.name}; allowed: {allowed}")
        copied = bodies[name].find("copy_main_body")
        if copied is None:
            return bodies[name]
        name = copied.words[1] if len(copied.words) > 1 else ""
    bodies[name].begin.fail("main bodies copy each other in a circle")


def c2_def(body: Block) -> tuple[list[list[float]], Command]:
    """Return rows (x, y, z in m, twist in degrees) of a body's line, and the command that says how many there are."""
    block = body.block("c2_def")
    head = block.command("nsec")
    count = head.whole(2)
    sections = [each for each in block.commands if each.words[0].lower() == "sec"]
    if count < 2 or len(sections) != count:
        head.fail(f"nsec is {count}, at least 2, and there are {len(sections)} lines of sec", 2)
    for number, section in enumerate(sections, start=1):
        if section.whole(2) != number:
            section.fail(f"must be section {number}, not {section.words[1]}", 2)
        if len(section.words) != 6:
            section.fail(f"has {len(section.words)} columns; must be sec, its number, x, y, z and twist")
    return [[section.number(column) for column in range(3, 7)] for section in sections], head


def _main_bodies(deck: Deck) -> list[Block]:
    """Return all main bodies of a file and of those in which it continues."""
    found: list[Block] = []
    stack: list[Block] = []
    for command in _commands(deck, deck, DEEPEST):
        word = command.words[0].lower()
        if word == "begin":
            block = Block(command)
            if stack:
                stack[-1].blocks.append(block)
            stack.append(block)
        elif word == "end":
            if not stack:
                command.fail("an end without a begin")
            if (closed := stack.pop()).name == "main_body":
                found.append(closed)
        elif stack:
            stack[-1].commands.append(command)
    if stack:
        stack[-1].begin.fail(f"begin {stack[-1].name} has no end")
    return found


def _commands(deck: Deck, main: Deck, depth: int) -> Iterator[Command]:
    """Yield the commands of a file, with those of files in which it continues in their places."""
    for line, text in enumerate(deck.lines, start=1):
        words = text.split(";")[0].split()
        if not words:
            continue
        command = Command(deck, line, words)
        word = words[0].lower()
        if word == "exit":
            return
        if word != "continue_in_file":
            yield command
        elif depth == 0:
            command.fail(f"continues in more than {DEEPEST} files, one in the other")
        else:
            if len(words) < 2:
                command.fail("continue_in_file has nothing behind it")
            yield from _commands(named_file(command, main), main, depth - 1)


def named_file(command: Command, main: Deck) -> Deck:
    """Return the file that a command names, from the folder of the main file or from one of the two above.

    Raises:
        PydanticCustomError: it is in none of them, or there are several.
    """
    name = command.words[1].strip("\"'").replace("\\", "/")
    places = {(folder / name).resolve() for folder in list(main.path.parents)[:3]}
    found = sorted(path for path in places if path.is_file())
    if len(found) != 1:
        what = "there is no file" if not found else "there are several files"
        command.fail(f"{what} {show(name)} from the folder of {main.path.name} or the two above", 2)
    return Deck(found[0])
